"""Drift under a heat lamp: two runs with the first units of every sensor, and a third with the second units."""

from __future__ import annotations

import pytest

from hil.analysis import drift_of, rank, relative_deviation
from hil.plan import Curve, Figure, Implausible

AXES = "xyz"
GYROSCOPES = ("bno", "lsm", "icm", "bmi")
MAGNETOMETERS = ("bno", "lsm", "icm", "lis")
NAMES = (*(f"gyroscope.{each}" for each in GYROSCOPES), *(f"magnetometer.{each}" for each in MAGNETOMETERS))
RUNS = {"first": "", "second": "", "third": "2"}
"""What is added to the name of a sensor for the unit of each run."""

DRIFT = {
    "gyroscope.bno": "021",
    "gyroscope.icm": "022",
    "gyroscope.bmi": "023",
    "magnetometer.bno": "024",
    "gyroscope.lsm": "025",
}
OFFSET = {"gyroscope.bno": "031", "gyroscope.lsm": "032", "gyroscope.icm": "033", "gyroscope.bmi": "034"}
"""Requirements by the sensor; of all other magnetometers it is 026 and 035."""

HEADLINES = {
    ("Gyroscope", "drift"): "Drift of gyroscopes",
    ("Magnetometer", "drift"): "Drift of magnetometers",
    ("Gyroscope", "offset"): "Offset of gyroscopes at rest",
    ("Gyroscope", "hysteresis"): "Hysteresis of gyroscopes",
    ("Magnetometer", "hysteresis"): "Hysteresis of magnetometers",
    ("", "drift_repeat"): "Second run against first, relative",
    ("", "drift_unit_deviation"): "Second units against first, relative",
}
"""What stands on the first page of the report, by role and parameter."""

REFERENCE = "thermometer.reference"
_POLL_S = 10.0


class Runs:
    """Runs under the lamp."""

    def __init__(self, chamber, relays, thermometer, clock, sensor_set, step, parameters):
        self._chamber, self._relays, self._clock = chamber, relays, clock
        self._reference = thermometer.reference
        self._sensor_set, self._step, self._parameters = sensor_set, step, parameters

    def run(self, unit):
        """Heat and cool the sensors of one unit, and return what was recorded beside that."""
        parameters = self._parameters
        with self._step("Let the boards come to the temperature of the plate"):
            self._reference.start()
            self._chamber.hold(parameters.start_temperature)
            self._chamber.soak(parameters.soak, within=parameters.longest_soak, own=self._own)
        streams = {f"gyroscope.icm{unit}": parameters.icm_rate, f"gyroscope.bmi{unit}": parameters.bmi_rate}
        names = [f"{name}{unit}" for name in NAMES]
        with self._sensor_set(f"lamp{unit}", names, parameters.rate, streams) as beside:
            with self._step("Heat with the lamp"):
                self._relays.close("lamp")
                self._wait(parameters.heating, beside)
            with self._step("Let the boards cool"):
                self._relays.open("lamp")
                self._wait(parameters.cooling, beside)
        return beside

    def _own(self):
        return self._reference.temperature().value

    def _wait(self, seconds, beside):
        """Wait, and look that nothing becomes too hot."""
        while seconds > 0.0:
            self._clock.sleep(min(seconds, _POLL_S))
            seconds -= _POLL_S
            warmth = beside.reference()
            if warmth > self._parameters.hottest:
                self._relays.open("lamp")
                told = f"the reference reads {warmth:.1f} degC, and {self._parameters.hottest:g} degC are allowed"
                raise Implausible(REFERENCE, told, "hang the lamp higher, and look at its relay")


def judged(series, found, axis, run, check):
    """Check drift, offset and hysteresis of one axis."""
    sensor, of = series.name.removesuffix("2"), f"{series.name}.{axis}"
    told, role = f"{of}, {run} run", sensor.partition(".")[0].capitalize()
    doubts = list(series.doubts)
    for parameter, figure, requirement in (
        ("drift", "slope", DRIFT.get(sensor, "026")),
        ("offset", "offset", OFFSET.get(sensor, "035")),
        ("hysteresis", "hysteresis", "040" if sensor.startswith("gyroscope") else "041"),
    ):
        headline = HEADLINES.get((role, parameter), "")
        value = getattr(found, figure)
        why = [*doubts, *found.why(figure)]
        check(f"IMU-LMP-{requirement}", parameter, value, of=of, doubts=why, at=told, headline=headline)


def draw(series, drifts, chart):
    """Draw the axes of one sensor over temperature, without their means, heating and cooling apart."""
    curves = []
    for axis, found in drifts.items():
        warmer = found.temperature - found.temperature.mean() if len(found.time) else found.temperature
        line, change = found.slope.value * warmer, found.value - found.value.mean() if len(found.time) else found.value
        for name, leg in (("heating", found.heating > 0), ("cooling", found.heating < 0)):
            if leg.any():
                model = (found.temperature[leg], line[leg]) if name == "heating" else None
                residual = (change - line)[leg]
                across, upward = found.temperature[leg], change[leg]
                curves.append(Curve(name=f"{axis} {name}", x=across, y=upward, model=model, residual=residual))
    if curves:
        chart(f"{series.name} over temperature", *curves, x=("temperature", "degC"), y=("change", series.unit))


def ranked(drifts, role, artifact):
    """Write down the order of the magnitudes of the first run's drifts, of one role and so in one unit."""
    figures = {
        f"{name}.{axis}": abs_of(found.slope)
        for name, axes in drifts.items()
        if name.startswith(f"{role}.")
        for axis, found in axes.items()
    }
    ranking = rank(figures)
    rows = [(place.name, place.said, place.figure.value, place.figure.uncertainty) for place in ranking.places]
    rows += [(name, "", "", reason) for name, reason in ranking.unranked.items()]
    lines = ["sensor and axis,rank,drift,uncertainty or why it has no rank", *(",".join(map(str, row)) for row in rows)]
    artifact(f"drift-ranking-{role}.csv", "\n".join(lines) + "\n")


def abs_of(figure):
    """Return a figure's magnitude."""
    return figure if not figure.value < 0.0 else figure * -1.0


@pytest.mark.requirement(
    *(f"IMU-LMP-{number}" for number in ("010", "011", "021", "022", "023", "024", "025", "026")),
    *(f"IMU-LMP-{number}" for number in ("031", "032", "033", "034", "035", "040", "041", "050", "051")),
)
@pytest.mark.max_duration(16000)
@pytest.mark.repeatable("heating and cooling can be done again, and reading a sensor does not change it")
def test_lamp(chamber, relays, thermometer, clock, sensor_set, check, chart, step, artifact, parameters):
    """Drift, offset and hysteresis of every axis, and how well they repeat, in a second run and with second units."""
    runs = Runs(chamber, relays, thermometer, clock, sensor_set, step, parameters)
    drifts = {}
    for run, unit in RUNS.items():
        with step(f"The {run} run"):
            beside = runs.run(unit)
            _, warmth = beside.warmth
            check("IMU-LMP-011", "coldest", Figure(value=warmth.min(), unit="degC"), of=run)
            check("IMU-LMP-011", "hottest", Figure(value=warmth.max(), unit="degC"), of=run)
            drifts[run] = {}
            for series in beside.series:
                found = {
                    axis: drift_of(
                        series.time, series.temperature, samples, series.unit, reference=parameters.start_temperature
                    )
                    for axis, samples in series.axes.items()
                }
                drifts[run][series.name] = found
                for axis, each in found.items():
                    judged(series, each, axis, run, check)
                if run == "first":
                    draw(series, found, chart)
    with step("Compare the runs"):
        for name in NAMES:
            for axis in AXES:
                first = drifts["first"][name][axis].slope
                again, other = drifts["second"][name][axis].slope, drifts["third"][f"{name}2"][axis].slope
                for number, parameter, second, of in (
                    ("050", "drift_repeat", again, f"{name}.{axis}"),
                    ("051", "drift_unit_deviation", other, f"{name}2.{axis}"),
                ):
                    deviation = relative_deviation(first, second)
                    told, headline = f"{of}: {deviation.remark}", HEADLINES["", parameter]
                    check(f"IMU-LMP-{number}", parameter, deviation.relative, of=of, at=told, headline=headline)
        for role in ("gyroscope", "magnetometer"):
            ranked(drifts["first"], role, artifact)
