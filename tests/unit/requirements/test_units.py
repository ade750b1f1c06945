from __future__ import annotations

import math

import pytest

from hil.requirements.units import UnitError, check_unit, compatible, convert, scale


@pytest.mark.parametrize(
    "unit",
    ["deg/s/sqrt(Hz)", "deg/s/√Hz", "deg/√(h)", "√Hz", "W.h", "W·h", "A.h", "mAh", "Wh", "uT", "µT", "LSB", "counts",
     "ohm", "kohm", "Ω", "k\N{OHM SIGN}", "mA", "degC", "°C", "K", "delta_degC", "1", "%", "ppm/K", "LSB/(deg/s)",
     "V^(1/2)", "m*s**-2", "m^-1", "s⁻¹", "V/Hz**0.5", "(m/s)**2", "sqrt(Hz)", "deg / s", "kg.m²/s",
     "deg/s/degC", "nT/√Hz", "m/s²", "m/s2",
     "deg/s2", "V^2", "V**2", "1/s", "min", "d", "ms", "dps", "rpm", "lx", "g0"],
)  # fmt: skip
def test_units_parse_as_people_write_them(unit):
    """The notation of data sheets and requirements is understood."""
    assert check_unit(unit) is None


def test_seconds_squared_are_written_as_on_a_keyboard():
    """As accelerations are written on drawings and in bench files; no other unit has a number in its name."""
    assert convert(2.0, "m/s2", "m/s²") == convert(2.0, "m/s2", "m/s^2") == 2.0
    assert convert(1.0, "g0", "m/s2") == pytest.approx(9.80665)
    assert all(isinstance(check_unit(unit), str) for unit in ("m/s3", "m/A2", "s2", "m/s2.5", "m2"))


@pytest.mark.parametrize("unit", ["", " ", "furlong", "V/", "()", "3 V", "2", "V**", "a" * 100, "__import__", "V;A"])
def test_what_is_no_unit_is_said_so(unit):
    """The answer is a sentence, whatever the text."""
    assert isinstance(check_unit(unit), str)


@pytest.mark.parametrize(
    "unit",
    ["9**9**9**9*V", "V**1e9", "V**9**9", "V**99", "V**(9**9)", "V^2²", "V²²", "V**-12", "V**(1/0)", "1**9", "V" * 101,
     "V*" * 50_000 + "V", "((((V))))", "(" * 50, "V**1.5e3", "V**0x9", "1e999999999*V", "V" * 5_000_000],
)  # fmt: skip
def test_arithmetic_is_no_unit(unit):
    """What would be computed for a long time, or for ever, is refused before it is."""
    assert "is not a unit" in check_unit(unit)


def test_sizes_too_far_apart_are_said_so():
    """A factor that no number can hold is a sentence."""
    with pytest.raises(UnitError, match="too far apart"):
        convert(1.0, "*".join(["Gm**9"] * 14), "*".join(["nm**9"] * 14))


@pytest.mark.parametrize(
    ("value", "from_unit", "to_unit", "expected"),
    [
        (180.0, "deg", "rad", math.pi),
        (1.0, "turn", "deg", 360.0),
        (1.0, "rpm", "deg/s", 6.0),
        (1.0, "W.h", "J", 3600.0),
        (2600.0, "mAh", "A.h", 2.6),
        (50.0, "%", "1", 0.5),
        (1.0, "deg/s/sqrt(Hz)", "deg/√h", 60.0),
        (3.0, "LSB/degC", "LSB/K", 3.0),
        (2.0, "delta_degC", "K", 2.0),
        (0.5, "G", "uT", 50.0),
        (25.0, "degC", "°C", 25.0),
        (1500.0, "mV", "V", 1.5),
    ],
)
def test_conversions_are_right(value, from_unit, to_unit, expected):
    """Factors agree with the definition of the units."""
    assert convert(value, from_unit, to_unit) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(
    ("one", "other"),
    [("mAh", "Wh"), ("degC", "K"), ("degC", "delta_degC"), ("deg", "LSB"), ("deg", "1"), ("deg/s", "Hz"), ("LSB", "1"),
     ("rad/s", "1/s"), ("V", "A"), ("deg/s", "deg/s/sqrt(Hz)"), ("cycle", "1"), ("K", "1")],
)  # fmt: skip
def test_what_is_not_the_same_kind_does_not_convert(one, other):
    """The error names both units, in both directions, and says how they differ."""
    assert not compatible(one, other)
    with pytest.raises(UnitError, match=r"'.+' does not convert to '.+'; .+") as error:
        convert(1.0, one, other)
    assert f"'{one}'" in str(error.value)
    assert f"'{other}'" in str(error.value)
    with pytest.raises(UnitError):
        convert(1.0, other, one)


def test_what_does_not_convert_is_named_as_people_name_it():
    """Not by the dimensions of a library."""
    with pytest.raises(UnitError) as error:
        convert(1.0, "V", "ohm")
    assert str(error.value) == "'V' does not convert to 'ohm'; V is a unit of voltage, ohm of resistance"
    with pytest.raises(UnitError, match="they are units of different quantities"):
        convert(1.0, "V", "deg/s/sqrt(Hz)")


def test_uncertainties_of_temperatures_have_no_offset():
    """The uncertainty of 25 degC +- 0.1 is 0.1 K."""
    assert scale("degC", "degC") == 1.0
    assert scale("degC", "K") == 1.0
    with pytest.raises(UnitError, match="'degC' does not convert to 'V'"):
        scale("degC", "V")


def test_a_unit_that_nobody_knows_is_an_error_in_conversions_too():
    """Also where both sides are the same text."""
    with pytest.raises(UnitError, match="'furlong' is not a known unit"):
        convert(1.0, "furlong", "furlong")
