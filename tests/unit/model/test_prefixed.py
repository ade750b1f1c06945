"""Readings as a person says them."""

from __future__ import annotations

import math

import pytest

from hil.model.prefixed import prefixed


@pytest.mark.parametrize(
    ("value", "unit", "said"),
    [
        (7.4596e-06, "A", "7.46 uA"),
        (-0.1993, "V", "-0.1993 V"),
        (3.29987, "V", "3.3 V"),
        (0.99999, "V", "1 V"),
        (999.96, "ohm", "1000 ohm"),
        (-0.00099999, "A", "-1 mA"),
        (0.0003984, "A", "398.4 uA"),
        (0.002003, "A", "0.002003 A"),
        (0.0, "V", "0 V"),
        (-0.0, "A", "0 A"),
        (1e-14, "A", "1e-05 nA"),
        (123456.0, "ohm", "123.5 kohm"),
        (25.123456, "degC", "25.12 degC"),
        (0.0123456, "deg/s", "0.01235 deg/s"),
        (12.3456, "uT", "12.35 uT"),
        (math.nan, "V", "nan V"),
        (0.5, "", "0.5"),
    ],
)
def test_four_digits_and_a_prefix(value, unit, said):
    """Plain electrical units are scaled; those with a prefix and all others keep theirs."""
    assert prefixed(value, unit) == said
