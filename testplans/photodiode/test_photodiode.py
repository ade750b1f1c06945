"""A photodiode under a halogen lamp from 15 to 35 degC: its parameters, its calibration, and what that leaves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis import (
    Known,
    calibrate_photodiode,
    drift_of,
    photodiode_as_c_header,
    photodiode_as_json,
    photodiode_from_json,
    photodiode_reproduction,
    volts,
)
from hil.plan import Curve, Figure

NOMINAL = 25.0
COUNTS, WARMTH = "obc.photodiode", "thermometer.temperature"
LOADS = ("board", "middle", "low")
TEMPERATURES = (15.0, 25.0, 35.0)
DARK = 0.01
NOISE = 1.0
"""In LSB: what a photodiode without light may read."""
TOP = 0.9995
"""Of the full scale: from there on a reading says nothing."""
IN_CHART = 400
"""Points of a curve: more cannot be seen."""


class Electrical:
    """What counts are in volts, and loads in ohms.

    Attributes:
        reference: the voltage at full scale, by the meter.
        change: of it, from before the readings to after them.
        doubts: why it cannot be trusted.
    """

    def __init__(self, before, after, full_scale, own, parameters):
        self.reference, self.change = (before + after) * 0.5, after - before
        self._full_scale, self._parameters = full_scale, parameters
        apart = own.value / self.reference.value - 1.0
        self.doubts = []
        if not abs(apart) <= parameters.references_apart:
            told = f"the board's own reference is {apart:.1%} from the meter's"
            self.doubts.append(f"{told}, at most {parameters.references_apart:.0%} are expected: look at both")

    def known(self, recording):
        """What the calibration has to know beforehand; certificates of a recording tell of counts and temperature."""
        full, parameters = self.reference.value, self._parameters
        return Known(
            nominal=NOMINAL,
            series=parameters.series,
            full_scale=full,
            reference=math.hypot(self.reference.uncertainty or 0.0, self.change.value / math.sqrt(12.0)) / full,
            offset=float(recording.uncertainty(COUNTS) or 0.0) * full / self._full_scale.value,
            load=parameters.load_uncertainty,
            temperature=math.hypot(float(recording.uncertainty(WARMTH) or 0.0), parameters.junction_apart),
        )

    def volts(self, counts):
        """Return readings in V."""
        return volts(counts, self.reference, self._full_scale)

    def ohms(self, load):
        """Return the resistance of a load: the board's, alone or with another beside it."""
        beside = 0.0 if load == "board" else 1.0 / getattr(self._parameters, load)
        return 1.0 / (1.0 / self._parameters.load + beside)


def leaks(dark, lit):
    """Return what speaks against the box: light in the dark of more than a hundredth of the lamp's."""
    if dark.counts.mean() <= max(NOISE, DARK * lit.counts.mean()):
        return []
    told = f"the dark reading is {dark.counts.mean():.3g} LSB, and {lit.counts.mean():.3g} LSB under the lamp"
    return [f"{told}: look for light"]


def blind(seen, highest):
    """Return what speaks against the monitor: one at full scale sees no change of the lamp."""
    most = max(each.monitor.max() for each in seen)
    return [f"the monitor reads {most:.0f} LSB: give it less light"] if most > highest else []


def check_light(dark, lit, monitor, check):
    """Hold the readings in the dark and under the lamp, and those of the lamp's monitor, against their limits."""
    check("SUN-PHD-014", "dark", Figure(value=dark.counts.mean(), unit="LSB"))
    for load, each in lit.items():
        check("SUN-PHD-014", "lit", Figure(value=each.counts.mean(), unit="LSB"), of=load, at=f"load: {load}")
    check("SUN-PHD-014", "lit", Figure(value=monitor, unit="LSB"), of="monitor", at="monitor of the lamp")


def check_warmth(requirement, leg, ends, check):
    """Hold the lowest and the highest temperature of a leg against their limits; `ends` are their names."""
    for name, value in zip(ends, (leg.temperature.min(), leg.temperature.max()), strict=True):
        apart = leg.recording.uncertainty(WARMTH)
        check(requirement, name, Figure(value=value, unit="degC", uncertainty=apart))


def calibrated(seen, electrical):
    """Calibrate with everything but the cooling; return the report and the mean of the monitor."""
    read = np.concatenate([electrical.volts(each.counts) for each in seen])
    degrees = np.concatenate([each.temperature for each in seen])
    loads = np.concatenate([np.full(len(each.counts), electrical.ohms(each.load)) for each in seen])
    monitor = np.concatenate([each.monitor for each in seen])
    fitted = np.concatenate([np.full(len(each.counts), each.name != "cooling") for each in seen])
    known = electrical.known(seen[0].recording)
    report = calibrate_photodiode(read, degrees, loads, light=monitor, fitted=fitted, known=known)
    return report, (read, degrees, loads), monitor.mean()


def export(report, readings, doubts, check, artifact):
    """Write the calibration for others, and hold what was written against the readings."""
    if not report.conclusive:
        check("SUN-PHD-041", "export", "no calibration", doubts=doubts)
        return
    text = photodiode_as_json(report)
    artifact("photodiode.json", text)
    artifact("photodiode.h", photodiode_as_c_header(report))
    told = photodiode_reproduction(photodiode_from_json(text), report, *readings)
    check("SUN-PHD-041", "export", told, doubts=doubts)


def draw(seen, report, electrical, relative, chart):
    """Draw the readings with the model and its residuals, and what is left of them when they are calibrated."""
    grid = np.linspace(report.coldest, report.hottest, 41)
    for name in ("heating", "cooling", "middle", "low"):
        parts = [each for each in seen if name in (each.name, each.load)]
        ohms = electrical.ohms(parts[0].load)
        few = slice(None, None, sum(len(each.counts) for each in parts) // IN_CHART + 1)
        across = np.concatenate([each.temperature for each in parts])[few]
        read = np.concatenate([electrical.volts(each.counts) for each in parts])[few]
        curve = {"name": f"{name}, {ohms / 1e3:.3g} kohm", "x": across, "y": read * 1e3}
        if report.conclusive:
            light = np.concatenate([relative(each) for each in parts])[few]
            curve["residual"] = (read - report.diode.voltage_of(light, across, ohms)) * 1e3
            if name != "cooling":
                curve["model"] = (grid, report.diode.voltage_of(1.0, grid, ohms) * 1e3)
        chart(
            "Photodiode under the lamp",
            Curve(**curve),
            x=("temperature", "degC"),
            y=("reading", "mV"),
            lines="the model in the mean light",
        )
    if not report.conclusive:
        return
    cooling = next(each for each in seen if each.name == "cooling")
    few = slice(None, None, len(cooling.counts) // IN_CHART + 1)
    raw = cooling.counts / cooling.monitor
    light = report.diode.light_of(electrical.volts(cooling.counts), cooling.temperature, electrical.ohms("board"))
    for name, values in (("as read", raw), ("calibrated", light / relative(cooling))):
        share = (values / values.mean() - 1.0) * 100.0
        chart(
            "Cooling, before and after calibration",
            Curve(name=name, x=cooling.temperature[few], y=share[few]),
            x=("temperature", "degC"),
            y=("change", "%"),
        )


@pytest.mark.requirement(*(f"SUN-PHD-{number}" for number in ("010", "011", "012", "013", "014", "020", "021")))
@pytest.mark.requirement(*(f"SUN-PHD-{number}" for number in ("022", "030", "040", "041")))
@pytest.mark.max_duration(12000)
@pytest.mark.repeatable("lamp and hot air can be switched again, and reading a photodiode does not change it")
def test_photodiode(black_box, multimeter, obc, thermometer, operator, check, chart, step, artifact, parameters):
    """Photocurrent, saturation current, sensitivity and calibration, verified on readings that it was not made from."""
    rate, held, settling = parameters.rate, parameters.held, parameters.settling
    with step("Close the box"):
        operator.confirm(
            "The photodiode faces the lamp, nothing stands between them, and the lid is on and taped.", name="box"
        )
        thermometer.start()
        before, full_scale, own = multimeter.voltage(), obc.full_scale(), obc.reference()
    with step("Read in the dark"):
        dark = black_box.read("dark", "board", held, rate)
        black_box.seen.clear()
    with step("Read at every load, cold"):
        black_box.light(settling)
        lit = {load: black_box.read(f"cold-{load}", load, held, rate, settling) for load in LOADS}
    with step("Warm the box with lamp and hot air"):
        heating = black_box.warm("heating", (parameters.coldest, parameters.hottest), parameters.leg, rate)
    with step("Read at every load, warm"):
        for load in LOADS:
            black_box.read(f"warm-{load}", load, held, rate, settling)
    with step("Let the box cool under the lamp"):
        cooling = black_box.read("cooling", "board", parameters.leg, rate)
        black_box.end()
        after = multimeter.voltage()
    with step("Calibrate"):
        electrical = Electrical(before, after, full_scale, own, parameters)
        report, readings, monitor = calibrated(black_box.seen, electrical)
        doubts = [*electrical.doubts, *report.doubts, *leaks(dark, lit["board"])]
        doubts += blind(black_box.seen, TOP * full_scale.value)
        check_warmth("SUN-PHD-012", heating, ("coldest", "hottest"), check)
        check("SUN-PHD-013", "reference", electrical.reference, doubts=electrical.doubts)
        check("SUN-PHD-013", "reference_change", electrical.change)
        check_light(dark, lit, monitor, check)
    with step("State the parameters"):
        at = f"{NOMINAL:g} degC"
        for number, name, headline in (
            ("020", "photocurrent", "Photocurrent under the lamp"),
            ("020", "coefficient", ""),
            ("021", "saturation", "Saturation current"),
            ("021", "ideality", ""),
        ):
            check(f"SUN-PHD-{number}", name, report.figures[name], doubts=doubts, at=at, headline=headline)
        for name in ("gap", "shunt", "series"):
            check("SUN-PHD-022", name, report.figures[name], doubts=doubts, at=at)
        for celsius in TEMPERATURES:
            found = report.sensitivity(celsius, electrical.ohms("board"))
            check("SUN-PHD-030", "sensitivity", found, of=f"{celsius:g} degC", doubts=doubts)
    with step("Verify the calibration with the readings taken while cooling"):

        def relative(each):
            return each.monitor / monitor

        place = (cooling.time, cooling.temperature)
        raw = drift_of(*place, cooling.counts / cooling.monitor, "1", reference=NOMINAL)
        light = report.diode.light_of(electrical.volts(cooling.counts), cooling.temperature, electrical.ohms("board"))
        left = drift_of(*place, light / relative(cooling) / report.diode.photocurrent, "1", reference=NOMINAL)
        scale = raw.offset
        why = [*doubts, *raw.why("slope")]
        check("SUN-PHD-030", "raw_slope", raw.slope / scale if scale.value else raw.slope, doubts=why)
        why = [*doubts, *left.why("slope")]
        check("SUN-PHD-040", "remaining_slope", left.slope, doubts=why, headline="Slope after calibration")
        check_warmth("SUN-PHD-040", cooling, ("verified_to", "verified_from"), check)
    with step("Export the calibration, and recompute the export"):
        export(report, readings, doubts, check, artifact)
        draw(black_box.seen, report, electrical, relative, chart)
