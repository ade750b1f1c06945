import math

import pytest

from hil.report.numbers import bench_time, duration, limit_text, measured, number, prefixed, quantity, span
from hil.requirements.units import scale


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.1 + 0.2, "0.3"),
        (3.0, "3"),
        (-0.0, "0"),
        (12345678, "12345678"),
        (123456.78, "123457"),
        (0.00042, "420 × 10⁻⁶"),  # noqa: RUF001 - the sign of multiplication
        (1.5e12, "1.5 × 10¹²"),  # noqa: RUF001 - the sign of multiplication
        (math.nan, "not a number"),
        (math.inf, "not a number"),
        (None, "not a number"),
        (True, "true"),
        ("left", "left"),
    ],
)
def test_number(value, shown):
    """A number has no more digits than it means, a word is left as it is, and NaN is said in words."""
    assert number(value) == shown


@pytest.mark.parametrize(
    ("value", "expanded", "unit", "shown"),
    [
        (0.31234, 0.0449, "deg/s", "(0.312 ± 0.045) deg/s"),
        (9.99, 0.0996, "V", "(9.99 ± 0.10) V"),
        (-0.0001, 0.5, "V", "(0.00 ± 0.50) V"),
        (12345.0, 1200.0, "V", "(12.3 ± 1.2) kV"),
        (1.234e-5, 5.6e-7, "A", "(12.34 ± 0.56) µA"),
        (1.234e-5, 5.6e-7, "mV/s", "(12.34 ± 0.56) nV/s"),
        (1.234e-5, 5.6e-7, "deg/s", "(12.34 ± 0.56) × 10⁻⁶ deg/s"),  # noqa: RUF001 - the sign of multiplication
        (1.234e-5, 5.6e-7, "1", "(12.34 ± 0.56) × 10⁻⁶"),  # noqa: RUF001 - the sign of multiplication
        (0.000259, None, "s", "259 µs"),
        (0.000259, 0.0, "s", "259 µs"),
        (3.0, 0.1, "1", "3.00 ± 0.10"),
        (3.25, None, "V", "3.25 V"),
        (3.25, 0.0, "V", "3.25 V"),
        (math.nan, 0.1, "V", "not a number"),
        (None, 0.1, "V", "not a number"),
        ("left", None, "", "left"),
    ],
)
def test_measured(value, expanded, unit, shown):
    """The uncertainty has two significant digits and the value ends where it ends (GUM 7.2.6)."""
    assert measured(value, expanded, unit) == shown


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (0.000259, "s", "259 µs"),
        (0.00259, "s", "0.00259 s"),
        (1.25e7 + 0.5, "s", "12.5 × 10⁶ s"),  # noqa: RUF001 - the sign of multiplication
        (1.25e7 + 0.5, "Hz", "12.5 MHz"),
        (2.5e-4, "uT", "250 pT"),
        (2.5e-4, "mA.h", "250 nA.h"),
        (2.5e6 + 0.5, "mV", "2.5 kV"),
        (2.5e-7, "ohm", "250 nohm"),
        (2.5e-7, "V/sqrt(Hz)", "250 nV/sqrt(Hz)"),
        (2.5e-7, "N.m", "250 nN.m"),
        (2.5e-7, "K/min", "250 nK/min"),
        (2.5e-7, "m/s^2", "250 nm/s^2"),
        (2.5e-17, "A", "25 × 10⁻¹⁸ A"),  # noqa: RUF001 - the sign of multiplication
        *((2.5e-7, unit, f"250 × 10⁻⁹ {unit}") for unit in (  # noqa: RUF001 - the sign of multiplication
            "degC", "deg/s", "m^2", "m**2", "m²", "1/s", "min", "h", "LSB", "ppm", "dps", "sqrt(Hz)", "rpm", "cm", "%",
            "(V)/A", "cycle", "byte", "us^-1", "g0",
        )),
        (2.5e-7, "1", "250 × 10⁻⁹"),  # noqa: RUF001 - the sign of multiplication
        (2.5e-7, "", "250 × 10⁻⁹"),  # noqa: RUF001 - the sign of multiplication
        (math.nan, "V", "not a number"),
        (None, "V", "not a number"),
        (True, "", "true"),
    ],
)  # fmt: skip
def test_quantity(value, unit, shown):
    """A unit that takes a prefix has it instead of a power of ten; any other keeps the power."""
    assert quantity(value, unit) == shown


@pytest.mark.parametrize(
    ("low", "high", "unit", "shown"),
    [
        (1.0, 2.5, "V", "1 to 2.5 V"),
        (1.0, 1.00001, "V", "1 V"),
        (1.2e-4, 2.5e-4, "s", "120 to 250 µs"),
        (0.0, 2.5e-4, "s", "0 to 250 µs"),
        (-2.5e-4, 0.0, "deg", "(-250 to 0) × 10⁻⁶ deg"),  # noqa: RUF001 - the sign of multiplication
        (1.2e-5, 2.5, "s", "12 µs to 2.5 s"),
        (math.nan, 2.5, "s", "not a number to 2.5 s"),
    ],
)
def test_span(low, high, unit, shown):
    """Two ends of one size share their unit, and ends of two sizes have one each."""
    assert span(low, high, unit, 4) == shown


@pytest.mark.parametrize("power", range(-15, 13, 3))
@pytest.mark.parametrize("unit", ["V", "mA", "uT", "kPa", "s", "MHz"])
def test_a_prefix_means_its_power(unit, power):
    """What is left of the power, and the unit with its prefix, are the quantity that they were."""
    left, known = prefixed(unit, power)
    assert known == unit if left else scale(known.replace("µ", "u"), unit) == pytest.approx(10.0**power)


@pytest.mark.parametrize(
    ("limit", "shown"),
    [
        ({"min": "-0.5", "max": "0.50"}, "-0.5 to 0.50 V"),
        ({"min": "1.10"}, "≥ 1.10 V"),
        ({"max": "2"}, "≤ 2 V"),
        ({"equals": "left"}, "= left V"),
        ({"min": None, "max": None, "equals": None}, ""),
        (None, ""),
    ],
)
def test_limit_text(limit, shown):
    """A limit is written with the digits that the catalogue gave it."""
    assert limit_text(limit, "V") == shown


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [
        (0, "0 s"),
        (0.25, "0.25 s"),
        (0.000259, "259 µs"),
        (59.99, "60 s"),
        (75, "1 min 15 s"),
        (3599.9, "1 h"),
        (14459, "4 h 01 min"),
        (844 * 3600, "844 h"),
        (None, ""),
    ],
)
def test_duration(seconds, shown):
    """Seconds become what a person says, up to months of battery cycling."""
    assert duration(seconds) == shown


def test_bench_time():
    """An instant of the bench's clock is hours, minutes, seconds and tenths; rounding carries over."""
    assert bench_time(0.0) == "0:00:00.0"
    assert bench_time(59.96) == "0:01:00.0"
    assert bench_time(844 * 3600 + 61.25) == "844:01:01.2"
    assert bench_time(None) == ""
