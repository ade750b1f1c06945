import pytest
import specimen_run
from typed_events import events_of

from hil.evidence.events import Step
from hil.evidence.package.contents import Package
from hil.report.material import Material, demands, requirement_entries
from hil.report.procedure import _asked, procedure_lines

DRIVE = {"case": "a", "step": "1", "name": "supply.coil.set", "effect": "drives", "result": None}


def planned(*events):
    """Return a run with one case that did this in one step."""
    where = {"case": "a", "path": ["Sweep"], "number": "1"}
    end = {"case": "a", "attempt": 1, "duration": 5.0, "verdict": "PASS", "reasons": []}
    return [
        {"kind": "planned", "t": 0.0, "cases": [{"case": "a", "title": "", "requirements": ["A-1"]}]},
        {"kind": "case", "t": 0.0, "case": "a", "attempt": 1},
        {"kind": "step", "t": 1.0, **where},
        *events,
        {"kind": "step-end", "t": 5.0, **where, "outcome": "done", "duration": 4.0},
        {"kind": "case-end", "t": 5.0, **end},
    ]


def drive(ordinal, **arguments):
    """Return one driving effect."""
    return {"kind": "effect", "t": 2.0, **DRIVE, "ordinal": ordinal, "arguments": arguments}


def test_specimen_as_a_procedure(folder):
    """Cases, numbered steps with bench times, drives, recordings with duration, and questions, in order."""
    lines = procedure_lines(Package(folder).events, requirement_entries(Material(Package(folder))))
    assert lines[0] == "Procedure of gyroscope on bench flatsat (simulated): 5 cases, 13 min 20 s of bench time"
    place = lines.index(f"[1/5] {specimen_run.CASES['rest']}")
    assert lines[place + 1 : place + 10] == [
        "    Allan deviation of every axis over ten minutes at rest.",
        "    requirements  ADCS-GYR-010, ADCS-GYR-011",
        "    duration      10 min 58 s, at most 1 h",
        "    1  0:00:03.0  Hold the board at ambient temperature  (57 s)",
        "        asks     confirm: Is the board free of the table's clamps?",
        "        drives   supply.board.configure(current=0.1, voltage=5)",
        "        drives   supply.board.on()",
        "    2  0:01:00.0  Record the gyroscope at rest  (10 min)",
        "        records  rest: x [deg/s], y [deg/s], z [deg/s], temperature [degC], 10 Hz, 10 min",
    ]
    assert "      1.1  0:11:03.0  50 deg/s  (57 s)" in lines
    assert "          drives   rotation_table.turn(rate=50)" in lines
    assert "    duration      not run: skipped: the chamber is away (--skip), at most 1 h" in lines
    assert "    requirements  none (orphan)" in lines


def test_limits_and_what_is_driven_stand_first(folder):
    """Before the cases: the roles that are driven, the deviations, and what each requirement asks for."""
    lines = procedure_lines(Package(folder).events, requirement_entries(Material(Package(folder))))
    first = lines[: lines.index(f"[1/5] {specimen_run.CASES['rest']}")]
    assert "drives      rotation_table, supply.board" in first
    assert "deviation   parameter gyroscope.rest_duration is 600 s, the plan says 14400 s" in first
    place = first.index("ADCS-GYR-030  rate_error [x, y, z] -0.5 to 0.5 deg/s, guarded, TUR at least 2")
    assert first[place + 1] == "              for each temperature of 10, 45"
    assert "          checks   ADCS-GYR-030 rate_error [x]  (-0.5 to 0.5 deg/s, guarded)" in lines


def test_steps_are_numbered_as_in_the_run(folder):
    """A step has the number under which the journal, the terminal and the report know it."""
    events = Package(folder).events
    lines = [line.strip() for line in procedure_lines(events, {})]
    for step in Package(folder).of(Step):
        assert any(line.startswith(f"{step.number}  ") and step.path[-1] in line for line in lines)


def test_reads_drive_nothing():
    """A read or a wait is not what a procedure drives."""
    read = drive(1) | {"effect": "reads", "name": "supply.coil.measure"}
    assert not any("measure" in line for line in procedure_lines(events_of(planned(read)), {}))


def test_calls_alike_are_counted():
    """A step that drives the same output a thousand times stays readable."""
    lines = procedure_lines(events_of(planned(*(drive(place, voltage=place / 10) for place in range(1, 1001)))), {})
    driven = [line.strip() for line in lines if line.startswith(" ") and "drives" in line]
    assert driven == [
        "drives   supply.coil.set(voltage=0.1)",
        "drives   supply.coil.set(voltage=0.2)",
        "drives   supply.coil.set(voltage=0.3)",
        "drives   supply.coil.set 997 more times",
    ]


def test_arguments_are_written_as_a_person_would():
    """Figures have their unit, lists their brackets, and what is left out is none."""
    figure = {"value": 1.5, "unit": "V", "uncertainty": None, "dof": None, "status": "measured"}
    lines = procedure_lines(
        events_of(planned(drive(1, voltage=figure, channels=[1, 2], mode=None, how={"fast": True}))), {}
    )
    assert "drives   supply.coil.set(voltage=1.5 V, channels=[1, 2], mode=none, how={fast=true})" in {
        line.strip() for line in lines
    }


def test_a_case_that_would_not_come_out_well_is_told():
    """What the simulated bench makes of a case other than PASS stands at its top, and is counted before."""
    events = planned()
    assert not any("verdict" in line or "not passed" in line for line in procedure_lines(events_of(events), {}))
    events[-1] |= {"verdict": "FAIL", "reasons": ["A-1 u is FAIL: too high"]}
    lines = procedure_lines(events_of([{"kind": "run", "t": 0.0, "source": "simulated"}, *events]), {})
    assert "not passed  1 case, on the simulated bench" in lines
    assert "    verdict       FAIL; A-1 u is FAIL: too high" in lines


def test_what_is_done_outside_steps_has_a_heading():
    """Fixtures that set up, and checks after the last step, do not look like part of a step."""
    check = {"kind": "check", "t": 5.0, "case": "a", "requirement": "A-1", "parameter": "u", "limit": {"max": "1"}}
    events = planned()
    lines = procedure_lines(events_of([*events[:-1], check, events[-1]]), {})
    place = lines.index("    -  0:00:05.0  Outside any step")
    assert lines[place + 1].startswith("        checks   A-1 u  (≤ 1")


def test_every_limit_names_its_decision_rule():
    """The rule that is meant where the catalogue names none is written out; words are compared simply."""
    entry = {"limits": [{"parameter": "u", "unit": "V", "max": "1"}, {"parameter": "winding", "equals": "right"}]}
    assert demands(entry) == ("u ≤ 1 V, guarded", "winding = right, simple")


@pytest.mark.parametrize(
    ("of", "told"),
    [(["1", "2", "3"], "1 to 3"), (["8", "9", "10"], "8 to 10"), (["1", "2", "4"], "1, 2, 4"), (["x", "y"], "x, y")],
)
def test_cycles_that_count_up_are_told_as_a_range(of, told):
    """Ten cycles are not ten numbers in every line of a requirement."""
    assert demands({"limits": [{"parameter": "u", "of": of}]}) == (f"u [{told}] recorded, without a limit",)


def test_nothing_planned_is_said():
    """A journal that ended before its plan is a procedure of nothing."""
    assert procedure_lines([], {}) == ["Procedure of no plan: 0 cases, 0 s of bench time"]


def test_a_procedure_names_what_no_case_verifies():
    """Whoever reviews a procedure learns which requirements it leaves out."""
    entries = {
        "A-010": {"id": "A-010", "method": "test"},
        "A-020": {"id": "A-020", "method": "review"},
        "A-030": {"id": "A-030", "method": "test", "withdrawn": "true"},
    }
    lines = procedure_lines(events_of(planned(drive(1))), entries)
    assert "no case        A-010" in lines
    assert "other methods  A-020 (review), A-030 (withdrawn)" in lines


def test_requirements_of_one_line_stand_close():
    """An empty line is before the first, and around one of several lines, so that a list of short ones is short."""
    one, two = ["A  x ≥ 1, simple"], ["B  x ≥ 1, simple", "   y ≥ 1, simple"]
    assert list(_asked([one, one, two, one])) == ["", *one, *one, "", *two, "", *one]
    assert list(_asked([])) == []
