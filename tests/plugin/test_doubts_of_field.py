"""What the fixture of the Helmholtz coils doubts in a recording on the turning table, and what it leaves to others."""

from __future__ import annotations

import importlib.util
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from workspaces import ROOT

SENSOR = SimpleNamespace(
    resolution=lambda: SimpleNamespace(value=0.0584), full_scale=lambda: SimpleNamespace(value=1600.0)
)


@pytest.fixture(scope="module")
def cage():
    """Load the fixture's module."""
    spec = importlib.util.spec_from_file_location("cage_of_fixtures", ROOT / "fixtures/cage.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def turned():
    """Return a recording of 6.5 s at 20 Hz on a table of 60 deg/s."""
    generator = np.random.default_rng(5)
    time = np.arange(130) / 20.0
    phase = np.radians(60.0 * time + np.array([[0.0], [90.0], [180.0]]))
    field = np.array([[21.0], [21.0], [0.0]]) * np.sin(phase) + 0.05 * generator.standard_normal((3, 130))
    channels = dict(zip("xyz", 0.0584 * np.rint(field / 0.0584), strict=True))
    return Recording(time, channels | {"temperature": np.full(130, 22.5)})


class Recording(dict):
    """Channels by name, with times [s]."""

    rate = 20.0

    def __init__(self, time, channels):
        super().__init__(channels)
        self.time = time


@pytest.mark.parametrize("late", [0.0, 0.03, 0.1, 0.19, 5.0])
def test_samples_that_were_held_up_leave_no_magnitude_open(cage, late):
    """The requirement on the recording judges rate and gaps."""
    recording = turned()
    recording.time[60:] += late
    assert cage.doubts_of(recording, SENSOR) == []


@pytest.mark.parametrize("axis", ["x", "z"])
def test_an_axis_that_stops_is_doubted(cage, axis):
    """One that turns, and one that points along the axis of the table."""
    recording = turned()
    recording[axis][70:] = recording[axis][69] + 0.0584
    (doubt,) = cage.doubts_of(recording, SENSOR)
    assert doubt.startswith(f"stuck of {axis}: 60 equal samples follow each other from number 71 on")


def test_times_that_run_backwards_are_doubted(cage):
    """Then nothing is where it says."""
    recording = turned()
    recording.time[60] = recording.time[59]
    assert [doubt.partition(":")[0] for doubt in cage.doubts_of(recording, SENSOR)] == ["order"]
