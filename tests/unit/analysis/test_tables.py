"""Tables as text."""

from __future__ import annotations

import math

import pytest

from hil.analysis.tables import Column, as_csv


def test_a_table_has_a_line_for_its_columns_and_one_for_each_row():
    """Units in brackets, numbers in their form, and what stands for one that is none."""
    columns = (Column("cycle"), Column("energy", "Wh", ".3f", missing=""), Column("ratio", "1", ".2f"), Column("why"))
    rows = [(1, 5.16, 0.98, "whole"), (2, math.nan, math.nan, "")]
    assert as_csv(columns, rows) == "cycle,energy [Wh],ratio,why\n1,5.160,0.98,whole\n2,,nan,\n"
    assert as_csv(columns[:1], []) == "cycle\n"


@pytest.mark.parametrize("text", ["a,b", 'a"b', "a\nb", "a\rb"])
def test_a_text_that_would_need_quotes_is_refused(text):
    """Whoever reads the table would see other columns."""
    with pytest.raises(ValueError, match="is not allowed in a table without quotes"):
        as_csv((Column("name"),), [(text,)])


def test_a_row_of_another_length_is_refused():
    """A value more or less is a mistake."""
    with pytest.raises(ValueError, match="zip"):
        as_csv((Column("a"), Column("b")), [(1,)])
