"""Drift under a heat lamp: two runs with the first units of every sensor, and a third with the second units."""

from __future__ import annotations

import pytest

from hil.analysis import drift_change, drift_of, normalised_error, rank, relative_deviation
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
    ("", "drift_repeat"): "Change to the second run, over its uncertainty",
    ("Gyroscope", "drift_unit_difference"): "Second units minus first, gyroscopes",
    ("Magnetometer", "drift_unit_difference"): "Second units minus first, magnetometers",
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
        if not len(found.time):
            continue
        mean = found.value.mean()
        line, change = found.line(found.temperature) - mean, found.value - mean
        for name, leg in (("heating", found.heating > 0), ("cooling", found.heating < 0)):
            if leg.any():
                model = (found.temperature[leg], line[leg]) if name == "heating" else None
                residual = (change - line)[leg]
                across, upward = found.temperature[leg], change[leg]
                curves.append(Curve(name=f"{axis} {name}", x=across, y=upward, model=model, residual=residual))
    if curves:
        chart(
            f"{series.name} over temperature",
            *curves,
            x=("temperature", "degC"),
            y=("change", series.unit),
            lines="the drift",
        )


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


def compared(drifts, recorded, check):
    """Check the second run against the first one and second units against first, and return lines of the deviations.

    Runs of one unit agree within their uncertainties, or something else changed. Units differ, and by how much is a
    figure. Both are told where a drift is too weak for a relative deviation, which is in the table where there is one.
    """
    for name in NAMES:
        role = name.partition(".")[0].capitalize()
        for axis in AXES:
            first, again = (drifts[run][name][axis].slope for run in ("first", "second"))
            other = drifts["third"][f"{name}2"][axis].slope
            runs = [recorded[run][name] for run in ("first", "second")]
            change = drift_change(*((run.time, run.temperature, run.axes[axis]) for run in runs), runs[0].unit)
            differs, why = relative_deviation(first, other), change.why("slope")
            error = normalised_error(change.slope)
            of, told, headline = f"{name}.{axis}", f"{name}.{axis}, second run", HEADLINES["", "drift_repeat"]
            check("IMU-LMP-050", "drift_repeat", error, of=of, doubts=why, at=told, headline=headline)
            yield deviating(of, "second run", relative_deviation(first, again))
            of, headline = f"{name}2.{axis}", HEADLINES[role, "drift_unit_difference"]
            told, number = f"{of}: {differs.remark}", "051" if role == "Gyroscope" else "052"
            check(f"IMU-LMP-{number}", "drift_unit_difference", differs.difference, of=of, at=told, headline=headline)
            yield deviating(of, "second unit", differs)


def deviating(of, what, deviation):
    """Return a line of the table of deviations; a number that is none is empty, and the remark says why."""
    figures = (deviation.difference, deviation.relative)
    numbers = [number for each in figures for number in (each.value, each.uncertainty)]
    cells = ("" if number is None or number != number else f"{number:.6g}" for number in numbers)  # noqa: PLR0124
    return ",".join([of, what, deviation.difference.unit, *cells, deviation.remark.replace(",", ";")])


DEVIATIONS = (
    "sensor and axis,against the first run,unit,difference,standard uncertainty,relative deviation,"
    "standard uncertainty,remark"
)


def abs_of(figure):
    """Return a figure's magnitude."""
    return figure if not figure.value < 0.0 else figure * -1.0


@pytest.mark.requirement(
    *(f"IMU-LMP-{number}" for number in ("010", "011", "021", "022", "023", "024", "025", "026")),
    *(f"IMU-LMP-{number}" for number in ("031", "032", "033", "034", "035", "040", "041", "050", "051", "052")),
)
@pytest.mark.max_duration(16000)
@pytest.mark.repeatable("heating and cooling can be done again, and reading a sensor does not change it")
def test_lamp(chamber, relays, thermometer, clock, sensor_set, check, chart, step, artifact, parameters):
    """Drift, offset and hysteresis of every axis, and how well they repeat, in a second run and with second units."""
    runs = Runs(chamber, relays, thermometer, clock, sensor_set, step, parameters)
    drifts, recorded = {}, {}
    for run, unit in RUNS.items():
        with step(f"The {run} run"):
            beside = runs.run(unit)
            _, warmth = beside.warmth
            check("IMU-LMP-011", "coldest", Figure(value=warmth.min(), unit="degC"), of=run)
            check("IMU-LMP-011", "hottest", Figure(value=warmth.max(), unit="degC"), of=run)
            drifts[run], recorded[run] = {}, {}
            for series in beside.series:
                recorded[run][series.name] = series
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
        artifact("drift-deviations.csv", "\n".join([DEVIATIONS, *compared(drifts, recorded, check)]) + "\n")
        for role in ("gyroscope", "magnetometer"):
            ranked(drifts["first"], role, artifact)
