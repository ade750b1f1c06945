"""A bench that is held during a case, and released."""

from __future__ import annotations

import re

import pytest
from told_as_json import bodies, results_as_json
from workspaces import make

from hil.evidence.package.verification import verify
from hil.executive.watching import scheduler
from hil.plugin.rehearsing import replay

HOLD = """
hold:
- {output: supply.coil, state: "off", within: 2 s,
   proof: {output: supply.coil, quantity: current, unit: A, min: "-0.001", max: "0.001"}}
"""

DRIVING = """
import signal
from pathlib import Path

from hil.evidence.inbox import post


def asked(*kinds):
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})  # a look between hold and release would wait for ever
    for folder in (Path(__file__).parents[2] / "reports").glob("[0-9]*"):  # there is none in a replay
        for kind in kinds:
            post(folder, kind, by="Ada", text="door")
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGALRM})


@pytest.mark.requirement("T-050")
def test_driving(supply, relays, field, record, check, clock):
    supply.sensor.configure(3.3, 0.05)
    supply.sensor.enable()
    field.start()
    supply.coil.configure(0.2, 0.015)
    supply.coil.enable()
    supply.coil.configure(0.4, 0.015)
    asked(KINDS)
    record("field", field, duration=3.0, rate=40.0)
    clock.sleep(1.0)
    check("T-050", "voltage", supply.coil.voltage())
"""

TOO_HIGH = "type(supply.coil.voltage())(value=7.0, unit='V', uncertainty=0.01)"


def held(tmp_path, *kinds, hold=HOLD):
    """Return the run whose case asks for these, with a bench that has this hold state."""
    cases = DRIVING.replace("KINDS", ", ".join(repr(kind) for kind in kinds))
    workspace = make(tmp_path / "workspace", cases)
    workspace.change_bench({"\nrest:\n": f"{hold}\nrest:\n"})
    return workspace.run()


@pytest.fixture(scope="module", autouse=True)
def _inbox_read_at_every_point():
    """Let no case be over before its inbox was read, however fast the machine: a look is due without a wait."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(scheduler, "_TICK_S", 0.0)
        yield


@pytest.fixture(scope="module")
def released(tmp_path_factory):
    """The run whose case is held and released."""
    return held(tmp_path_factory.mktemp("held"), "hold", "release")


def events(ran, *kinds):
    """Return the events of these kinds in order."""
    return [event for event in bodies(ran.package) if event["kind"] in kinds]


def test_a_hold_ends_with_what_was_driven_before(released):
    """During a recording the coil is switched off and on again, at the voltage that was set last; the run is whole."""
    ran = released
    hold, end = events(ran, "hold", "hold-end")
    assert ran.verdicts() == {"test_driving": "PASS"}, ran.out
    (check,) = bodies(ran.package, "check")
    assert check["value"] == pytest.approx(0.4, abs=0.05)
    assert [(line["output"], line["state"], line["ok"]) for line in hold["outputs"]] == [("supply.coil", "off", True)]
    assert (hold["by"], hold["text"], end["how"], end["by"]) == ("Ada", "door", "released", "Ada")
    assert all(recording["complete"] for recording in bodies(ran.package, "recording-end"))
    assert verify(ran.package.folder).findings == ()
    assert "door (Ada): supply.coil off" in ran.page()
    assert "held or released the bench" in ran.page()
    assert "HELD: door (Ada)" in ran.out


def test_a_run_with_a_hold_is_replayed(released):
    """The record holds where the bench was held, and what was driven then."""
    assert replay(released.package).differences == ()


def test_what_cannot_be_held_is_refused_in_words(tmp_path):
    """A bench without a hold state, a hold within a hold, and a release of nothing change nothing."""
    ran = held(tmp_path / "1", "release", "hold", "hold", "release", "release")
    assert [event["text"] for event in events(ran, "hold-refused")] == [
        "the bench is not held",
        "the bench is held already",
        "the bench is not held",
    ]
    assert len(events(ran, "hold", "hold-end")) == 2
    assert ran.verdicts() == {"test_driving": "PASS"}
    ran = held(tmp_path / "2", "hold", hold="")
    (refused,) = events(ran, "hold-refused")
    assert refused["text"] == "the bench adcs has no hold state: its bench file has no 'hold'"
    assert events(ran, "hold", "hold-end") == []
    assert "hold refused" in ran.page()


def test_a_bench_that_does_not_reach_its_hold_state_ends_the_run(tmp_path):
    """Whoever asked may rely on it; so the bench is made safe instead."""
    ran = held(tmp_path, "hold", hold=HOLD.replace('min: "-0.001", max: "0.001"', 'min: "1", max: "2"'))
    hold, end = events(ran, "hold", "hold-end")
    assert (hold["outputs"][0]["ok"], end["how"]) == (False, "ended")
    (stop,) = events(ran, "stop")
    assert "did not reach its hold state: supply.coil is not off" in stop["reason"]
    assert (ran.code, ran.verdicts()) == (2, {"test_driving": "ABORTED"})
    assert results_as_json(ran.package)["safe"] is True


def test_a_hold_within_a_case_that_fails_is_told_with_the_verdict(tmp_path):
    """A FAIL stays one; page and terminal say beside it when the bench was held, for how long, by whom and why."""
    cases = DRIVING.replace("KINDS", "'hold', 'release'").replace("supply.coil.voltage()", TOO_HIGH)
    workspace = make(tmp_path / "workspace", cases)
    workspace.change_bench({"\nrest:\n": f"{HOLD}\nrest:\n"})
    ran = workspace.run()
    assert ran.verdicts() == {"test_driving": "FAIL"}
    (hold,) = results_as_json(ran.package)["cases"][0]["holds"]
    assert (hold["by"], hold["text"]) == ("Ada", "door")
    said = r"the bench was held at 0:00:\d\d\.\d of bench time for [\d.]+ m?s of bench time \(Ada: door\)"
    assert re.search(rf"^  {said}$", ran.out, re.MULTILINE)
    _, box, _ = re.split(r">Why not PASS<|</section>", ran.page(), maxsplit=2)
    assert re.search(said, box)
    assert verify(ran.package.folder).findings == ()


def test_a_case_that_was_not_held_has_no_word_of_it(tmp_path):
    """What was held before it, or never, is no reason of its own."""
    ran = held(tmp_path)
    assert results_as_json(ran.package)["cases"][0]["holds"] == []
    assert "the bench was held" not in ran.page()
