import re
from decimal import Decimal

from hypothesis import given
from hypothesis import strategies as st

from hil.report.numbers import measured, number, rounded

values = st.floats(min_value=-1e12, max_value=1e12, allow_subnormal=False)
spreads = st.floats(min_value=1e-9, max_value=1e9)


def digits_of(text):
    """Return the significant digits of a decimal number."""
    return text.lstrip("-0.").replace(".", "")


@given(values, spreads)
def test_value_ends_where_its_uncertainty_ends(value, spread):
    """Both have the same number of decimals, and the uncertainty two significant digits."""
    shown, expanded, _ = rounded(value, spread)
    assert len(shown.partition(".")[2]) == len(expanded.partition(".")[2])
    assert len(digits_of(expanded)) == 2


@given(values, spreads)
def test_rounding_loses_less_than_half_of_the_last_digit(value, spread):
    """What is written differs from what was measured by half a step at most, and U by 5 percent at most."""
    shown, expanded, exponent = rounded(value, spread)
    scale = Decimal(10) ** exponent
    step = Decimal(1).scaleb(-len(expanded.partition(".")[2])) * scale
    assert abs(Decimal(shown) * scale - Decimal(repr(value))) <= step / 2
    assert abs(Decimal(expanded) * scale / Decimal(repr(spread)) - 1) <= Decimal("0.0500001")


@given(values, spreads)
def test_powers_of_ten_are_those_of_prefixes(value, spread):
    """A power of ten is a multiple of three, and minus zero is never written."""
    shown, _, exponent = rounded(value, spread)
    assert exponent % 3 == 0
    assert not re.fullmatch(r"-0(\.0*)?", shown)


@given(st.floats())
def test_no_number_shows_a_floats_noise(value):
    """Any number is six significant digits at most, or a whole number below a thousand million."""
    shown = number(value)
    if shown == "not a number":
        assert not abs(value) < float("inf")
        return
    digits = digits_of(shown.partition(" ")[0])
    assert len(digits.rstrip("0")) <= 6 or (value == int(value) and abs(value) < 1e9)


@given(st.floats() | st.integers() | st.none(), st.floats() | st.none(), st.sampled_from(["V", "1", "deg/s"]))
def test_anything_can_be_shown(value, expanded, unit):
    """Whatever a journal holds as value and uncertainty, it can be written in one short line."""
    shown = measured(value, expanded, unit)
    assert shown
    assert "\n" not in shown
    assert "e+" not in shown
    assert "nan" not in shown
