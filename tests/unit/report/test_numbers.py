import math

import pytest

from hil.report.numbers import bench_time, duration, limit_text, measured, number


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
        (12345.0, 1200.0, "V", "(12.3 ± 1.2) × 10³ V"),  # noqa: RUF001 - the sign of multiplication
        (1.234e-5, 5.6e-7, "A", "(12.34 ± 0.56) × 10⁻⁶ A"),  # noqa: RUF001 - the sign of multiplication
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
