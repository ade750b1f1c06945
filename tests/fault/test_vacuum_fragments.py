"""Fragments of the vacuum plan that are too poor for a statement: none of them tells a drift."""

from __future__ import annotations

import csv
import importlib.util
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hil.model.figure import FigureStatus

PLAN = Path(__file__).parents[2] / "testplans" / "imu_vacuum" / "test_vacuum.py"


def plan_module():
    """Return the plan's module."""
    spec = importlib.util.spec_from_file_location("vacuum_plan", PLAN)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


MODULE = plan_module()


def series(time, temperature):
    """Return what a gyroscope recorded at these times: half a count of noise, and a strong drift."""
    axes = {axis: 0.1 * temperature + np.random.default_rng(3).normal(size=time.size) for axis in "xyz"}
    return SimpleNamespace(
        name="gyroscope.bno", unit="deg/s", rate=1.0, time=time, temperature=temperature, axes=axes, doubts=()
    )


def judged(found):
    """Return what the plan checks of fragments, by parameter and axis of the gyroscope."""
    checked = {}

    def check(requirement, parameter, figure, *, of, **_):
        if of.startswith("gyroscope"):
            checked.setdefault((requirement, parameter, of), []).append(figure)

    MODULE.judge(found, check)
    return checked


@pytest.mark.parametrize("count", [1, 31])
def test_a_fragment_of_a_few_samples_tells_nothing(count):
    """Not alone: every axis is not observable; and not beside a long one, which alone tells its drift."""
    time = np.arange(600.0)
    short = [*MODULE.fragments_of("log", series(time[:count], np.linspace(20.0, 40.0, count)), 25.0)]
    assert [each.samples for each in short] == [count]
    (row, *_) = csv.DictReader(MODULE.table(short).splitlines())
    assert row["drift per K"] == row["drift per h"] == ""
    assert "are too few" in row["why nothing is said"]
    alone = judged(short)
    assert {figure.status for figures in alone.values() for figure in figures} == {FigureStatus.NOT_OBSERVABLE}
    broken = np.concatenate([time[:300], time[350 : 350 + count]])
    both = [*MODULE.fragments_of("log", series(broken, 20.0 + broken / 15.0), 25.0)]
    assert [each.samples for each in both] == [300, count]
    drifts = judged(both)["IMU-TVC-020", "drift", "gyroscope.bno.x"]
    assert [figure.status for figure in drifts] == [FigureStatus.MEASURED]
