"""Faults of the battery bench in whole runs: each is told, none ends in PASS, and the bench is safe in truth."""

from __future__ import annotations

import pytest
import sweeps
from battery_faults import Scene, loses_its_output, overshoots, plant
from battery_runs import battery_workspace
from told_as_json import bodies, results_as_json

pytestmark = [pytest.mark.system, pytest.mark.timeout(360)]

CHARGE, DEGRADATION = "battery_charge", "battery_degradation"
SHORT = {"iterations": "1", "rest": "60", "relaxation": "60"}
WITHOUT_ITS_PROTECTION = {'{over_voltage: "4.25", over_current: "0.8"}': '{over_voltage: "4.6", over_current: "0.8"}'}
CELL = "truth: {place: container}"
SERIAL = "serial: DP8C231402017\n      connects"
MORE_THAN_SET = {SERIAL: SERIAL.replace("\n", '\n        channels: {"1": {output_voltage_offset: "0.1"}}\n')}
NEGATIVE = ", ".join(f'"{-4.2 + place / 100:g}"' for place in range(14))
VOLTS = (3.0, 3.288, 3.438, 3.568, 3.658, 3.698, 3.738, 3.778, 3.838, 3.908, 3.988, 4.078, 4.128, 4.3)
OVERFULL = ", ".join(f'"{volts}"' for volts in VOLTS)


def cycler(fault):
    """Return the change of the bench file that gives its cycler a fault."""
    place = "      truth: {clock_drift:"
    return {place: f"      faults: [{fault}]\n{place}"}


def cell(truth):
    """Return the change of the bench file that puts another cell in."""
    return {CELL: f"truth: {{place: container, {truth}}}"}


@pytest.fixture
def scene(monkeypatch):
    """Return what happens behind the ports."""
    scene = Scene()
    scene.watch(monkeypatch)
    return scene


ENDED = {
    "charger above its setting": (MORE_THAN_SET, (), {}, "over-voltage protection of supply.charge has tripped"),
    "that, and no protection": (
        {**MORE_THAN_SET, **WITHOUT_ITS_PROTECTION},
        (),
        {},
        "the charger gives 4.300 V where 4.2 V are set",
    ),
    "overshoot, protection": ({}, ((1.0, overshoots(0.1)),), {}, "'tripped CURRENT'"),
    "overshoot, the cycler's own limit": (WITHOUT_ITS_PROTECTION, ((1.0, overshoots(0.1)),), {}, "'tripped VMAX'"),
    "overshoot, the envelope": (
        WITHOUT_ITS_PROTECTION,
        ((1.0, overshoots(0.3)),),
        {"highest_voltage": "4.3"},
        "is above 4.25 V",
    ),
    "thermistor open before": ({}, ((0.0, plant(ntc="open")),), {}, "what it measures is beyond SENSOR already"),
    "thermistor open": ({}, ((1.0, plant(ntc="open")),), {}, "'tripped SENSOR'"),
    "thermistor shorted": ({}, ((1.0, plant(ntc="shorted")),), {}, "'tripped SENSOR'"),
    "cycler reset": (cycler("{kind: reset, from: 1 h}"), (), {}, "it has restarted (boot 43, BROWNOUT)"),
    "no charge any more": ({}, ((1.0, plant(supply_current=0.02)),), {}, "'tripped CURRENT'"),
    "hardly any capacity": (cell('capacity: "0.03"'), (), {}, "'tripped VMIN'"),
    "charge relay welded before": (
        cycler("{kind: stuck-relay, relay: charge}"),
        ((0.0, plant(charge_contact=True)),),
        {},
        "reduced level of supply.charge: 3.007 V, 0.02 A, -0.005 to 0.005 A expected",
    ),
    "charge relay welded": (
        cycler("{kind: stuck-relay, relay: charge, from: 1 h}"),
        (),
        {},
        "'tripped ",
    ),
    "discharge relay open": (cycler("{kind: stuck-relay, relay: discharge}"), (), {}, "'tripped CURRENT'"),
    "fuse blown in a charge": ({}, ((1.0, plant(fuse="open")),), {}, "'tripped VMIN'"),
    "fuse blown in a discharge": ({}, ((5.5, plant(fuse="open")),), {}, "'tripped VMIN'"),
    "charger lost": ({}, ((1.0, loses_its_output),), {}, "'tripped CURRENT'"),
    "charger lost at the end": ({}, ((4.0, loses_its_output),), {}, "0.000 V where 4.2 V are set"),
    "cell too full": (cell(f'charge: "1.0", open_circuit: [{OVERFULL}]'), (), {}, "the cell has 4.300 V"),
}


@pytest.mark.parametrize("fault", sweeps.sample(ENDED, 4))
def test_a_fault_that_ends_the_run(scene, tmp_path, fault):
    """The case is an ERROR, or is not begun; the reason tells what it is; the bench is safe, proven and true."""
    changes, acts, overrides, words = ENDED[fault]
    scene.acts[:] = acts
    ran = battery_workspace(tmp_path / "w", CHARGE, changes).run(overrides={**SHORT, **overrides})
    (verdict,) = ran.verdicts().values()
    assert verdict in {"ERROR", "NOT_RUN"}
    assert words in ran.reasons("test_charge")
    assert "bench safe: every output proven" in ran.out
    assert scene.still_on() == {}


def test_a_cell_that_is_reversed_is_told_before_anything_is_on(scene, tmp_path):
    """The tester's reading tells; the run is refused before its first command."""
    ran = battery_workspace(tmp_path / "w", CHARGE, cell(f"open_circuit: [{NEGATIVE}]")).run(overrides=SHORT)
    assert ran.verdicts() == {"test_charge": "NOT_RUN"}
    assert "the cell has -4.2" in ran.reasons("test_charge")
    assert "is it reversed, is it connected, is its fuse whole?" in ran.reasons("test_charge")
    assert bodies(ran.package, "safe") == ()
    assert scene.still_on() == {}


SILENT = {
    "dead": "{kind: dead, from: 1 h}",
    "dead for longer than its heartbeat": "{kind: dead, from: 1 h, until: 4000 s}",
    "lines lost": "{kind: lost-lines, lines: '40', from: 1 h}",
    "lines torn": "{kind: torn-lines, share: '1', from: 1 h, until: 2 h}",
}


@pytest.mark.parametrize("fault", sweeps.sample(SILENT, 1))
def test_a_cycler_that_is_not_heard_is_not_proven_safe(scene, tmp_path, fault):
    """Whoever cannot be asked cannot be proven; the charger is off all the same."""
    ran = battery_workspace(tmp_path / "w", CHARGE, cycler(SILENT[fault])).run(overrides=SHORT)
    assert (ran.code, ran.verdicts()) == (7, {"test_charge": "ERROR"})
    assert "cycler1: asked STATE" in ran.reasons("test_charge")
    assert "NOT SAFE" in ran.out
    assert scene.still_on() == {}


def test_a_discharge_relay_that_is_welded_is_told_and_not_called_safe(scene, tmp_path):
    """Nothing on the bench can open it: the run says so, and that the cell is still being discharged."""
    changes = cycler("{kind: stuck-relay, relay: discharge, from: 5 h}")
    ran = battery_workspace(tmp_path / "w", CHARGE, changes).run(overrides=SHORT)
    assert (ran.code, ran.verdicts()) == (7, {"test_charge": "ERROR"})
    assert "a current flows through the cell, and no test runs" in ran.reasons("test_charge")
    assert "NOT SAFE: cycler stopped, cycler current -0." in ran.out
    assert "NOT SAFE: cycler watched, its current went -0." in ran.out
    assert set(scene.still_on()) == {"current of the cell"}


DOUBTED = {
    "thermistor detached": (((0.0, plant(ntc="detached")),), "is the thermistor at the cell?"),
    "thermistor detached in a charge": (((1.0, plant(ntc="detached")),), "is the thermistor at the cell?"),
    "charger interrupted at the end": (
        ((3.0, plant(supply_current=0.0)), (3.01, plant(supply_current=0.7))),
        "the current did not fade, it broke off",
    ),
}


@pytest.mark.parametrize("fault", sweeps.sample(DOUBTED, 1))
def test_a_fault_that_only_the_numbers_show_is_a_doubt(scene, tmp_path, fault):
    """What the tester did not notice leaves the cycle's numbers INCONCLUSIVE, each with the reason."""
    acts, words = DOUBTED[fault]
    scene.acts[:] = acts
    ran = battery_workspace(tmp_path / "w", CHARGE, cell('capacity: "1.5"')).run(overrides=SHORT)
    checks = [event for event in bodies(ran.package, "check") if event["of"] == "1"]
    assert {event["verdict"] for event in checks} == {"INCONCLUSIVE"}
    assert all(words in event["reason"] for event in checks)
    assert scene.still_on() == {}


def test_a_cell_that_comes_charged_is_emptied_first(scene, tmp_path):
    """Its first cycle does not count, so that the one that does is a whole one."""
    ran = battery_workspace(tmp_path / "w", CHARGE, cell('charge: "0.5"')).run(overrides=SHORT)
    starts = ran.package.text("data/attachments/test_charge-starts.csv").splitlines()
    assert [line.split(",")[2:] for line in starts[1:]] == [["3.778", "yes"]]
    row = ran.package.text("data/attachments/test_charge-iterations.csv").splitlines()[1].split(",")
    assert float(row[9]) == pytest.approx(1.99, abs=0.01)
    assert scene.still_on() == {}


COOLER = 'integral_time: "240"}'
FEED = '      connects: {"1": tec_feed.supply}'


@pytest.mark.parametrize("cut", sweeps.sample([True, False], 1))
def test_a_cooler_that_drives_on(scene, tmp_path, cut):
    """Its controller tells no output. A cell warms in a charge: a trip. Its supply cuts it off, or the plates tell."""
    changes = {COOLER: f"{COOLER}\n      faults: [{{kind: runaway, from: 1 h}}]"}
    if not cut:
        changes[FEED] = f'      faults: [{{kind: refuse-off, says: "off", from: 1 h}}]\n{FEED}'
    ran = battery_workspace(tmp_path / "w", DEGRADATION, changes).run(overrides={"cycles": "2"})
    assert ran.verdicts() == {"test_degradation": "ERROR"}
    assert ran.code == (6 if cut else 7)
    assert ("NOT SAFE: thermal watched" in ran.out) is not cut
    assert set(scene.still_on()) == (set() if cut else {"coolers"})


@pytest.mark.parametrize("moment", sweeps.sample(["0 h", "3 h"], 1))
def test_a_cooler_that_does_nothing(scene, tmp_path, moment):
    """At 40 degC and before: the way to the next temperature is not made, and no half-cycle begins there."""
    changes = {COOLER: f"{COOLER}\n      faults: [{{kind: stuck, from: {moment}}}]"}
    ran = battery_workspace(tmp_path / "w", DEGRADATION, changes).run(overrides={"cycles": "2"})
    assert ran.verdicts() == {"test_degradation": "ERROR"}
    expected = "have not come to 40 degC" if moment == "0 h" else "no temperature below 11.5 within 840 s"
    assert expected in ran.reasons("test_degradation")
    assert "bench safe: every output proven" in ran.out
    assert scene.still_on() == {}


@pytest.mark.parametrize("hours", sweeps.sample([0.0, 2.5], 1))
def test_a_thermistor_that_hangs_in_the_box_between_the_plates(scene, tmp_path, hours):
    """It never comes to the plates' temperature, or leaves it during a charge: neither passes."""
    scene.acts[:] = [(hours, plant(ntc="detached"))]
    ran = battery_workspace(tmp_path / "w", DEGRADATION).run(overrides={"cycles": "1"})
    assert ran.verdicts() == {"test_degradation": "ERROR"}
    assert "come to" in ran.reasons("test_degradation") or "no temperature below" in ran.reasons("test_degradation")
    assert scene.still_on() == {}


def test_a_charge_that_broke_off_is_a_doubt_of_charges_and_fade(scene, tmp_path):
    """A charger that was gone for half a minute near the end of a charge looks like a charge that was over."""
    scene.acts[:] = [(4.0, plant(supply_current=0.0)), (4.01, plant(supply_current=0.7))]
    ran = battery_workspace(tmp_path / "w", DEGRADATION).run(overrides={"cycles": "4"})
    (case,) = results_as_json(ran.package)["cases"]
    found = {name for name, verdict in case["requirements"].items() if verdict == "INCONCLUSIVE"}
    assert found == {"EPS-DEG-001", "EPS-DEG-008"}
    assert "the charge of cycle 1 ended with" in ran.reasons("test_degradation")
    assert scene.still_on() == {}
