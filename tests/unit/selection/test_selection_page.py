"""The page of a selection: what it says at first sight, and that nothing in a package is obeyed as markup."""

from __future__ import annotations

import pytest
from selected import criteria, package, taken

from hil.selection.choosing import choose
from hil.selection.page import as_html

_THREE = """
    title: <script>alert(1)</script>
    candidates:
      A: {roles: [gyroscope], instances: [a]}
      B: {roles: [gyroscope], instances: [b]}
      C: {roles: [gyroscope], instances: [c]}
    criteria:
      Noise: {parameter: white_noise, units: {gyroscope: deg/s/sqrt(Hz)}, axes: [x, y]}
"""


@pytest.fixture
def page(tmp_path):
    """Return the page of a selection from values by candidate, each with an uncertainty of 0.1; none is in doubt."""

    def made(**values):
        figures = [
            taken(
                f"gyroscope.{name}.{axis}", abs(value), 0.1, problem="" if value > 0 else "its data are in <b>DOUBT</b>"
            )
            for name, value in values.items()
            for axis in "xy"
        ]
        return as_html(choose(criteria(tmp_path, _THREE), [package(1, figures)], content="c", version="0"))

    return made


def test_the_trade_table_comes_first_and_names_the_best(page):
    """Green where everybody was judged and one is the best."""
    text = page(a=1.0, b=2.0, c=3.0)
    assert '<b class="good">A</b><span class="value">(1.00 ± 0.20) deg/s/sqrt(Hz)</span>' in text
    assert text.index('class="trade"') < text.index('class="places"')
    assert "Nothing: every figure of every package counted." in text


def test_who_cannot_be_told_apart_is_no_winner(page):
    """Two are named side by side; where nobody differs, that is what stands there."""
    assert '<b class="open">A or B</b><span class="soft">cannot be told apart</span>' in page(a=1.0, b=1.1, c=3.0)
    assert '<b class="open">all alike</b><span class="soft">A or C or B: cannot be told apart</span>' in page(
        a=1.0, b=1.1, c=1.05
    )


def test_who_was_not_judged_leaves_a_mark_on_the_winner(page):
    """One of three is the best of one, and nobody is better than all others."""
    text = page(a=1.0, b=-2.0, c=-3.0)
    assert '<b class="open">A</b>' in text
    assert '<span class="soft">the only one</span><span class="badge open">1 of 3 judged</span>' in text
    assert '<span class="told">not judged: B, C</span>' in text
    assert "white_noise of gyroscope.b.x, gyroscope.b.y" in text
    assert '<b class="open">none</b><span class="badge open">0 of 3 judged</span>' in page(a=-1.0)


def test_nothing_is_obeyed_as_markup(page):
    """Not the title of the file, and not the reasons of a package."""
    text = page(a=1.0, b=2.0, c=-3.0)
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in text
    assert "in &lt;b&gt;DOUBT&lt;/b&gt;" in text
