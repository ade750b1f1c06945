"""Sensors simulated from their tables of noise, and analysed as if they had been recorded: does the table come back?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from hil.analysis import (
    Column,
    NoiseLevels,
    SensorModel,
    as_csv,
    characterise,
    relative_deviation,
    simulate,
)
from hil.plan import Curve, Figure, FigureStatus

AXES = "xyz"
SENSORS = {
    "gyroscope.bno": ("BNO055 gyroscope", "rad/s"),
    "gyroscope.lsm": ("LSM9DS1 gyroscope", "rad/s"),
    "gyroscope.icm": ("ICM-20948 gyroscope", "rad/s"),
    "gyroscope.bmi": ("BMI088 gyroscope", "rad/s"),
    "magnetometer.bno": ("BNO055 magnetometer", "uT"),
    "magnetometer.lsm": ("LSM9DS1 magnetometer", "uT"),
    "magnetometer.lis": ("LIS3MDL magnetometer", "uT"),
}
"""What is simulated: name of the part and unit, by role and instance."""

SURE = 0.999
"""Confidence of the intervals that a level has to be in: some thirty of them are asked in one run."""

COLUMNS = (
    Column("axis"),
    Column("noise"),
    Column("unit"),
    Column("recorded", form=".6g"),
    Column("simulated", form=".4g", missing=""),
    Column("uncertainty", form=".2g", missing=""),
    Column("deviation", "1", form=".4f", missing=""),
    Column("bound", form=".4g", missing=""),
    Column("status"),
)


@dataclass(frozen=True, kw_only=True)
class Closed:
    """One level of an axis that went into a simulation, and what the analysis made of it.

    Attributes:
        axis: role, instance and axis.
        noise: `white_noise`, `flicker` or `random_walk`.
        recorded: the level that was simulated.
        simulated: the level that was found.
    """

    axis: str
    noise: str
    recorded: Figure
    simulated: Figure

    @property
    def shown(self):
        """Whether the record shows the level."""
        return self.simulated.status is FigureStatus.MEASURED

    @property
    def bounded(self):
        """Whether the record only shows that the level is below a bound."""
        return self.simulated.status is FigureStatus.UPPER_LIMIT

    @property
    def missed(self):
        """Whether the bound is wrong."""
        return self.bounded and self.simulated.value < self.recorded.value

    @property
    def outside(self):
        """Whether it is shown, and lies outside of its interval."""
        return self.shown and relative_deviation(self.recorded, self.simulated, confidence=SURE).significant

    @property
    def deviation(self):
        """By how much it deviates, (simulated - recorded) / recorded; a bound where the record does not show it."""
        if not self.bounded:
            return relative_deviation(self.recorded, self.simulated).relative
        relative = self.simulated.value / self.recorded.value - 1.0
        return Figure(value=relative, unit="1", status=FigureStatus.UPPER_LIMIT)

    def row(self):
        """Return its line of the table."""
        found = self.simulated
        known = (found.value, found.uncertainty, self.deviation.value) if self.shown else (math.nan,) * 3
        bound, status = (found.value, "not observable") if self.bounded else (math.nan, found.status.value)
        return (self.axis, self.noise, found.unit, self.recorded.value, *known, bound, status)


def levels_of(sensor, unit, place, parameters):
    """Return the levels of one axis and their units: white noise, flicker and random walk."""
    name = sensor.replace(".", "_")
    units = {"white": f"{unit}/sqrt(Hz)", "flicker": unit, "random_walk": f"{unit}*sqrt(Hz)"}
    return [(parameters.in_unit(f"{name}_{noise}", of)[place], of) for noise, of in units.items()]


def model_of(levels, parameters):
    """Return the sensor that is simulated, as its simulator takes the levels."""
    white, flicker, walk = (level for level, _ in levels)
    quiet = math.sqrt(parameters.sides / 2.0)
    noise = NoiseLevels(white=white * quiet, flicker=flicker, random_walk=walk)
    return SensorModel(levels=noise, rate=parameters.rate)


def expected(levels, tau):
    """Return the Allan deviation that levels give at averaging times."""
    white, flicker, walk = (level for level, _ in levels)
    floor = 2.0 * math.log(2.0) / math.pi * flicker**2
    return np.sqrt(white**2 / tau + floor + walk**2 * tau / 3.0)


def simulated(sensor, first, chart, parameters):
    """Simulate and analyse the axes of a sensor; return what came of each level."""
    title, unit = SENSORS[sensor]
    closed, curves = [], []
    for place, axis in enumerate(AXES):
        levels = levels_of(sensor, unit, place, parameters)
        model = model_of(levels, parameters)
        record = simulate(
            model, round(parameters.duration * parameters.rate), seed=round(parameters.seed) + first + place
        )
        found = characterise(record.values, parameters.rate, unit)
        tau = found.curve.tau
        curves.append(Curve(name=f"axis {axis}", x=tau, y=found.curve.deviation, model=(tau, expected(levels, tau))))
        closed += [
            Closed(
                axis=f"{sensor}.{axis}",
                noise=noise,
                recorded=Figure(value=level, unit=of, uncertainty=0.0),
                simulated=figure,
            )
            for noise, (level, of), figure in zip(
                ("white_noise", "flicker", "random_walk"),
                levels,
                (found.white, found.flicker, found.random_walk),
                strict=True,
            )
        ]
    chart(
        f"Simulated {title}",
        *curves,
        x=("averaging time", "s"),
        y=("Allan deviation", unit),
        log=True,
        lines="what the levels that were simulated predict",
    )
    return closed


def state(closed, check):
    """State of every level how it came back."""
    for each in closed:
        told = each.axis.replace(".", " ")
        if each.noise == "white_noise":
            headline = "White noise, simulated against recorded"
            check("IMU-SIM-010", "white_noise_closure", each.deviation, of=each.axis, at=told, headline=headline)
            continue
        requirement = "IMU-SIM-020" if each.noise == "flicker" else "IMU-SIM-030"
        word = each.simulated.status.value if not each.bounded else "not observable"
        check(requirement, f"{each.noise}_closure", each.deviation, of=each.axis, at=told)
        check(requirement, f"{each.noise}_shown", word, of=each.axis, at=told)


def judge(noise, closed, check, *, outside, count):
    """Judge the levels of one noise together: how many axes show theirs, and whether each is in its interval."""
    those = [each for each in closed if each.noise == noise]
    title = noise.replace("_", " ")
    wrong = [each.axis for each in those if each.outside]
    told = ", ".join(wrong) or "all axes"
    check(outside, f"{noise}_outside", len(wrong), at=told, headline=f"{title.capitalize()} outside of its interval")
    shown = sum(each.shown for each in those)
    check(count, f"{noise}_count", shown, at="all axes", headline=f"Axes that show {title}")


@pytest.mark.requirement("IMU-SIM-010", "IMU-SIM-020", "IMU-SIM-021", "IMU-SIM-030", "IMU-SIM-031", "IMU-SIM-040")
@pytest.mark.max_duration(900)
def test_closure(check, chart, step, artifact, parameters):
    """Every gyroscope and magnetometer axis simulated for four hours, and its levels found again."""
    closed = []
    for sensor, (title, _) in SENSORS.items():
        with step(f"Simulate and analyse the {title}"):
            found = simulated(sensor, len(closed) // len(AXES), chart, parameters)
            state(found, check)
            closed += found
    with step("Compare recorded with simulated levels"):
        artifact("closure.csv", as_csv(COLUMNS, [each.row() for each in closed]))
        judge("flicker", closed, check, outside="IMU-SIM-021", count="IMU-SIM-021")
        judge("random_walk", closed, check, outside="IMU-SIM-031", count="IMU-SIM-030")
        missed = [f"{each.axis} {each.noise}" for each in closed if each.missed]
        told = ", ".join(missed) or "all axes"
        check("IMU-SIM-040", "bounds_missed", len(missed), at=told, headline="Bounds below the level")
