"""Whole runs of the plan battery_charge: the published table comes out, evidence repeats, doubts and faults show."""

from __future__ import annotations

import csv

import pytest
from battery_runs import battery_workspace
from told_as_json import bodies, results_as_json

from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

PUBLISHED = """\
2:47:58 4:18:30 28.6 24.9 32.9 24.1 7.98 7.07
2:46:48 4:20:30 28.1 24.3 32.2 25.2 8.04 7.03
2:47:05 4:20:35 27.6 24.0 31.5 24.3 8.04 7.06
2:47:00 4:14:34 28.0 24.6 31.9 24.8 8.03 7.06
2:46:45 4:17:25 28.2 24.3 31.7 24.2 8.03 7.06
2:46:50 4:16:25 27.7 24.0 31.9 24.8 8.02 7.06
2:46:30 4:14:25 27.7 24.3 31.6 24.4 8.01 7.04
2:46:25 4:11:35 28.1 24.6 31.6 24.1 8.00 7.05
2:46:20 4:13:50 27.8 24.0 31.7 24.5 7.99 7.04
2:45:55 4:12:10 27.5 24.1 31.6 24.7 7.99 7.02
"""
"""Table 1 of the characterisation document: times of discharge and charge, highest and lowest temperature of charge and
of discharge in degC, energies of charge and discharge in Wh."""

VERDICTS = {
    "EPS-BAT-001": "PASS",
    "EPS-BAT-002": "PASS",
    "EPS-BAT-003": "RECORDED",
    "EPS-BAT-004": "RECORDED",
    "EPS-BAT-005": "RECORDED",
    "EPS-BAT-006": "RECORDED",
    "EPS-BAT-007": "RECORDED",
    "EPS-BAT-008": "RECORDED",
    "EPS-BAT-009": "INCONCLUSIVE",
    "EPS-BAT-010": "PASS",
}
SHORT = {"iterations": "1", "rest": "60", "relaxation": "60"}
ARTIFACT = "data/attachments/test_charge-iterations.csv"


def found(ran):
    """Return the verdict of every requirement of a run."""
    (case,) = results_as_json(ran.package)["cases"]
    return dict(case["requirements"])


def hours(text):
    """Return h:mm:ss in hours."""
    h, m, s = (int(part) for part in text.split(":"))
    return h + m / 60 + s / 3600


def short_run(root, changes=None, **overrides):
    """Run one cycle of the plan with short rests, and return how it ended."""
    workspace = battery_workspace(root / "workspace", "battery_charge", changes)
    return workspace.run(overrides={**SHORT, **overrides})


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    """Run the plan as it is committed."""
    return battery_workspace(tmp_path_factory.mktemp("charge") / "workspace", "battery_charge").run()


@pytest.fixture(scope="module")
def table(healthy):
    """Return the table of iterations: for each its numbers, in the order of the published table."""
    rows = list(csv.reader(healthy.package.text(ARTIFACT).splitlines()))[1:]
    return [[float(text) for text in row[1:9]] for row in rows]


def test_the_published_table_comes_out(table):
    """Times are within 3 %, energies within 1 %, temperatures within 1.5 K of Table 1, in each of ten cycles."""
    assert len(table) == 10
    for ours, line in zip(table, PUBLISHED.splitlines(), strict=True):
        texts = line.split()
        assert ours[:2] == pytest.approx([hours(text) for text in texts[:2]], rel=0.03)
        assert ours[2:6] == pytest.approx([float(text) for text in texts[2:6]], abs=1.5)
        assert ours[6:] == pytest.approx([float(text) for text in texts[6:]], rel=0.01)


def test_what_the_run_concludes(healthy):
    """Everything is recorded and met but the declaration: more than 115 % of it is a doubt, not good news."""
    assert healthy.code == 1
    assert found(healthy) == VERDICTS
    declared = [event for event in bodies(healthy.package, "check") if event["requirement"] == "EPS-BAT-009"]
    assert [event["parameter"] for event in declared] == ["discharge_capacity", "discharge_energy"]
    for event in declared:
        assert "capacity_ratio: 1.42, expected 0.8 to 1.15" in event["reason"]
        assert "energy_ratio: 1.366" in event["reason"]


def test_the_first_page_shows_where_the_cell_takes_its_charge(healthy):
    """dQ/dV of the first and the last cycle: the charge lies higher than the discharge, by the cell's resistance."""
    (shown,) = [each for each in bodies(healthy.package, "chart") if each["title"] == "Incremental capacity"]
    assert [each["name"] for each in shown["curves"]] == [
        f"{kind}, cycle {number}" for number in (1, 10) for kind in ("charge", "discharge")
    ]
    tops = [max(zip(each["y"], each["x"], strict=True))[1] for each in shown["curves"]]
    assert min(tops[0::2]) > max(tops[1::2]) + 0.1
    assert "Incremental capacity" in healthy.page()


def test_the_whole_test_is_recorded(healthy):
    """One recording holds every line of the cycler from first charge to last discharge, and fed every limit on it."""
    (facts,) = [event for event in bodies(healthy.package, "recording") if event["name"] == "test"]
    fed = {event["limit"] for event in bodies(healthy.package, "fed") if event["recording"] == facts["recording"]}
    gates = [event["name"].split() for event in bodies(healthy.package, "gate")]
    watched = {name[1] for name in gates if name[0] == "envelope"}
    assert watched - fed == {"plate-temperature", "cell-against-charger"}
    assert fed >= {"cell-voltage", "charged", "discharged-energy", "charging-time", "cell-warming", "thermistor-stuck"}
    steps = [event for event in bodies(healthy.package, "step") if event["path"][-1].startswith("Cycle ")]
    assert [event["path"][-1] for event in steps] == [f"Cycle {n} of 10" for n in range(1, 11)]


def test_the_package_is_whole_and_replays(healthy):
    """The package is verified, and its checks come out of its bytes again."""
    assert verify(healthy.package.folder).ok
    replayed = replay(healthy.package)
    assert (replayed.cases, replayed.differences) == (1, ())


def test_two_runs_have_one_content(tmp_path):
    """The same plan on the same bench gives the same content digest and table."""
    first, second = (short_run(tmp_path / name) for name in "ab")
    assert first.package.text(ARTIFACT) == second.package.text(ARTIFACT)
    assert first.package.content_digest == second.package.content_digest


def test_a_cell_of_its_label_meets_it(tmp_path):
    """With a cell of 1.5 Ah the declaration is met without a doubt: the doubt is the cell's, not the plan's."""
    ran = short_run(tmp_path, {"truth: {place: container}": 'truth: {place: container, capacity: "1.5"}'})
    assert found(ran)["EPS-BAT-009"] == "PASS"


def test_a_cell_below_its_label_fails(tmp_path):
    """With a cell of 1.3 Ah capacity and energy are too low."""
    ran = short_run(tmp_path, {"truth: {place: container}": 'truth: {place: container, capacity: "1.3"}'})
    assert found(ran)["EPS-BAT-009"] == "FAIL"


def test_nothing_declared_is_no_pass(tmp_path):
    """A gate that lacks a number is unknown: a plan that declares zero is INCONCLUSIVE, for that reason."""
    workspace = battery_workspace(tmp_path / "workspace", "battery_charge")
    bounded = {'value: "1.4", unit: Ah, min: "0.05"': 'value: "0", unit: Ah, min: "0"'}
    workspace.change("testplans/battery_charge/parameters.yaml", bounded)
    workspace.change(
        "testplans/battery_charge/parameters.yaml",
        {'value: "5.16", unit: Wh, min: "0.2"': 'value: "0", unit: Wh, min: "0"'},
    )
    ran = workspace.run(overrides=SHORT)
    assert found(ran)["EPS-BAT-009"] == "INCONCLUSIVE"
    for event in bodies(ran.package, "check"):
        if event["requirement"] == "EPS-BAT-009":
            assert "capacity_ratio: not judged" in event["reason"]
            assert "energy_ratio: not judged" in event["reason"]


def test_without_a_rest_there_is_no_rest_voltage(tmp_path):
    """The reason is that there was no rest, and which parameter says so."""
    ran = short_run(tmp_path, rest="0")
    (event,) = [event for event in bodies(ran.package, "check") if event["parameter"] == "rest_voltage_charged"]
    assert event["verdict"] == "INCONCLUSIVE"
    assert event["reason"] == "there was no rest after this half-cycle: the parameter 'rest' is 0 s"


def test_a_test_that_the_tester_ends_is_an_error(tmp_path):
    """A charge that takes longer than it may is ended by the tester: an ERROR at once, and the bench is safe."""
    ran = short_run(tmp_path, longest_half_cycle="3600")
    assert "ended its test by itself, it says 'tripped TIME'" in ran.reasons("test_charge")
    (fault,) = bodies(ran.package, "fault")
    assert "than the parameter longest_half_cycle, the cycler's setting 'time', allows" in fault["hint"]
    assert "fuse" not in fault["hint"]
    assert ran.verdicts() == {"test_charge": "ERROR"}
    assert "bench safe: every output proven" in ran.out


def test_lines_that_are_lost_show(tmp_path):
    """Lost lines are counted, and leave a gap that no recording of the whole test may have."""
    place = "      truth: {clock_drift:"
    fault = "      faults: [{kind: lost-lines, lines: '4', from: 7300 s}]"
    ran = short_run(tmp_path, {place: f"{fault}\n{place}"})
    assert found(ran)["EPS-BAT-010"] == "FAIL"
    gaps = [event for event in bodies(ran.package, "check") if event["parameter"] == "max_gap"]
    assert [(event["verdict"], event["value"] > 10) for event in gaps] == [("FAIL", True)] * 3


def test_one_row_that_stands_out_is_held_against_its_own_cycle(tmp_path):
    """A spike in one line of the first charge: its cycle is in doubt, the second has its verdicts and numbers."""
    place = "      truth: {clock_drift:"
    fault = "      faults: [{kind: spike, from: 3000 s, until: 3005 s}]"
    ran = short_run(tmp_path, {place: f"{fault}\n{place}"}, iterations="2")
    of = {(event["parameter"], event["of"]): event for event in bodies(ran.package, "check")}
    for parameter, good in (("end_of_discharge_voltage", "PASS"), ("charge_energy", "RECORDED")):
        first, second = of[parameter, "1"], of[parameter, "2"]
        assert (first["verdict"], second["verdict"]) == ("INCONCLUSIVE", good)
        assert first["reason"].startswith("stray_rows: 1 row stands out")
        assert "doubts" not in second


def test_a_cell_that_is_too_empty_is_not_charged(tmp_path):
    """A cell below 2.5 V is a fault of what was connected: the tester refuses it when the bench is armed."""
    ran = short_run(
        tmp_path,
        {
            "voltage_noise": 'voltage_offset: "-0.6", voltage_noise',
            'min: "2.5", max: "4.25"': 'min: "2.2", max: "4.25"',
        },
    )
    assert ran.verdicts() == {"test_charge": "NOT_RUN"}
    assert "what it measures is beyond VMIN already" in ran.reasons("test_charge")
