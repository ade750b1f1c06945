import specimen_run

from hil.evidence.package.contents import Package
from hil.report.procedure import procedure_lines

DRIVE = {"case": "a", "step": "1", "name": "supply.coil.set", "effect": "drives", "result": None}


def planned(*events):
    """Return a run with one case that did this in one step."""
    where = {"case": "a", "path": ["Sweep"], "number": "1"}
    end = {"case": "a", "attempt": 1, "duration": 5.0}
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
    lines = procedure_lines(Package(folder).events())
    assert lines[0] == "Procedure of gyroscope on bench flatsat (simulated): 5 cases, 13 min 20 s of bench time"
    assert lines[2:12] == [
        f"1  {specimen_run.CASES['rest']}",
        "    Allan deviation of every axis over ten minutes at rest.",
        "    requirements  ADCS-GYR-010, ADCS-GYR-011",
        "    duration      10 min 58 s, at most 1 h",
        "    1.1  0:00:03.0  Hold the board at ambient temperature  (57 s)",
        "        asks     confirm: Is the board free of the table's clamps?",
        "        drives   supply.board.configure(current=0.1, voltage=5)",
        "        drives   supply.board.on()",
        "    1.2  0:01:00.0  Record the gyroscope at rest  (10 min)",
        "        records  rest: x [deg/s], y [deg/s], z [deg/s], temperature [degC], 10 Hz, 10 min",
    ]
    assert "      2.1.1  0:11:03.0  50 deg/s  (57 s)" in lines
    assert "          drives   rotation_table.turn(rate=50)" in lines
    assert "    duration      not run, at most 1 h" in lines
    assert "    requirements  none: an orphan" in lines


def test_reads_drive_nothing():
    """A read or a wait is not what a procedure drives."""
    read = drive(1) | {"effect": "reads", "name": "supply.coil.measure"}
    assert not any("measure" in line for line in procedure_lines(planned(read)))


def test_calls_alike_are_counted():
    """A step that drives the same output a thousand times stays readable."""
    lines = procedure_lines(planned(*(drive(place, voltage=place / 10) for place in range(1, 1001))))
    driven = [line.strip() for line in lines if "drives" in line]
    assert driven == [
        "drives   supply.coil.set(voltage=0.1)",
        "drives   supply.coil.set(voltage=0.2)",
        "drives   supply.coil.set(voltage=0.3)",
        "drives   supply.coil.set 997 more times",
    ]


def test_arguments_are_written_as_a_person_would():
    """Figures have their unit, lists their brackets, and what is left out is none."""
    figure = {"value": 1.5, "unit": "V", "uncertainty": None, "dof": None, "status": "measured"}
    lines = procedure_lines(planned(drive(1, voltage=figure, channels=[1, 2], mode=None, how={"fast": True})))
    assert "drives   supply.coil.set(voltage=1.5 V, channels=[1, 2], mode=none, how={fast=true})" in {
        line.strip() for line in lines
    }


def test_nothing_planned_is_said():
    """A journal that ended before its plan is a procedure of nothing."""
    assert procedure_lines([]) == ["Procedure of no plan: 0 cases, 0 s of bench time"]
