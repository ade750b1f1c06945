"""The parameters of the repository's plans have bounds, so that nothing absurd reaches a bench."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.model.errors import Refused
from hil.requirements.parameters import load_parameters

ROOT = Path(__file__).parents[3]
BOUNDED = (
    "imu_closure",
    "imu_lamp",
    "imu_noise",
    "imu_vacuum",
    "magnetometer_calibration",
    "photodiode",
    "solar_cells",
)
BELOW_ZERO = {"degC", "uT", "1", "1/K", "ohm/K"}


def of(plan):
    """Return the parameters of a plan."""
    return load_parameters(ROOT, ROOT / "testplans" / plan)


@pytest.mark.parametrize("plan", BOUNDED)
def test_every_number_has_bounds_and_lies_within_them(plan):
    """A list of a bias or a matrix has its length instead."""
    for each in of(plan).rows():
        allowed = each.allowed
        assert each.problem == ""
        listed = each.name.startswith(("bias_", "matrix_"))
        assert allowed.count if listed else None not in {allowed.minimum, allowed.maximum}, each.name
        if not listed and each.unit not in BELOW_ZERO:
            assert allowed.minimum >= 0.0, each.name


@pytest.mark.parametrize(
    ("plan", "name", "absurd"),
    [
        ("imu_closure", "rate", "0"),
        ("imu_closure", "duration", "1e12"),
        ("imu_closure", "gyroscope_bno_white", "0, 0, 0"),
        ("imu_lamp", "heating", "-1"),
        ("imu_lamp", "soak", "-5"),
        ("imu_noise", "gyroscope_bno_rate", "0"),
        ("imu_vacuum", "ramp", "0"),
        ("imu_vacuum", "plates", "43, -300"),
        ("magnetometer_calibration", "mountings", "1.5"),
        ("magnetometer_calibration", "coil_resistance", "7.5, 5.5"),
        ("magnetometer_calibration", "matrix_1", "1"),
        ("photodiode", "load", "0"),
        ("photodiode", "series", "-20"),
        ("solar_cells", "points", "40.5"),
        ("solar_cells", "irradiance", "-1"),
    ],
)
def test_what_is_absurd_is_refused(plan, name, absurd):
    """Before anything is opened; such values ended in errors of Python, in endless work, or were taken."""
    with pytest.raises(Refused, match=f"parameter '{name}' is .*, allowed is "):
        of(plan).override(name, absurd)
