"""What the envelope of the battery bench computes from the cycler's lines ends runs that nothing else would end."""

from __future__ import annotations

import io
import re
from functools import partial

import pytest
import sweeps
from battery_faults import Scene, plant
from battery_runs import battery_workspace
from told_as_json import bodies

from hil.evidence.package.contents import Package
from hil.executive.resuming.preconditions import resumed_request
from hil.plugin.rehearsing import replay
from hil.plugin.running import resume, run

pytestmark = [pytest.mark.system, pytest.mark.timeout(360)]

CHARGE, DEGRADATION = "battery_charge", "battery_degradation"
SHORT = {"iterations": "1", "rest": "60", "relaxation": "60"}
CELL = "truth: {place: container}"
NOISE = "voltage_noise: "
HOUR_NS = 3_600_000_000_000


def tells(**changes):
    """Return an act that lets the tester's converter tell other numbers, and its own limits be far away.

    Changes are functions of the number that it would tell and of the hours since then, in the units of its lines.
    """

    def act(world):
        firmware = world.by_device["cycler1"]._peer
        measure, began_ns = firmware._measure, world.clock.now_ns()
        firmware.settings.values |= {"tmax": 600, "tmin": -300, "vmin": -9000, "time": 172_800, "charge": 10_000}
        firmware.sequence._calm = firmware.sequence._bounds()

        def otherwise(at_ns, reading):
            hours = (at_ns - began_ns) / HOUR_NS
            numbers = dict(zip(("volts", "amperes", "degrees"), reading, strict=True))
            return tuple(
                round(changes[name](number, hours)) if name in changes else number for name, number in numbers.items()
            )

        def told(times_ns):
            return [otherwise(*each) for each in zip(times_ns, measure(times_ns), strict=True)]

        firmware._measure = told

    return act


def holds(celsius):
    """Return an act that has somebody set the controller by hand; whatever it is told then, it holds that."""

    def act(world):
        controller = world.by_device["tec1"]._peer
        controller._setpoint = lambda _: (False, round(celsius * 10))

    return act


@pytest.fixture
def scene(monkeypatch):
    """Return what happens behind the ports."""
    scene = Scene()
    scene.watch(monkeypatch)
    return scene


TRIPS = {
    "a charge that does not end": (
        {CELL: 'truth: {place: container, capacity: "3.5"}'},
        (),
        "charged",
        r"cycler: charge while charging 2\.60\d+ A\.h is above 2\.6 A\.h, at \d+(\.\d+)? s of recording 001-",
    ),
    "a reversed cell": (
        {},
        ((1.0, tells(volts=lambda *_: -4200)),),
        "cell-polarity",
        r"cycler: voltage -4\.2 V is below -0\.05 V",
    ),
    "a hot charge": (
        {},
        ((1.0, tells(degrees=lambda *_: 453)),),
        "charging-temperature",
        r"temperature while charging 45\.3 degC is above 45 degC",
    ),
    "a cold charge": (
        {},
        ((1.0, tells(degrees=lambda *_: -12)),),
        "charging-temperature",
        r"temperature while charging -1\.2 degC is below 0 degC",
    ),
    "a cell that runs away": (
        {},
        ((1.0, tells(degrees=lambda number, hours: number + 10 * 180 * hours)),),
        "cell-warming-in-charge",
        r"slope of temperature while charging (2\.\d+|3) K/min is above 2 K/min",
    ),
    "a cell that heats up all at once": (
        {},
        ((1.0, tells(degrees=lambda number, hours: number + 10 * 3000 * hours)),),
        None,
        r"slope of temperature.* K/min is above",
    ),
    "a stuck thermistor": (
        {},
        ((0.0, tells(degrees=lambda *_: 251)),),
        "thermistor-stuck",
        r"time of unchanged temperature while flowing 3(\.\d+)? h is above 3 h",
    ),
    "a detached thermistor in a box that is as warm as ever": (
        {CELL: 'truth: {place: container, capacity: "2.5", load_current: "0.5"}'},
        ((0.0, plant(ntc="detached")),),
        "thermistor-detached",
        r"time of unchanged temperature while flowing 8(\.\d+)? h is above 8 h",
    ),
    "a cell above its charger": (
        {NOISE: 'voltage_offset: "0.12", voltage_noise: '},
        (),
        "cell-against-charger",
        r"voltage against supply\.charge while charging 0\.0\d+ V is above 0\.03 V",
    ),
}


@pytest.mark.parametrize("fault", sweeps.sample(TRIPS, 4))
def test_a_fault_that_trips_the_bench(scene, tmp_path, fault):
    """The trip names limit, number and row; the case is an ERROR; the bench is safe in truth."""
    changes, acts, limit, words = TRIPS[fault]
    scene.acts[:] = acts
    ran = battery_workspace(tmp_path / "w", CHARGE, changes).run(overrides=SHORT)
    (trip,) = bodies(ran.package, "trip")
    assert re.search(words, trip["text"]), trip["text"]
    assert limit in {None, trip["limit"]}
    assert (ran.code, ran.verdicts()) == (6, {"test_charge": "ERROR"})
    assert scene.still_on() == {}


def test_a_plate_below_the_dew_point_trips_the_bench(scene, tmp_path):
    """A setpoint that somebody changed by hand cools the plates until water would condense, and no further."""
    scene.acts[:] = [(5.5, holds(0.0))]
    ran = battery_workspace(tmp_path / "w", DEGRADATION).run(overrides={"cycles": "1"})
    (trip,) = bodies(ran.package, "trip")
    assert (trip["limit"], trip["value"] < 4) == ("plate-temperature", True)
    assert "is below 4 degC" in trip["text"]
    assert (ran.code, ran.verdicts()) == (6, {"test_degradation": "ERROR"})
    assert scene.still_on() == {}


def test_a_setpoint_below_the_dew_point_is_refused(tmp_path):
    """The clamp does not let it out."""
    ran = battery_workspace(tmp_path / "w", DEGRADATION).run(overrides={"cycles": "1", "discharge_temperature": "3"})
    assert ran.verdicts() == {"test_degradation": "ERROR"}
    assert "3 degC" in ran.reasons("test_degradation")


def test_what_was_charged_before_a_stop_counts_after_it(scene, monkeypatch, tmp_path):
    """The rows of the charge that was broken off are void, and what it put into the cell is in it all the same."""
    monkeypatch.setenv("PATH", str(tmp_path))
    workspace = battery_workspace(tmp_path / "w", CHARGE, {CELL: 'truth: {place: container, capacity: "3.5"}'})
    out = io.StringIO()
    scene.acts[:] = [(2.0, scene.stops_to_be_resumed)]
    assert run(workspace.request(overrides=SHORT), out) == 2, out.getvalue()
    scene.acts[:] = []
    request = partial(resumed_request, start=workspace.root, answers=None, person=False)
    assert resume(workspace.folders()[0], request, out) == 6, out.getvalue()
    package = Package(workspace.folders()[0])
    (trip,) = bodies(package, "trip")
    assert (trip["limit"], round(trip["value"], 2)) == ("charged", 2.6)
    (recording,) = [event["recording"] for event in bodies(package, "recording") if event["name"] == "test"]
    test = package.recording(recording)
    charged = float((test["current"] * (test["phase"] == 1.0)).sum()) * 5 / 3600
    assert charged == pytest.approx(2.6, abs=0.01)
    assert replay(package).differences == ()
