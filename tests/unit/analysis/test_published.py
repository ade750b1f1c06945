"""Published tables: what a printed number stands for, what a formula gives, and why a cell does not follow."""

from __future__ import annotations

import random
import re

import pytest

from hil.analysis.published.check import CellVerdict, check
from hil.analysis.published.formula import FormulaError, Missing, parse
from hil.analysis.published.printed import EXACT, NotANumber, PrintedTable, as_printed
from hil.analysis.published.ranges import Undefined

PLACE = ("x", "v")


def table(name, **cells):
    """Return a table of one column, v, from what its rows print."""
    printed = {(row, "v"): as_printed(text) for row, text in cells.items() if text}
    return PrintedTable(name=name, rows=tuple(cells), columns=("v",), cells=printed)


def over(text, **tables):
    """Return what a formula gives at row x."""
    sources = {name: table(name, x=printed) for name, printed in tables.items()}
    formula = parse(text, sources)
    return formula.over(PLACE, sources, formula.sources(PLACE, sources))


def judged(published, formula="100*(b-a)/a", others=(), **tables):
    """Return what is said of each row of a published table."""
    sources = {name: table(name, **cells) for name, cells in tables.items()}
    one = parse(formula, sources)
    whole = table("published", **published)
    return check(whole, {key: one for key, _ in whole.filled()}, sources, others)


@pytest.mark.parametrize(
    ("text", "value", "half"),
    [
        ("0.1234", 0.1234, 5e-5),
        ("-25.2 %", -25.2, 0.05),
        ("12.289e5", 1228900.0, 50.0),
        ("12.289·10^5", 1228900.0, 50.0),
        ("7.5660 x 10^-5", 7.566e-5, 5e-10),
        ("240616", 240616.0, 0.5),
        ("\u22120.50", -0.5, 0.005),
        ("2:47:58", 10078.0, 0.5),
    ],
)
def test_a_printed_number_stands_for_what_rounds_to_it(text, value, half):
    """The last digit that stands there tells how far."""
    found = as_printed(text)
    assert (found.value, found.half) == pytest.approx((value, half), rel=1e-12)


def test_digits_may_be_said():
    """Zeros at the end that were left out, and counts that nobody rounded."""
    assert as_printed("0.5924", 5).half == pytest.approx(5e-6)
    assert as_printed("211", EXACT).half == 0.0
    assert as_printed("0.39480", 3).half == pytest.approx(5e-6)


@pytest.mark.parametrize("text", ["", "abc", "1.2.3", "1,234", "nan", "1e9999", "0x10", "1 2", "2:75:00", "1" * 50])
def test_what_is_no_number_is_refused(text):
    """Nothing is guessed."""
    with pytest.raises(NotANumber):
        as_printed(text)


@pytest.mark.parametrize(
    "text",
    [
        "100*(b-a)/a", "2*(b-a)/(a+b)", "sqrt(abs(a))*log(b)", "exp(a)-b**3", "(a-b)**2", "min(a, b)/max(a, b)",
        "a**0.5 + log10(b)/pi", "b**-2 - -a", "abs(a-b)", "(a-0.123)**4",
    ],
)  # fmt: skip
def test_a_range_contains_every_value(text):
    """Whatever the sources were before they were rounded; and it is not much wider than needed."""
    draw = random.Random(text)
    for one, other in (("0.123", "0.125"), ("0.12", "7.5"), ("0.1230", "0.1230")):
        found = over(text, a=one, b=other)
        sources = {name: table(name, x=printed) for name, printed in (("a", one), ("b", other))}
        formula = parse(text, sources)
        cells = formula.sources(PLACE, sources)
        values = [
            formula.at(PLACE, sources, {key: draw.choice([each.low, each.high, draw.uniform(each.low, each.high)])
                                        for key, each in cells.items()})
            for _ in range(40)
        ]  # fmt: skip
        slack = 1e-12 * max(map(abs, values))
        assert found.low - slack <= min(values)
        assert max(values) <= found.high + slack
        assert found.high - found.low <= 2.5 * (max(values) - min(values)) + slack


def test_columns_can_be_summed():
    """A whole column, a part of it, and another cell."""
    tables = {"a": table("a", x="1.0", y="2.0", z="4.0")}
    for text, middle in (
        ('sum(a["v", :])', 7.0), ('mean(a["v", "y":])', 3.0), ('a["v", "z"] / a', 4.0), ('count(a["v", :"y"])', 2.0),
        ('max(a["v", :]) - min(a[:, "y"], 9)', 2.0),
    ):  # fmt: skip
        formula = parse(text, tables)
        found = formula.over(PLACE, tables, formula.sources(PLACE, tables))
        assert (found.low + found.high) / 2 == pytest.approx(middle, abs=0.02)


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("__import__('os')", 1, "unknown function '__import__'"),
        ("a.real", 1, "numbers, tables"),
        ("[a for a in b]", 1, "numbers, tables"),
        ("1 if a else b", 1, "numbers, tables"),
        ("lambda: a", 1, "numbers, tables"),
        ("a(b)", 1, "unknown function 'a'"),
        ("a + c", 5, "unknown name 'c'"),
        ("a^2", 1, r"\*\*"),
        ("(a", 1, "no formula"),
        ("a['w']", 3, "a has no column 'w'"),
        ("a['v', 'q']", 8, "a has no row 'q'"),
        ("a[b]", 3, "in quotes"),
        ("2 * a['v', :]", 5, "whole column"),
        ("sqrt(a, b)", 1, "one number"),
        ("'text'", 1, "a number or a table"),
        ("1e400", 1, "too large"),
        ("9" * 600, 1, "500 characters"),
        ("(" * 300, 1, "no formula"),
        ("", 1, "no formula"),
    ],
)
def test_what_is_no_formula_is_refused(text, column, message):
    """Nothing but arithmetic gets through, and the error says where."""
    sources = {name: table(name, x="1.0") for name in "ab"}
    with pytest.raises(FormulaError, match=message) as caught:
        parse(text, sources)
    assert caught.value.column == column or "no formula" in message


def test_what_has_no_value_is_unknown():
    """A divisor that may be zero, a root below zero, a blank cell: never a cell that follows."""
    for text in ("1/a", "log(a)", "sqrt(a-1)", "exp(a*1e6+1e6)"):
        with pytest.raises(Undefined):
            over(text, a="0.0", b="1.0")
    for text in ("a/b", "a*a*a", "a**-3", "100*(b-a)/a"):
        with pytest.raises(Undefined):
            over(text, a="1e300", b="1e-300")
    (found,) = judged({"x": "1.0"}, a={"x": "0.0"}, b={"x": "1.0"})
    assert (found.verdict, found.reason) == (CellVerdict.UNKNOWN, "the divisor may be zero")
    (found,) = judged({"x": "1.0"}, a={"x": "2.0"}, b={"x": ""})
    assert (found.verdict, found.low) == (CellVerdict.UNKNOWN, None)
    assert "no number in row x" in found.reason
    with pytest.raises(Missing):
        parse("a", {"a": table("a", y="1")}).sources(PLACE, {"a": table("a", y="1")})


def test_a_cell_follows_exactly_as_far_as_rounding_allows():
    """1.25 and 2.50 as printed allow 98.80 to 101.21 %: what rounds to that follows, what lies beyond does not."""
    for printed, follows in (("98.8", True), ("101.2", True), ("101.3", False), ("98.7", False), ("1e2", True)):
        (found,) = judged({"x": printed}, a={"x": "1.25"}, b={"x": "2.50"})
        assert (found.verdict is CellVerdict.FOLLOWS) is follows, printed
        assert (found.low, found.high) == pytest.approx((98.8048, 101.2048), abs=1e-4)


A, B = {"x": "1.2345", "y": "4.0123"}, {"x": "2.3456", "y": "3.2109"}


@pytest.mark.parametrize(
    ("printed", "cause"),
    [
        ("-90.004", "the sign is reversed"),
        ("0.90004", "1/100 times"),
        ("5156.9", "it is 180/pi times"),
        ("90.077", "it would follow if b had 2.3465, not 2.3456"),
        ("1800.0", "it would follow if b had 10 times what is printed"),
        ("-19.974", "it is what row y, column v should be"),
        ("62.070", r"another formula, 200\*\(b-a\)/\(a\+b\)"),
        ("47.369", r"another formula, 100\*\(b-a\)/b"),
        ("-290.00", "b had the sign reversed"),
        ("90.814", "it would follow if b had 2.3556, not 2.3456"),
        ("4.4444", "the same number is printed in other, row q, column v"),
        ("17.777", "no usual slip: b would have to be 1.454"),
    ],
)
def test_a_slip_is_found(printed, cause):
    """Each kind of slip, made on purpose, is among what is told."""
    found = judged({"x": printed, "y": "-19.974"}, others=(table("other", q="4.4444"),), a=A, b=B)[0]
    assert found.verdict is CellVerdict.DOES_NOT_FOLLOW
    assert any(re.search(cause, each) for each in found.causes), found.causes


def test_a_rough_number_meets_nothing_by_chance():
    """Two digits are near one of many factors: only powers of ten are told."""
    (found,) = judged({"x": "55"}, a={"x": "1.2345"}, b={"x": "2.4"})
    assert not any("times" in each for each in found.causes)
    (found,) = judged({"x": "70"}, formula="a", a={"x": "7.07"})
    assert found.causes == ("it is about 10 times the recomputed value",)
