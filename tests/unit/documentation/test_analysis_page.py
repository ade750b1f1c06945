"""The reference page of the analyses says what the code says."""

from __future__ import annotations

import ast

import analysis_page


def test_the_page_is_made_from_the_code():
    """The page has every public function with its present docstring."""
    made = analysis_page.page()
    written = analysis_page.PAGE.read_text(encoding="utf-8")
    assert written == made, "write it again: python tests/support/analysis_page.py"


def test_signatures_and_parts_are_written_out():
    """A function has its arguments without types, and its named parts as lists; code keeps its marks."""
    source = '''
def area(width: float, *, scale_by: float = 1.0) -> float:
    """Return width * scale_by, as `width * scale_by` is.

    Args:
        width: in m,
            above zero.
        scale_by: as it is.

    Raises:
        ValueError: where it is not.
    """
'''
    node = ast.parse(source).body[0]
    assert analysis_page.entry(node).splitlines() == [
        "### `area(width, *, scale_by=1.0)`",
        "",
        r"Return width \* scale\_by, as `width * scale_by` is.",
        "",
        "Arguments:",
        "",
        "- `width`: in m, above zero.",
        "- `scale_by`: as it is.",
        "",
        "Errors:",
        "",
        "- `ValueError`: where it is not.",
    ]
