"""Drift in thermal vacuum over five hours, from logs that break off: what each fragment shows, or why nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from hil.analysis import drift_of, fragments, not_observable
from hil.plan import Curve, Figure, Implausible, NoReply

REFERENCE = "thermometer.reference"
NAMES = ("gyroscope.bno", "magnetometer.bno", "magnetometer.lsm", "magnetometer.icm", "magnetometer.lis")
DRIFT = {"gyroscope.bno": "020", "magnetometer.bno": "021"}
"""Requirements with a limit of a data sheet, by the sensor; of all others it is 022."""

HEADLINES = {"drift": "Drift over temperature", "drift_time": "Drift over time"}
"""What stands on the first page of the report, by parameter."""

COLUMNS = (
    *("log", "sensor and axis", "begin s", "length s", "samples", "temperature change K", "temperature K/h"),
    *("drift per K", "uncertainty per K", "drift per h", "uncertainty per h", "why nothing is said"),
)
_STEP_K = 1.0
_STEADY_K = 5.0
"""A fragment in which the temperature changed by less shows drift over time; from there on, drift over temperature."""

_SETTLED_K = 2.0
_NEVER_S = 1e-3


@dataclass(frozen=True)
class Fragment:
    """What one sensor recorded without a break, and what its axes say."""

    name: str
    log: str
    begin: float
    samples: int
    lasted: float
    changed: float
    drifts: dict
    unit: str
    doubts: tuple


class Vacuum:
    """The plate in the chamber, and the logs that are written while its temperature goes through the profile."""

    def __init__(self, thermal, clock, sensor_set, step, parameters):
        self._thermal, self._clock, self._sensor_set = thermal, clock, sensor_set
        self._step, self._parameters = step, parameters
        self._plate = thermal.temperature().value
        self.broken = []

    def logs(self):
        """Go through the profile; yield the name of each log with what was recorded.

        Every way and every soak is a log of its own. One in which a sensor falls silent ends there; what it holds so
        far stays in the evidence, and the next log begins with sensors that were started again.
        """
        plates = self._parameters.plates
        for number, target in enumerate(plates, 1):
            yield from self._log(f"way {number} to {target:g} degC", lambda target=target: self._go(target))
            if number < len(plates):
                yield from self._log(f"soak {number} at {target:g} degC", lambda target=target: self._stay(target))

    def _log(self, name, during):
        with self._step(f"Log: {name}"):
            try:
                with self._sensor_set(name, NAMES, self._parameters.rate, {}) as beside:
                    during()
            except NoReply as silence:
                self.broken.append(f"{name}: {silence}")
                during()
                return
        yield name, beside

    def _go(self, target):
        """Move the plate to a temperature in steps, each as long as its kelvins take."""
        while self._plate != target:
            step = min(max(target - self._plate, -_STEP_K), _STEP_K)
            self._plate += step
            self._thermal.hold(round(self._plate, 1))
            self._clock.sleep(max(abs(step) * self._parameters.ramp, _NEVER_S))

    def _stay(self, target):
        self._clock.sleep(self._parameters.soak)
        plate = self._thermal.temperature().value
        if abs(plate - target) > _SETTLED_K:
            told = f"the plate did not come to {target:g} degC and stay, it is at {plate:.1f} degC"
            raise Implausible("thermal", told, "look at the cooler, and at the sensor on the plate")


def fragments_of(log, series, reference):
    """Return the fragments of one sensor's part of a log, and what each of its axes says."""
    for part in fragments(series.time, series.rate):
        time, temperature = series.time[part], series.temperature[part]
        yield Fragment(
            name=series.name,
            log=log,
            begin=float(time[0]),
            samples=len(time),
            lasted=float(time[-1] - time[0]),
            changed=float(np.ptp(temperature)),
            drifts={
                axis: drift_of(
                    time, temperature, samples[part], series.unit, reference=reference, least_range=_STEADY_K
                )
                for axis, samples in series.axes.items()
            },
            unit=series.unit,
            doubts=series.doubts,
        )


def table(found):
    """Return every fragment as a line of a table, those that are too poor for a statement with the reason."""
    lines = [",".join(COLUMNS)]
    for each in found:
        for axis, drift in each.drifts.items():
            why = "; ".join(reason for name in ("slope", "per_hour") for reason in drift.why(name))
            figures = [
                f"{number:.6g}" if number is not None and np.isfinite(number) else ""
                for figure in (drift.slope, drift.per_hour)
                for number in (figure.value, figure.uncertainty)
            ]
            start = f"{each.log},{each.name}.{axis},{each.begin:.1f},{each.lasted:.1f},{each.samples}"
            warming = f"{each.changed:.3f},{drift.warming.value:.4g}"
            lines.append(f'{start},{warming},{",".join(figures)},"{why}"')
    return "\n".join(lines) + "\n"


def judge(found, check):
    """Check the drifts of every fragment that shows one; an axis of which none does is not observable."""
    for name in NAMES:
        number = DRIFT.get(name, "022")
        timed = "030" if name.startswith("gyroscope") else "031"
        own = [each for each in found if each.name == name]
        unit = own[0].unit if own else "uT"
        for axis in "xyz":
            of = f"{name}.{axis}"
            for requirement, parameter, figure, per, steady in (
                (number, "drift", "slope", "K", False),
                (timed, "drift_time", "per_hour", "h", True),
            ):
                telling = [each for each in own if (each.changed < _STEADY_K) == steady]
                told = [each for each in telling if not each.drifts[axis].why(figure)]
                poor = [f"{each.log}: {why}" for each in telling for why in each.drifts[axis].why(figure)]
                for each in told:
                    value, at = getattr(each.drifts[axis], figure), f"{of}, {each.log}"
                    headline = f"{HEADLINES[parameter]} of {name.partition('.')[0]}s"
                    check(
                        f"IMU-TVC-{requirement}",
                        parameter,
                        value,
                        of=of,
                        doubts=list(each.doubts),
                        at=at,
                        headline=headline,
                    )
                if not told:
                    why = poor or ["no fragment was long enough"]
                    check(f"IMU-TVC-{requirement}", parameter, not_observable(f"{unit}/{per}"), of=of, doubts=why)


def draw(found, chart):
    """Draw every sensor over temperature, and the drift of every way of those for which there is a limit.

    All ways are drawn together, without their means, with the lines of the widest way.
    """
    for name in NAMES:
        ways = [each for each in found if each.name == name and each.changed >= _STEADY_K]
        if not ways:
            continue
        widest, curves = max(ways, key=lambda each: each.changed), []
        for axis, line in widest.drifts.items():
            if line.why("slope"):
                continue
            told = [each.drifts[axis] for each in ways if len(each.drifts[axis].time)]
            across, value, heating = (
                np.concatenate([getattr(each, what) for each in told]) for what in ("temperature", "value", "heating")
            )
            ends = np.array([line.temperature.min(), line.temperature.max()])
            model = (ends, line.line(ends) - value.mean())
            for leg, branch in (("heating", heating > 0), ("cooling", heating < 0)):
                curves.append(
                    Curve(
                        name=f"{axis} {leg}",
                        x=across[branch],
                        y=value[branch] - value.mean(),
                        model=model if leg == "heating" else None,
                    )
                )
        if curves:
            chart(
                f"{name} over temperature",
                *curves,
                x=("temperature", "degC"),
                y=("change", ways[0].unit),
                lines="the drift of the way on which the temperature changed most",
            )
        if name in DRIFT:
            each_way(name, ways, chart)


def each_way(name, ways, chart):
    """Draw what each way of one sensor says of its drift, with its bars, against the limit."""
    curves = []
    for axis in "xyz":
        told = [(float(each.log.split()[1]), each.drifts[axis]) for each in ways]
        told = [(number, drift.slope) for number, drift in told if not drift.why("slope")]
        if told:
            numbers, slopes = zip(*told, strict=True)
            curves.append(Curve(name=axis, x=numbers, y=slopes))
    if curves:
        of, unit = (f"IMU-TVC-{DRIFT[name]}", "drift"), f"{ways[0].unit}/K"
        chart(f"{name}, drift of each way", *curves, x=("way", "1"), y=("drift", unit), limit=of)


@pytest.mark.requirement(*(f"IMU-TVC-{number}" for number in ("010", "011", "020", "021", "022", "030", "031")))
@pytest.mark.max_duration(30000)
@pytest.mark.repeatable("the profile can be gone through again, and reading a sensor does not change it")
def test_vacuum(thermal, clock, sensor_set, check, chart, step, artifact, parameters):
    """Drift over temperature and over time, fragment by fragment, from -20 degC to 40 degC."""
    vacuum = Vacuum(thermal, clock, sensor_set, step, parameters)
    found, warmth, times, recorded = [], [], [], 0.0
    for log, beside in vacuum.logs():
        time, reference = beside.warmth
        warmth.append(reference)
        times.append(time)
        recorded += sum(time[part][-1] - time[part][0] for part in fragments(time, parameters.rate))
        for series in beside.series:
            found += fragments_of(log, series, parameters.reference)
    lasted = times[-1][-1] - times[0][0]
    with step("Look at the profile"):
        hottest, coldest = max(each.max() for each in warmth), min(each.min() for each in warmth)
        check("IMU-TVC-010", "hottest", Figure(value=hottest, unit="degC"), headline="Hottest")
        check("IMU-TVC-010", "coldest", Figure(value=coldest, unit="degC"), headline="Coldest")
        check("IMU-TVC-010", "duration", Figure(value=lasted / 3600.0, unit="h"), headline="Duration")
        check("IMU-TVC-011", "recorded", Figure(value=recorded / lasted, unit="1"), headline="Part recorded")
    with step("Say what each fragment shows"):
        artifact("fragments.csv", table(found))
        draw(found, chart)
        judge(found, check)
