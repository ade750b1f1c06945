"""Battery plans that were stopped to be resumed: begun again with an emptied cell, and every cycle counted once."""

from __future__ import annotations

import csv
import io
from functools import partial

import pytest
import sweeps
from battery_faults import Scene
from battery_runs import battery_workspace
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.executive.resuming.preconditions import resumed_request
from hil.plugin.rehearsing import replay
from hil.plugin.running import resume, run

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

CHARGE, DEGRADATION = "battery_charge", "battery_degradation"
THREE = {"iterations": "3", "relaxation": "60"}


@pytest.fixture
def scene(monkeypatch, tmp_path):
    """Return what happens behind the ports; runs do not look at the product's own commits."""
    monkeypatch.setenv("PATH", str(tmp_path))
    scene = Scene()
    scene.watch(monkeypatch)
    return scene


def stopped_at(scene, root, plan, overrides, *hours):
    """Run a plan, stop it at instants of bench time, resume it each time, and return its package and its case."""
    workspace, out = battery_workspace(root / "workspace", plan), io.StringIO()
    request = partial(resumed_request, start=workspace.root, answers=None, person=False)
    for place, hour in enumerate([*hours, None]):
        scene.acts[:] = [(hour, scene.stops_to_be_resumed)] if hour else []
        if place:
            code = resume(workspace.folders()[0], request, out)
        else:
            code = run(workspace.request(overrides=overrides), out)
        assert (code == 2) == (hour is not None), out.getvalue()
    package = Package(workspace.folders()[0])
    (case,) = results_as_json(package)["cases"]
    return package, case


def table(package, case, name):
    """Return an artifact as rows of texts, without its head."""
    return list(csv.reader(package.text(f"data/attachments/{case}-{name}.csv").splitlines()))[1:]


def agrees(package):
    """Assert that the package is whole, and that its checks come out of its bytes again."""
    assert verify(package.folder).findings == ()
    assert replay(package).differences == ()


STOPS = {
    "in a charge": ((9.0,), [("1", "no"), ("2", "yes")]),
    "in the rest after a charge": ((12.2,), [("1", "no"), ("2", "yes")]),
    "in a discharge": ((14.0,), [("1", "no"), ("2", "yes")]),
    "in the rest after a discharge": ((7.8,), [("1", "no"), ("2", "no")]),
    "in the first charge": ((2.0,), [("1", "yes")]),
    "twice in one turn": ((9.0, 20.0), [("1", "no"), ("2", "yes")]),
    "in two turns": ((2.0, 20.0), [("1", "yes"), ("2", "yes")]),
}


@pytest.mark.parametrize("stop", sweeps.chosen(["in two turns"], list(STOPS)))
def test_a_charge_plan_goes_on_with_the_cycles_that_are_left(scene, tmp_path, stop):
    """Every cycle is whole, the interrupted one made again, and only the record tells of the gap."""
    hours, begun = STOPS[stop]
    package, case = stopped_at(scene, tmp_path, CHARGE, THREE, *hours)
    starts = table(package, "test_charge", "starts")
    assert [(row[0], row[3]) for row in starts] == begun
    assert all((float(row[2]) > 3.25) == (row[3] == "yes") for row in starts)
    rows = table(package, "test_charge", "iterations")
    assert [row[0] for row in rows] == ["1", "2", "3"]
    for row in rows:
        assert [float(row[place]) for place in (9, 10)] == pytest.approx([1.985, 1.985], abs=0.01)
        assert float(row[13]) == pytest.approx(1.0, abs=0.006)
        assert float(row[23]) == pytest.approx(0.05, abs=0.003)
    verdicts = {event["parameter"]: event["verdict"] for event in bodies(package, "check") if event["of"] == "2"}
    assert set(verdicts.values()) <= {"PASS", "RECORDED"}
    told = [event for event in bodies(package, "check") if event["parameter"] == "stopped"]
    assert [event["verdict"] for event in told] == ["INCONCLUSIVE"] * 3
    assert case["requirements"]["EPS-BAT-010"] == "PASS"
    assert scene.still_on() == {}
    agrees(package)


def test_the_rest_in_which_a_run_was_stopped_tells_no_voltage(scene, tmp_path):
    """The voltage after the discharge before it is a doubt, those of other cycles are not."""
    package, _ = stopped_at(scene, tmp_path, CHARGE, THREE, 7.8)
    found = {
        event["of"]: event["verdict"]
        for event in bodies(package, "check")
        if event["parameter"] == "rest_voltage_discharged"
    }
    assert found == {"1": "INCONCLUSIVE", "2": "RECORDED"}


@pytest.mark.parametrize("hours", sweeps.sample([(10.0,), (14.0, 30.0)], 1))
def test_a_degradation_goes_on_with_the_cycles_that_are_left(scene, tmp_path, hours):
    """Soaked and emptied again, with all cycles in the table; the fade is that of an undisturbed run."""
    package, case = stopped_at(scene, tmp_path, DEGRADATION, {"cycles": "5"}, *hours)
    for row in table(package, "test_degradation", "cycles"):
        assert [float(row[place]) for place in (6, 7)] == pytest.approx([1.985, 1.985], abs=0.015)
        assert [float(text) for text in row[11:15]] == pytest.approx([40, 40, 10, 10], abs=1)
    fades = {row[0]: row for row in table(package, "test_degradation", "fade")}
    assert float(fades["capacity_fade"][3]) < -0.00107 < float(fades["capacity_fade"][4])
    inconclusive = {name for name, verdict in case["requirements"].items() if verdict == "INCONCLUSIVE"}
    assert inconclusive == {"EPS-DEG-003", "EPS-DEG-004", "EPS-DEG-005"}
    assert set(case["requirements"].values()) == {"INCONCLUSIVE", "PASS", "RECORDED"}
    assert scene.still_on() == {}
    agrees(package)
