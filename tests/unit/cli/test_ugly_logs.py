"""Ugly logs: a value within its interval, or a flag, or an error; never a wrong number without a word."""

from __future__ import annotations

import pytest
import sweeps
from ugly_logs import KINDS, PAGE, WITHIN, page, said

SAMPLE = sweeps.sample(sorted(KINDS), 8)


@pytest.mark.parametrize(
    "name", [name if name in SAMPLE else pytest.param(name, marks=pytest.mark.system) for name in sorted(KINDS)]
)
def test_no_ugly_log_gives_a_wrong_number_without_a_word(name, tmp_path):
    """A measured value is within 4 standard uncertainties of the truth, a bound is not below it."""
    kind = KINDS[name]
    found = said(kind, tmp_path)
    if found.outcome != "value":
        assert found.sentence
        return
    assert kind.truth is not None, f"nothing can be known of this log, and it gave {found.figures}"
    for figure in found.figures:
        if figure["status"] == "measured":
            assert abs(figure["value"] - kind.truth) <= WITHIN * figure["uncertainty"]
        else:
            assert figure["value"] >= kind.truth * 0.9


@pytest.mark.system
def test_the_page_is_made_from_the_kinds():
    """Every kind with what the command says to it today."""
    assert PAGE.read_text(encoding="utf-8") == page(), "write it anew: python tests/support/ugly_logs.py"
