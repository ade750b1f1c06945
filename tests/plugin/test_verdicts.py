"""Whole runs in small workspaces: however a case ends, everything that is left of it says the same."""

from __future__ import annotations

import signal
import sys
from functools import cache
from pathlib import Path

import pytest
from told_as_json import bodies, results_as_json
from workspaces import agreed, make

from hil.evidence.package.verification import verify
from hil.executive.ending.signals import Alarm
from hil.executive.watching.ports import NoMachine

CHECK = '''
@pytest.mark.requirement("T-010")
def test_one(check):
    """The ratio is what it is."""
    check("T-010", "ratio", {value})
'''

LAST = """
@pytest.mark.requirement("T-010")
def test_last(check):
    check("T-010", "ratio", 1.0)
"""

CURRENT = """
@pytest.fixture
def current(supply):
    supply.coil.configure(5.0, 0.01)
    supply.coil.enable()
    return supply.coil
"""


def ran(tmp_path, *cases, **changes):
    """Run cases in a workspace of their own."""
    return make(tmp_path / "workspace", *cases).run(**changes)


@pytest.mark.parametrize(("value", "verdict"), [("1.0", "PASS"), ("2.0", "FAIL"), ("math.nan", "INCONCLUSIVE")])
def test_a_check_decides_its_case_and_its_run(tmp_path, value, verdict):
    """One check, one case, one run: all have the same verdict."""
    agreed(ran(tmp_path, CHECK.format(value=value)), {"test_one": verdict}, verdict, 0 if verdict == "PASS" else 1)


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-030")
    def test_one(field, record):
        record("field", field, duration=1.0, rate=40.0)
    """
)
def test_data_that_were_asked_for_are_recorded(judged):
    """A requirement that asks for data is RECORDED when they are there, long enough and without a gap."""
    judged.agrees(test_one="RECORDED")
    assert {check["parameter"] for check in judged.events("check")} == {
        "channels", "duration", "max_gap", "rate",
    }  # fmt: skip


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-030")
    def test_one(field, record):
        record("field", field, duration=0.5, rate=40.0)
    """
)
def test_data_that_are_too_short_fail(judged):
    """Half a second where a whole one is due fails, with both numbers in the reason."""
    judged.agrees(test_one="FAIL")
    assert "0.5 s is below the minimum of 1 s" in judged.reasons()


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-030")
    def test_one(field, record):
        record("fild", field, duration=1.0, rate=40.0)
    """
)
def test_data_of_another_name_are_no_data(judged):
    """A recording that nobody asked for does not stand in for the one that is due."""
    judged.agrees(test_one="NOT_EVALUATED")
    assert judged.reasons() == "T-030 got no whole recording 'field'"


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("pass", "T-020 got no check of rate of x, rate of y"),
        ('check("T-020", "rate", Figure(value=0.1, unit="deg/s"), of="x")', "T-020 got no check of rate of y"),
    ],
    ids=["no check", "one axis missing"],
)
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-020")
    def test_one(check):
        {body}
    """
)
def test_a_check_that_is_missing_is_no_pass(judged, body, reason):
    """What was not evaluated, wholly or for one axis, is NOT_EVALUATED and says what is missing."""
    judged.agrees(test_one="NOT_EVALUATED")
    assert judged.reasons() == reason


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("assert 1 > 2, 'the supply did not follow'", "AssertionError: the supply did not follow"),
        ("1 / 0", "ZeroDivisionError: division by zero"),
        ("pytest.fail('not like this')", "Failed: not like this"),
        ("raise SystemExit('gone')", "SystemExit: gone"),
        ('check("T-010", "ratio", Figure(value=1.0, unit="V"))', "'V' does not convert to '1'"),
        ('check("T-010", parameter="rati", value=1.0)', "T-010 has no parameter 'rati', did you mean 'ratio'?"),
    ],
    ids=["assert", "exception", "fail", "exit", "unit", "parameter"],
)
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check):
        check("T-010", "ratio", 1.0)
        {statement}
    """
)
def test_what_a_case_raises_is_an_error(judged, statement, reason):
    """An assertion or exception outside `check` is an ERROR, whatever was checked before; later cases still run."""
    judged.agrees(test_one="ERROR")
    assert reason in judged.reasons()


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        ('check("T-010", "ratio", None)', "T-010 ratio: expected a number in 1, found None (NoneType)"),
        ('check("T-010", "ratio", Figure(value=1.0, unit="V"))', "'V' does not convert to '1'"),
        ('check.require("T-010", "rat" + "i", 1.0)', "T-010 has no parameter 'rati'"),
        ("supply.coil.configure(7.0, 0.01)", "voltage 7 V is outside its clamp"),
        ("supply.coil.configure(True, 0.01)", "supply.coil.configure: voltage is a number, found True"),
    ],
    ids=["nothing", "unit", "parameter", "clamp", "flag"],
)
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check, supply):
        try:
            {call}
        except Exception:
            pass
        check("T-010", "ratio", 1.0)
    """
)
def test_what_was_refused_and_a_case_swallows_is_an_error(judged, call, reason):
    """What could not be done or checked counts, though the case goes on and makes its check; it is told once."""
    judged.agrees(test_one="ERROR")
    assert judged.reasons().count(reason) == 1


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check, step):
        with step("Read caf\\udce9.csv"):
            check("T-010", "ratio", 1.0)
    """
)
def test_a_step_whose_title_is_no_utf_8_is_a_step(judged):
    """A file's name in a title costs no run."""
    judged.agrees(test_one="PASS")
    assert [each["path"] for each in judged.events("step")] == [["Read caf\\udce9.csv"]]


@pytest.mark.parametrize(("statement", "verdict"), [("raise ValueError", "ERROR"), ("pytest.skip", "NOT_RUN")])
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check):
        {statement}("caf\\udce9.csv")
    """
)
def test_text_that_is_no_utf_8_ends_a_case_and_not_the_run(judged, statement, verdict):
    """Bytes that Python kept in a text, as those of a file's name, are written out in the reason."""
    judged.agrees(test_one=verdict)
    assert "caf\\udce9.csv" in judged.reasons()


@pytest.mark.parametrize(
    ("before", "after", "checks"), [("1 / 0", "pass", 0), ("pass", "1 / 0", 1)], ids=["before", "after"]
)
@pytest.mark.together(
    """
    @pytest.fixture
    def thing():
        {before}
        yield
        {after}

    @pytest.mark.requirement("T-010")
    def test_one(thing, check):
        check("T-010", "ratio", 1.0)
    """
)
def test_what_set_up_and_teardown_raise_is_an_error(judged, before, after, checks):
    """An exception in a fixture counts as much as one in the case, also after a case that passed."""
    judged.agrees(test_one="ERROR")
    assert judged.reasons().startswith("ZeroDivisionError")
    assert len(judged.events("check")) == checks


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010", "T-050")
    def test_one(check, supply):
        check.require("T-010", "ratio", 2.0)
        check("T-050", "voltage", supply.coil.voltage())
    """
)
def test_a_required_check_stops_its_case(judged):
    """`check.require` ends the case with the check's verdict, not with an ERROR."""
    judged.agrees(test_one="FAIL")
    assert "T-050 got no check of voltage" in judged.reasons()
    assert not judged.events("effect")


def test_a_bench_fault_that_a_case_swallows_is_an_error(tmp_path):
    """A case that goes on after silence of the bench is an ERROR, and the remaining cases are not run."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(supply, check, clock):
        clock.sleep(18)
        try:
            supply.sensor.voltage()
        except Exception:
            pass
        check("T-010", "ratio", 1.0)
    """
    workspace = make(tmp_path / "workspace", cases, LAST)
    workspace.give_faults("psu1", "{kind: late, by: 600 ms, from: 20 s, until: 24 s}")
    workspace.change_bench({"period: 1 s, max_age: 5 s": "period: 60 s, max_age: 300 s"})
    workspace.change_bench({"period: 2 s, max_age: 10 s": "period: 60 s, max_age: 300 s"})
    found = workspace.run()
    agreed(found, {"test_one": "ERROR", "test_last": "NOT_RUN"}, "ERROR", 1)
    (fault,) = bodies(found.package, "fault")
    assert (fault["device"], fault["dut"]) == ("psu1", False)
    assert found.reasons("test_last").startswith("bench fault: psu1")


def test_a_trip_that_a_case_swallows_is_an_error(tmp_path):
    """Whoever catches the trip is still in ERROR; the bench is safe, and nothing further runs."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(field, check, clock):
        for _ in range(20):
            try:
                clock.sleep(1.0)
            except Exception:
                pass
        check("T-010", "ratio", 1.0)
    """
    workspace = make(tmp_path / "workspace", cases, LAST)
    workspace.change_bench({'max: "3.5", period: 2 s': 'max: "3.0", period: 2 s'})
    found = workspace.run()
    agreed(found, {"test_one": "ERROR", "test_last": "NOT_RUN"}, "ERROR", 6)
    (trip,) = bodies(found.package, "trip")
    assert trip["limit"] == "sensor-voltage"
    assert "supply.sensor: voltage" in found.reasons("test_one")
    assert found.reasons("test_last").startswith("the envelope tripped: supply.sensor")
    assert all(end["ok"] for end in bodies(found.package, "safe-end"))


def test_a_dead_magnetometer_is_an_error(tmp_path):
    """Silence of the bench in a recording is an ERROR; what was recorded is kept as incomplete."""
    cases = """
    @pytest.mark.requirement("T-030")
    def test_one(field, record):
        record("field", field, duration=10.0, rate=40.0)
    """
    workspace = make(tmp_path / "workspace", cases, LAST)
    workspace.give_faults("mag1", "{kind: dead, from: 5 s}")
    found = workspace.run()
    agreed(found, {"test_one": "ERROR", "test_last": "NOT_RUN"}, "ERROR", 1)
    ends = {end["recording"]: end for end in bodies(found.package, "recording-end")}
    assert not ends["001-test_one-field"]["complete"]
    assert ends["001-test_one-field"]["rows"] > 0


@pytest.mark.system
def test_a_silent_device_under_test_fails_what_speaks_of_it(tmp_path):
    """Silence of the DUT is FAIL where a requirement is about its answers, and INCONCLUSIVE elsewhere."""
    cases = """
    @pytest.mark.requirement("T-040")
    def test_answers(field, record):
        record("field", field, duration=10.0, rate=40.0)

    @pytest.mark.requirement("T-040")
    def test_answers_swallowed(field, record):
        try:
            record("field", field, duration=10.0, rate=40.0)
        except Exception:
            pass

    @pytest.mark.requirement("T-030")
    def test_data(field, record):
        record("field", field, duration=10.0, rate=40.0)

    @pytest.mark.requirement("T-030")
    def test_data_swallowed(field, record):
        try:
            record("field", field, duration=10.0, rate=40.0)
        except Exception:
            pass
    """
    workspace = make(tmp_path / "workspace", cases, LAST)
    workspace.give_faults("mag1", "{kind: dead, from: 5 s}")
    workspace.change_bench({"    driver: lis3mdl": "    driver: lis3mdl\n    dut: true"})
    found = workspace.run()
    answers = dict.fromkeys(("test_answers", "test_answers_swallowed"), "FAIL")
    data = dict.fromkeys(("test_data", "test_data_swallowed"), "INCONCLUSIVE")
    agreed(found, {**answers, **data, "test_last": "PASS"}, "FAIL", 1)
    assert [fault["dut"] for fault in bodies(found.package, "fault")] == [True] * 4


@pytest.mark.parametrize(
    ("decorator", "statement", "reason"),
    [
        ("@pytest.mark.skip(reason='no jig')", "pass", "no jig"),
        ("", "pytest.skip('no jig')", "no jig"),
        ("", "pytest.xfail('known')", "known"),
        ("@pytest.mark.xfail(reason='known')", "1 / 0", "marked xfail"),
    ],
    ids=["mark", "skip", "xfail", "xfail mark"],
)
@pytest.mark.together(
    """
    {decorator}
    @pytest.mark.requirement("T-010")
    def test_one(check):
        check("T-010", "ratio", 1.0)
        {statement}
    """
)
def test_what_takes_itself_out_is_not_run(judged, decorator, statement, reason):
    """Skip and xfail are no verdicts: the case is NOT_RUN with its reason, and the run is no pass."""
    judged.agrees(test_one="NOT_RUN")
    assert reason in judged.reasons()


def test_a_case_that_the_command_line_skips_is_a_deviation(tmp_path):
    """A skipped case is NOT_RUN with the person's reason, and speaks against closing anything."""
    found = ran(tmp_path, CHECK.format(value="1.0"), LAST, skips={"test_one": "jig in repair"})
    agreed(found, {"test_one": "NOT_RUN", "test_last": "PASS"}, "NOT_RUN", 1)
    assert found.reasons("test_one") == "jig in repair"
    requirement = next(item for item in results_as_json(found.package)["requirements"] if item["cases"])
    assert "deviation: case test_one is skipped: jig in repair" in requirement["reasons"]
    assert "jig in repair" in found.out


def test_the_only_cases_that_are_run_are_a_deviation(tmp_path):
    """The others were planned and are NOT_RUN, nothing closes, and the results are also where a CI server looks."""
    junit = tmp_path / "results.xml"
    found = ran(tmp_path, CHECK.format(value="1.0"), LAST, only=("test_last",), junit=junit)
    agreed(found, {"test_one": "NOT_RUN", "test_last": "PASS"}, "NOT_RUN", 1)
    assert found.reasons("test_one") == "left out by --only"
    reasons = {reason for item in results_as_json(found.package)["requirements"] for reason in item["reasons"]}
    assert "deviation: only these cases are run: test_last" in reasons
    assert junit.read_bytes() == (found.package.folder / "data/report/junit.xml").read_bytes()


def test_an_orphan_is_listed_and_is_no_pass(tmp_path):
    """A case without a requirement is told, runs, and is NOT_EVALUATED."""
    found = ran(tmp_path, CHECK.format(value="1.0"), "def test_two():\n    pass")
    agreed(found, {"test_one": "PASS", "test_two": "NOT_EVALUATED"}, "NOT_EVALUATED", 1)
    (orphan,) = bodies(found.package, "orphan")
    assert orphan["cases"] == ["testplans/small/test_small.py::test_two"]
    assert "test_two carries no requirement" in found.out


def test_a_changed_parameter_is_a_deviation(tmp_path):
    """The value of the command line counts, is told, and keeps the run from closing anything."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(check, parameters):
        check("T-010", "ratio", parameters.current / 0.02)
    """
    found = ran(tmp_path, cases, overrides={"current": "0.02"})
    agreed(found, {"test_one": "PASS"}, "PASS", 0)
    assert "deviation: parameter current is 0.02 A instead of 0.01 A" in found.out
    assert not results_as_json(found.package)["requirements"][0]["eligible"]
    assert "DEVIATION" in found.page()


@pytest.mark.parametrize(
    ("statement", "seconds"),
    [
        ("clock.sleep(12)", 10),
        ("try:\n            clock.sleep(12)\n        except BaseException:\n            pass", 10),
        ("supply.sensor.voltage()", 0.001),
    ],
    ids=["in a wait", "swallowed", "in the last call"],
)
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration({seconds})
    def test_one(check, clock, supply):
        check("T-010", "ratio", 1.0)
        {statement}
    """
)
def test_a_case_that_takes_too_long_is_an_error(judged, statement, seconds):
    """Passing `max_duration` is an ERROR, whether a scheduling point sees it or the case's end only."""
    judged.agrees(test_one="ERROR")
    assert judged.reasons() == f"the case took longer than its {seconds:g} s of bench time"


@pytest.mark.together(
    """
    torn = []

    @pytest.fixture
    def before():
        yield
        torn.append("before")

    @pytest.fixture
    def late(before, clock):
        yield
        clock.sleep(12)

    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration(10)
    def test_one(late, check):
        check("T-010", "ratio", 1.0)

    @pytest.mark.requirement("T-010")
    def test_two(check):
        check("T-010", "ratio", len(torn))
    """
)
def test_a_teardown_that_takes_too_long_leaves_the_others_to_do_theirs(judged):
    """The other fixtures of the case are torn down, and the next case, here or in another module, begins as ever."""
    judged.agrees(test_one="ERROR", test_two="PASS")
    assert judged.reasons() == "the case took longer than its 10 s of bench time"


def test_an_alarm_ends_a_cases_own_code_and_nothing_else(tmp_path, monkeypatch):
    """Wherever it rings between the end of a case's time and the end of the case, pytest's own code is not cut in two.

    An exception there would pass hooks that have nothing to catch it with, and end the run.
    """
    alarms, raised, heard = [], [], []

    def keep(alarm, attendant):
        alarm._attendant = attendant
        alarms.append(alarm)

    monkeypatch.setattr(Alarm, "keep", keep)

    def ring(frame, event, _):
        if event != "call":
            return
        heard.append(frame.f_globals["__name__"])
        try:
            alarms[0]._ring(signal.SIGALRM, frame)
        except BaseException as error:  # noqa: BLE001 - it is not to pass
            raised.append((Path(frame.f_code.co_filename).name, type(error).__name__))

    cases = """
    import sys

    @pytest.fixture
    def late():
        yield
        (lambda: None)()
        sys.setprofile(None)

    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration(0.001)
    def test_one(late, check, supply):
        check("T-010", "ratio", 1.0)
        supply.sensor.voltage()
        sys.ring_at_each_call()
        (lambda: None)()
    """
    monkeypatch.setattr(sys, "ring_at_each_call", lambda: sys.setprofile(ring), raising=False)
    found = ran(tmp_path, cases, LAST)
    agreed(found, {"test_one": "ERROR", "test_last": "PASS"}, "ERROR", 1)
    assert {"contextlib", "_pytest.runner", "pluggy._manager", "hil.plugin.campaign"} < set(heard)
    assert set(raised) == {("test_small.py", "CaseTimeout")}


def test_what_only_the_guardian_does_not_find_safe_is_unsafe(tmp_path, monkeypatch):
    """It is asked after the last line of the safe-off is proven: the package must not say that the bench was safe."""
    monkeypatch.setattr(NoMachine, "end", lambda *_, **__: ["supply.coil: its port is gone"])
    found = make(tmp_path / "workspace", LAST).run()
    agreed(found, {"test_last": "PASS"}, "ERROR", 7)
    assert results_as_json(found.package)["safe"] is False
    assert "THE BENCH COULD NOT BE PROVEN SAFE: supply.coil: its port is gone" in found.out
    assert "NOT SAFE: at least one output could not be proven safe." in found.out
    assert verify(found.package.folder).findings == ()


def test_a_supply_that_refuses_to_switch_off_is_unsafe(tmp_path):
    """An output that cannot be proven safe has its own exit code, and the run is an ERROR."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(current, check, clock):
        clock.sleep(10)
        check("T-010", "ratio", 1.0)
    """
    workspace = make(tmp_path / "workspace", CURRENT, cases, LAST)
    workspace.give_faults("psu1", "{kind: refuse-off, from: 8 s}")
    found = workspace.run()
    agreed(found, {"test_one": "PASS", "test_last": "NOT_RUN"}, "ERROR", 7)
    assert results_as_json(found.package)["safe"] is False
    assert "NOT SAFE" in found.page()
    assert "THE BENCH COULD NOT BE PROVEN SAFE" in found.out


def test_a_wrong_identity_is_not_armed_and_not_touched(tmp_path):
    """Another instrument than the bench file's is not driven at all, not even to its safe state."""
    workspace = make(tmp_path / "workspace", CHECK.format(value="1.0"), LAST)
    workspace.give_faults("psu1", '{kind: identity, value: "ACME,E36312A,MY1,1.0"}')
    found = workspace.run()
    agreed(found, {"test_one": "NOT_RUN", "test_last": "NOT_RUN"}, "NOT_RUN", 1)
    assert "expected manufacturer" in found.reasons("test_one")
    assert not bodies(found.package, "armed", "case", "safe", "safe-end")
    assert not any("OUTP" in bytes.fromhex(line.split("\t")[5]).decode("latin-1") for line in _writes(found))


def _writes(found):
    lines = found.package.transcript_path.read_text().splitlines()[1:]
    return [line for line in lines if line.split("\t")[1:3] == ["psu1", "write"]]


@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(iterations, step):
        turns = iterations("Turn", 3)
        for turn in turns:
            with step("Within"):
                if turn == 2:
                    raise ValueError("here")
    """
)
def test_a_loop_that_a_case_is_thrown_out_of_ends_its_steps(judged):
    """An exception in an iteration ends the iteration's step before the case ends, whoever holds the loop."""
    judged.agrees(test_one="ERROR")
    kinds = [event["kind"] for event in judged.events("step", "step-end", "case-end")]
    assert kinds == ["step", "step", "step-end", "step-end"] * 2 + ["case-end"]
    outcomes = [event["outcome"] for event in judged.events("step-end")]
    assert outcomes == ["done", "done", "raised", "raised"]


@pytest.mark.parametrize("remaining", [(), (LAST,)], ids=["last case", "case before"])
def test_a_stop_that_no_scheduling_point_saw_is_no_pass(tmp_path, remaining):
    """A case that comes to its end all the same keeps its verdict; the run is ABORTED, and nothing more begins."""
    cases = """
    import signal

    @pytest.mark.requirement("T-010")
    def test_one(check):
        check("T-010", "ratio", 1.0)
        signal.raise_signal(signal.SIGINT)
    """
    found = ran(tmp_path, cases, *remaining)
    agreed(found, {"test_one": "PASS", **({"test_last": "NOT_RUN"} if remaining else {})}, "ABORTED", 2)
    assert [stop["reason"] for stop in bodies(found.package, "stop")] == ["SIGINT"]
    if remaining:
        assert found.reasons("test_last") == "stopped by SIGINT"


FAILED = "T-010 ratio is FAIL: 2 is above the maximum of 1.5"


@pytest.mark.parametrize(
    ("statement", "verdict"),
    [
        ("pytest.skip('enough')", "FAIL"),
        ("pytest.xfail('known')", "FAIL"),
        ("request.node.add_marker(pytest.mark.xfail(reason='known', raises=ValueError))", "FAIL"),
        ("request.node.add_marker(pytest.mark.xfail(reason='known'))\n        raise ValueError('x')", "ERROR"),
    ],
    ids=["skip", "xfail", "xfail mark", "xfail mark that raises"],
)
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check, request):
        check("T-010", "ratio", 2.0)
        {statement}
    """
)
def test_a_failure_stands_however_the_case_leaves(judged, statement, verdict):
    """Whoever fails and then takes himself out has failed; the reasons tell both."""
    judged.agrees(test_one=verdict)
    assert FAILED in judged.reasons()


def test_a_failure_stands_in_a_case_that_ends_pytest(tmp_path):
    """A case that fails and calls `pytest.exit` is an ERROR, whatever exit code it asks for, and the run is sealed."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(check):
        check("T-010", "ratio", 2.0)
        pytest.exit('bye', returncode=0)
    """
    found = ran(tmp_path, cases)
    agreed(found, {"test_one": "ERROR"}, "ERROR", 1)
    assert FAILED in found.reasons("test_one")


@pytest.mark.parametrize(
    ("within", "after"),
    [("pytest.skip('enough')", "pass"), ("pass", "pytest.skip('enough')")],
    ids=["within", "after"],
)
@pytest.mark.together(
    """
    @pytest.fixture
    def late():
        yield
        {after}

    @pytest.mark.requirement("T-030")
    def test_one(late, field, record):
        record("field", field, duration=0.5, rate=40.0)
        {within}
    """
)
def test_a_failure_of_data_stands_in_a_case_that_skips(judged, within, after):
    """What a recording has to be is looked at, too, and a fixture that skips afterwards changes nothing."""
    judged.agrees(test_one="FAIL")


def test_a_hook_that_hides_an_exception_hides_nothing_from_the_run(tmp_path):
    """A case is judged by what came out of its code, not by what pytest is told of it."""
    cases = """
    class Liar:
        @pytest.hookimpl(wrapper=True, tryfirst=True)
        def pytest_runtest_makereport(self, item, call):
            call.excinfo = None
            return (yield)

    @pytest.mark.requirement("T-010")
    def test_one(check, request):
        request.config.pluginmanager.register(Liar())
        check("T-010", "ratio", 1.0)
        raise ValueError("hidden")
    """
    found = ran(tmp_path, cases)
    agreed(found, {"test_one": "ERROR"}, "ERROR", 1)
    assert found.reasons("test_one").startswith("ValueError: hidden (testplans/small/test_small.py:")
    assert "\n" not in found.reasons("test_one")


@pytest.mark.system
@pytest.mark.parametrize("until", ["until: 1000 s", "until: 6 s"], ids=["all", "some"])
def test_data_that_are_no_numbers_are_inconclusive(tmp_path, until):
    """A recording of NaN is there, and shows nothing: the requirement is not RECORDED."""
    cases = """
    @pytest.mark.requirement("T-030")
    def test_one(field, record, clock):
        record("field", field, duration=5.0, rate=40.0)
    """
    workspace = make(tmp_path / "workspace", cases)
    workspace.give_faults("mag1", f"{{kind: saturated, from: 4 s, {until}}}")
    found = workspace.run()
    agreed(found, {"test_one": "INCONCLUSIVE"}, "INCONCLUSIVE", 1)
    (check,) = [check for check in bodies(found.package, "check") if check["parameter"] == "not_finite"]
    assert check["reason"] in found.reasons("test_one")
    assert check["reason"].startswith(f"{check['value']:.0f} of 600 samples are not finite: x ")


@pytest.mark.together(
    """
    class Made:
        def sample(self):
            return (1.0, 1.0, 1.0)

    @pytest.mark.requirement("T-030")
    def test_one(record):
        record("field", Made(), duration=1.0, rate=40.0)
    """
)
def test_only_roles_of_the_case_make_data(judged):
    """An object that gives numbers is no instrument: the case is an ERROR, and nothing is recorded."""
    judged.agrees(test_one="ERROR")
    assert "only roles of this case can be recorded, this is a Made" in judged.reasons()


@pytest.mark.parametrize(
    ("value", "verdict"),
    [
        ("np.float32(1.1)", "PASS"),
        ("Figure(value=np.float32(1.1), unit='1', uncertainty=np.float32(0.1), dof=np.int64(9))", "PASS"),
        ("np.bool_(True)", "ERROR"),
        ("'1.0'", "ERROR"),
        ("np.ones(3)", "ERROR"),
        ("Figure(value=np.bool_(True), unit='1')", "ERROR"),
    ],
)
@pytest.mark.together(
    """
    import numpy as np

    @pytest.mark.requirement("T-010")
    def test_one(check):
        check("T-010", "ratio", {value})
    """
)
def test_a_figure_is_a_plain_number(judged, value, verdict):
    """NumPy's numbers are numbers and the package verifies; flags, texts and arrays are an ERROR."""
    judged.agrees(test_one=verdict)
    assert findings_of(judged.ran.package.folder) == ()


@cache
def findings_of(folder):
    """Verify a package that several tests ask about once."""
    return verify(folder).findings


@pytest.mark.parametrize("values", [(1.0, 2.0), (2.0, 1.0)])
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check):
        for value in {values}:
            check("T-010", "ratio", value)
    """
)
def test_a_criterion_that_is_evaluated_again_counts_at_its_worst(judged, values):
    """Both checks are in the evidence, in whatever order; a later one replaces none."""
    judged.agrees(test_one="FAIL")
    assert [check["value"] for check in judged.events("check")] == list(values)


@pytest.mark.parametrize("statement", ["parameters.current = 1.0", "setattr(parameters, '_parameters', {})"])
@pytest.mark.together(
    """
    @pytest.mark.requirement("T-010")
    def test_one(check, parameters):
        check("T-010", "ratio", 1.0)
        {statement}

    @pytest.mark.requirement("T-010")
    def test_two(check, parameters):
        check("T-010", "ratio", parameters.current * 100)
    """
)
def test_parameters_cannot_be_changed(judged, statement):
    """A case that would change the plan's parameters is an ERROR; the command line is the way, and a deviation."""
    judged.agrees(test_one="ERROR", test_two="PASS")
    assert "cannot be changed by a case; see hil run --parameter" in judged.reasons()


def test_a_parameter_is_asked_for_in_a_unit(tmp_path):
    """Ten centimetres are never silently ten, and a changed one may name another unit."""
    cases = """
    @pytest.mark.requirement("T-010")
    def test_one(check, parameters):
        check("T-010", "ratio", parameters.in_unit("length", "m") * 10)
    """
    parameters = 'schema: hil/parameters/1\nparameters:\n- {name: length, value: "10", unit: cm}\n'
    workspace = make(tmp_path / "workspace", cases, parameters=parameters)
    agreed(workspace.run(), {"test_one": "PASS"}, "PASS", 0)
    changed = workspace.run(overrides={"length": "0.2 m"})
    assert changed.verdicts() == {"test_one": "FAIL"}
    assert "deviation: parameter length is 20 cm instead of 10 cm" in changed.out


PARAMETRISED = """
@pytest.mark.requirement("T-010")
@pytest.mark.parametrize("name", ["a", "b[1]::c"])
def test_each(name, check):
    check("T-010", "ratio", 1.0)
"""


@pytest.mark.system
def test_a_name_without_parameters_skips_all_of_them(tmp_path):
    """Each case of the function is NOT_RUN with the reason; one that is named has its own."""
    workspace = make(tmp_path / "workspace", PARAMETRISED, LAST)
    found = workspace.run(skips={"test_each": "no jig"})
    assert sorted(results_as_json(found.package)["counts"].items()) == [("NOT_RUN", 2), ("PASS", 1)]
    assert found.code == 1
    assert found.out.count("no jig") >= 2
    reasons = {end["case"]: end["reason"] for end in bodies(found.package, "not-run")}
    assert set(reasons.values()) == {"no jig"}
    again = workspace.run(skips={"test_each[b[1]::c]": "broken", "test_each": "no jig"})
    reasons = {end["case"]: end["reason"] for end in bodies(again.package, "not-run")}
    place = "testplans/small/test_small.py::test_each"
    assert reasons == {f"{place}[a]": "no jig", f"{place}[b[1]::c]": "broken"}


@pytest.mark.together(
    """
    import threading

    def fail():
        raise AssertionError("too warm")

    @pytest.mark.requirement("T-010")
    def test_one(check):
        thread = threading.Thread(target=fail)
        thread.start()
        thread.join()
        check("T-010", "ratio", 1.0)

    @pytest.mark.requirement("T-010")
    def test_last(check):
        check("T-010", "ratio", 1.0)
    """
)
def test_what_ends_a_thread_is_an_error(judged):
    """An assertion that fails in a thread of the case is no less one."""
    judged.agrees(test_one="ERROR", test_last="PASS")
    assert "too warm" in judged.reasons()


@pytest.mark.parametrize(
    "use",
    [
        "KEPT[0].coil.enable()",
        "KEPT[1]('T-010', 'ratio', 1.0)",
        "KEPT[2]('field', KEPT[3], duration=1.0, rate=40.0)",
    ],
)
@pytest.mark.together(
    """
    KEPT = []

    @pytest.mark.requirement("T-010")
    def test_one(supply, check, record, field):
        KEPT.extend((supply, check, record, field))
        check("T-010", "ratio", 1.0)

    @pytest.mark.requirement("T-010")
    def test_two(check):
        check("T-010", "ratio", 1.0)
        try:
            {use}
        except Exception:
            pass
    """
)
def test_a_case_does_not_live_on_what_belongs_to_another(judged, use):
    """A role, check or record kept from a case before is turned away: it would leave no trace in this one."""
    judged.agrees(test_one="PASS", test_two="ERROR")
    assert "what belongs to a case that has ended is used in another case" in judged.reasons("test_two")


@pytest.mark.parametrize(("value", "verdict", "code"), [("1.0", "PASS", 0), ("9.0", "FAIL", 1)])
def test_a_check_in_a_teardown_counts(tmp_path, value, verdict, code):
    """The verdict is that of the case's very end, and so is the exit code."""
    cases = f"""
    @pytest.fixture
    def later(check):
        yield
        check("T-010", "ratio", {value})

    @pytest.mark.requirement("T-010")
    def test_one(later):
        pass
    """
    agreed(ran(tmp_path, cases), {"test_one": verdict}, verdict, code)


def test_a_strict_run_fails_for_requirements_that_it_leaves_uncovered(tmp_path):
    """Every case passed, and the plan asks for more than they show; the last lines say so, strict or not."""
    workspace = make(tmp_path / "workspace", CHECK.format(value="1.0"))
    lenient, strict = workspace.run(), workspace.run(strict=True)
    assert (lenient.code, strict.code) == (0, 1)
    for found in (lenient, strict):
        told = found.out.rpartition("\n\n")[0]
        assert "of its plans uncovered: " in told.rpartition("\n\n")[2]
        assert "(no case)" in told
    assert verify(strict.package.folder).ok
