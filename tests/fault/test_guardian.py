"""The guardian against executives that die, hang and lie, and against ports that break: real processes and signals."""

from __future__ import annotations

import os
import signal
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from guarded import DistantInstrument, Executive, Instrument, NetworkInstrument, lines_of, output_of, plan_of, until
from sweeps import sample

from hil.guardian import latch
from hil.guardian.latch import Latch
from hil.model.safing import CutOutput

SLOW_MACHINE_S = 1.0  # what a busy machine may add to any of the times


@pytest.fixture
def stack():
    """Close in the reverse order what a test opens."""
    with ExitStack() as opened:
        yield opened


@pytest.fixture
def instruments(stack):
    """Return a maker of instruments that are closed at the end."""

    def make(channels=1, kind=Instrument):
        made = kind(channels)
        stack.callback(made.close)
        return made

    return make


def started(stack, plan, **instruments):
    """Return an executive with a guardian, its ports open."""
    return Executive(plan, {name: each.url for name, each in instruments.items()}, stack)


def events(plan, name):
    """Return the lines of one kind that the guardian wrote."""
    return [line for line in lines_of(plan) if line["event"] == name]


def latched(plan) -> Latch:
    """Return the latch."""
    told = latch.read(plan.latches[0])
    assert told is not None
    return told


ENDS = {
    "killed": (lambda it: os.kill(it.process.pid, signal.SIGKILL), 2.0),
    "crashed": (lambda it: os.kill(it.process.pid, signal.SIGSEGV), 2.0),
    "exception": (lambda it: it.tell("fail"), 2.0),
    "end of input": (lambda it: it.process.stdin.close(), 2.0),
    "stopped": (lambda it: os.kill(it.process.pid, signal.SIGSTOP), 3.0),
    "silent": (lambda it: it.ask("silence"), 3.0),
    "stale": (lambda it: it.ask("beats", fresh_s=-0.1), 2.0),
}


@pytest.mark.parametrize(
    "end",
    [
        end if end in {"killed", "stopped"} else pytest.param(end, marks=[pytest.mark.system, pytest.mark.alone])
        for end in ENDS
    ],
)
def test_every_end_of_an_executive_leaves_its_outputs_safe(tmp_path, stack, instruments, end):
    """Outputs are off in time, the executive is gone for good, and latch, journal and one line say why."""
    psu, cycler = instruments(2), instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"), output_of("relay", "cycler"), output_of("two", "psu", 2))
    executive = started(stack, plan, psu=psu, cycler=cycler)
    executive.arm()
    act, limit_s = ENDS[end]
    began = time.monotonic()
    act(executive)
    psu.wait(lambda: not psu.on)
    cycler.wait(lambda: not cycler.on)
    assert max(psu.said(b"OFF 2")[0], cycler.said(b"OFF 1")[0]) - began < limit_s + SLOW_MACHINE_S
    said = executive.wait_for_words()
    assert executive.wait() != 0 or end == "end of input"
    assert latched(plan).outputs == ()
    assert [line["output"] for line in events(plan, "off")] == ["one", "relay", "two"]
    assert {line["detail"] for line in events(plan, "proof")} == {"safe"}
    assert said.count("hil guardian: ") == 1
    assert latched(plan).why in said
    assert "all outputs are safe; the bench is latched" in said


def test_outputs_are_made_safe_in_their_order(tmp_path, stack, instruments):
    """Six outputs on four ports go off in the order of the plan, in under a third of a second."""
    ports = {name: instruments(2) for name in "abcd"}
    order = [("a", 1), ("b", 1), ("a", 2), ("c", 1), ("d", 1), ("b", 2)]
    plan = plan_of(tmp_path, *(output_of(f"{device}{channel}", device, channel) for device, channel in order))
    executive = started(stack, plan, **ports)
    executive.arm()
    began = time.monotonic()
    executive.process.kill()
    executive.wait_for_words()
    times = [ports[device].said(b"OFF %d" % channel)[0] for device, channel in order]
    assert times == sorted(times)
    assert events(plan, "first pass over")[0]["seconds"] < 0.3 + SLOW_MACHINE_S
    assert times[-1] - began < 0.3 + SLOW_MACHINE_S


@pytest.mark.system
@pytest.mark.alone
def test_a_dead_port_costs_the_others_a_moment_only(tmp_path, stack, instruments):
    """A port that says nothing delays what comes after it by a third of a second, twice on one port not twice that."""
    dead, alive = instruments(2), instruments()
    slow = {"reply_s": 0.8}  # three replies that do not come would take two and a half seconds
    outputs = output_of("one", "dead", **slow), output_of("two", "dead", 2, **slow), output_of("three", "alive")
    plan = plan_of(tmp_path, *outputs)
    executive = started(stack, plan, dead=dead, alive=alive)
    executive.arm()
    dead.dead = True
    executive.process.kill()
    alive.wait(lambda: not alive.on)
    said = executive.wait_for_words()
    assert dead.said(b"OFF 1")[0] < dead.said(b"OFF 2")[0]
    assert alive.said(b"OFF 1")[0] - dead.said(b"SYNC")[0] < 0.3 + SLOW_MACHINE_S
    assert latched(plan).outputs == ("one", "two")
    assert "NOT PROVEN SAFE: one, two" in said


def test_a_half_sent_frame_is_ended_first(tmp_path, stack, instruments):
    """What the executive left half sent on a line does not swallow the command."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.arm()
    executive.ask("write", device="psu", text="VOLT 4.")
    os.kill(executive.process.pid, signal.SIGSTOP)
    psu.wait(lambda: not psu.on)
    assert [line for _, line in psu.heard][:3] == [b"VOLT 4.", b"SYNC", b"OFF 1"]
    executive.wait_for_words()
    assert executive.wait() == -signal.SIGKILL


def test_a_reply_is_found_among_what_else_is_said(tmp_path, stack, instruments):
    """Lines that a cycler streams by itself hide no reply."""
    cycler = instruments()
    cycler.chatter = b"3.71;1.25;23.1;on 1 yes\ncurrent 1 1.25\n"
    plan = plan_of(tmp_path, output_of("relay", "cycler"))
    executive = started(stack, plan, cycler=cycler)
    executive.arm()
    executive.process.kill()
    executive.wait_for_words()
    assert latched(plan).outputs == ()


@pytest.mark.system
@pytest.mark.alone
def test_what_refuses_is_never_said_to_be_safe(tmp_path, stack, instruments):
    """An instrument that confirms and does nothing stays unproven, though another output could cut it off."""
    psu, relay = instruments(), instruments()
    psu.refuses = True
    plan = plan_of(tmp_path, output_of("supply", "psu", cut_by=("relay",)), output_of("relay", "board"))
    executive = started(stack, plan, psu=psu, board=relay)
    executive.arm()
    executive.process.kill()
    executive.wait_for_words()
    assert latched(plan).outputs == ("supply",)
    assert "b'on 1 yes" in events(plan, "proof")[0]["detail"]


def test_a_pulled_port_is_cut_off_by_another(tmp_path, stack, instruments):
    """Where the port is gone, the named cut path counts once it is proven."""
    psu, relay = instruments(), instruments()
    plan = plan_of(tmp_path, output_of("supply", "psu", cut_by=("relay",)), output_of("relay", "board"))
    executive = started(stack, plan, psu=psu, board=relay)
    executive.arm()
    psu.close()
    executive.process.kill()
    executive.wait_for_words()
    assert not relay.on
    assert latched(plan).outputs == ()
    assert events(plan, "proof")[0]["detail"].startswith("cut off by relay, which is safe; its port is gone")


def test_a_port_that_came_back_is_reopened(tmp_path, stack, instruments):
    """A descriptor that died with a pulled plug is replaced, where the plan says what to open."""
    pulled, again = instruments(), instruments()
    link = tmp_path / "psu"
    link.symlink_to(pulled.url)
    plan = plan_of(tmp_path, output_of("supply", "psu"), urls={"psu": str(link)})
    executive = started(stack, plan, psu=pulled)
    executive.arm()
    pulled.close()
    link.unlink()
    link.symlink_to(again.url)
    executive.process.kill()
    again.wait(lambda: not again.on)
    executive.wait_for_words()
    assert latched(plan).outputs == ()


def test_a_connection_is_used_while_it_stands_and_remade_when_it_does_not(tmp_path, stack, instruments):
    """The one connection of an instrument outlives the executive; one that was shut down is replaced."""
    kept, shut = instruments(kind=NetworkInstrument), instruments(kind=NetworkInstrument)
    outputs = output_of("kept", "kept"), output_of("shut", "shut")
    plan = plan_of(tmp_path, *outputs, urls={"kept": kept.url, "shut": shut.url})
    executive = started(stack, plan, kept=kept, shut=shut)
    executive.arm()
    executive.ask("shut", device="shut")
    executive.process.kill()
    kept.wait(lambda: not kept.on)
    shut.wait(lambda: not shut.on)
    executive.wait_for_words()
    assert (kept.clients, shut.clients) == (1, 2)
    assert latched(plan).outputs == ()


@pytest.mark.system
def test_another_instrument_at_an_address_gets_no_byte_but_the_question_who_it_is(tmp_path, stack, instruments):
    """It is named, the output is not proven, and the instrument that comes back to its address is made safe."""
    ours = instruments(kind=NetworkInstrument)
    at = int(ours.url.rpartition(":")[2])

    class There(NetworkInstrument):
        """Whoever has that address later."""

        port = at

    class Stranger(There):
        """Somebody else's supply."""

        name = b"psu 2"

    plan = plan_of(tmp_path, output_of("one", "psu", within_s=0.5), urls={"psu": ours.url})
    executive = started(stack, plan, psu=ours)
    assert all(each["ok"] for each in executive.ask("drill")["results"])
    executive.arm()
    ours.close()
    stranger = instruments(kind=Stranger)
    executive.process.kill()
    assert "NOT PROVEN SAFE: one" in executive.wait_for_words()
    assert stranger.on == {1}
    assert {command for _, command in stranger.heard} == {b"WHO?"}
    told = events(plan, "proof")[-1]["detail"]
    assert f"another instrument answers, 'i am psu 2', at {ours.url}, which was 'i am psu 1'" in told
    stranger.close()
    returned = instruments(kind=There)
    returned.wait(lambda: not returned.on)
    executive.wait_for_guardian()
    assert events(plan, "done")[-1]["unproven"] == []


def test_a_child_that_keeps_everything_open_hides_no_death(tmp_path, stack, instruments):
    """A fork of the executive holds its end of the line; its death is seen all the same."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.arm()
    child = executive.ask("fork")["child"]
    stack.callback(os.kill, child, signal.SIGKILL)
    executive.process.kill()
    psu.wait(lambda: not psu.on)
    executive.wait_for_words()
    assert latched(plan).why == "the executive died"


@pytest.mark.system
@pytest.mark.alone
def test_a_death_in_the_midst_of_the_drill_is_acted_upon(tmp_path, stack, instruments):
    """The drill is given up at once, though its port says nothing."""
    psu = instruments()
    psu.dead = True
    plan = plan_of(tmp_path, output_of("one", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.tell("drill")
    psu.wait(lambda: psu.heard)
    executive.process.kill()
    executive.wait_for_words()
    assert latched(plan).outputs == ("one",)


def test_the_drill_tells_of_every_output_and_of_the_heartbeat(tmp_path, stack, instruments):
    """Outputs go off in the drill; a dead one fails; silence would have been noticed within hang_s and a little."""
    psu, dead = instruments(), instruments()
    dead.dead = True
    plan = plan_of(tmp_path, output_of("one", "psu"), output_of("two", "dead"), hang_s=0.3)
    executive = started(stack, plan, psu=psu, dead=dead)
    one, two, heartbeat = executive.ask("drill")["results"]
    assert (one["output"], one["ok"], psu.on) == ("one", True, set())
    assert (two["ok"], "said nothing" in two["detail"]) == (False, True)
    assert (heartbeat["output"], heartbeat["ok"]) == ("heartbeat", True)
    assert 0.3 <= heartbeat["seconds"] < 0.3 + SLOW_MACHINE_S
    executive.ask("close")
    executive.wait_for_guardian()
    assert lines_of(plan) == []
    assert latch.read(plan.latches[0]) is None


def test_a_proven_bench_is_disarmed_and_left_alone(tmp_path, stack, instruments):
    """After a disarming that held, neither silence nor death is acted upon."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"), hang_s=0.2)
    executive = started(stack, plan, psu=psu)
    executive.arm()
    executive.ask("write", device="psu", text="OFF 1\n")
    psu.wait(lambda: not psu.on)
    assert executive.ask("disarm")["results"][0]["ok"]
    executive.ask("silence")
    executive.process.kill()
    executive.wait_for_guardian()
    assert len(psu.said(b"OFF 1")) == 1
    assert latch.read(plan.latches[0]) is None


@pytest.mark.system
@pytest.mark.alone
@pytest.mark.parametrize("what", ["on", "pulled"])
def test_an_unproven_bench_is_not_disarmed(tmp_path, stack, instruments, what):
    """The guardian proves for itself, says why it stays, and acts once the executive leaves, without killing it."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.arm()
    if what == "pulled":
        psu.close()
    (result,) = executive.ask("disarm")["results"]
    assert not result["ok"]
    assert ("on 1 yes" if what == "on" else "its port is gone") in result["detail"]
    assert executive.ask("close") == {"ok": True}
    assert latched(plan).outputs == (() if what == "on" else ("one",))
    if what == "pulled":
        assert not until(executive.watched, 0.0)
        latch.clear(Path(plan.latches[0]))
    executive.wait_for_guardian()
    assert executive.process.poll() is None


@pytest.mark.system
@pytest.mark.alone
def test_a_port_that_returns_after_everything_was_said_is_made_safe(tmp_path, stack, instruments):
    """A hub was away for longer than any limit: what returns is off within 2 s, then all is proven."""
    pulled, again = instruments(), instruments()
    link = tmp_path / "psu"
    link.symlink_to(pulled.url)
    plan = plan_of(tmp_path, output_of("supply", "psu"), urls={"psu": str(link)})
    executive = started(stack, plan, psu=pulled)
    executive.arm()
    pulled.close()
    link.unlink()
    executive.process.kill()
    said = executive.wait_for_words()
    assert "NOT PROVEN SAFE: supply; it keeps trying until they are, or until 'hil ack' ends it" in said
    assert latched(plan).outputs == ("supply",)
    assert executive.process.stderr.read() == b""  # who waits for the end of its words is not kept waiting
    assert events(plan, "trying")[0]["unproven"] == ["supply"]
    assert events(plan, "trying")[0]["pid"] == executive.guardian
    began = time.monotonic()
    link.symlink_to(again.url)
    again.wait(lambda: not again.on)
    assert time.monotonic() - began < 2.0 + SLOW_MACHINE_S
    executive.wait_for_guardian()
    assert latched(plan).outputs == ()
    assert (events(plan, "done")[0]["unproven"], events(plan, "done")[0]["proven"]) == ([], ["supply"])


@pytest.mark.system
@pytest.mark.alone
def test_a_guardian_leaves_once_a_person_has_acknowledged(tmp_path, stack, instruments):
    """It writes nothing more down: an acknowledgement holds for its journal as it was."""
    psu = instruments()
    psu.refuses = True
    plan = plan_of(tmp_path, output_of("supply", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.arm()
    executive.process.kill()
    executive.wait_for_words()
    assert not until(executive.watched, 1.0)
    before = Path(plan.journal).read_bytes()
    latch.clear(Path(plan.latches[0]))
    executive.wait_for_guardian()
    assert Path(plan.journal).read_bytes() == before
    assert latch.read(plan.latches[0]) is None


@pytest.mark.system
@pytest.mark.parametrize(("first_s", "then_s"), sample([(0.002, 0.45), (0.45, 0.45), (0.1, 0.1), (0.04, 0.2)], 2))
def test_replies_that_come_late_are_matched(tmp_path, stack, instruments, first_s, then_s):
    """Drilled and guarded; what goes off is proven, and what stays on is not, though its replies come from before."""
    psu, welded = instruments(2, kind=DistantInstrument), instruments(kind=DistantInstrument)
    psu.latency_s = welded.latency_s = first_s
    slow = {"reply_s": 0.5}
    outputs = output_of("a", "psu", **slow), output_of("b", "psu", 2, **slow), output_of("c", "welded", **slow)
    executive = started(stack, plan_of(tmp_path, *outputs, hang_s=0.3), psu=psu, welded=welded)
    assert all(each["ok"] for each in executive.ask("drill")["results"])
    executive.arm()
    psu.latency_s = welded.latency_s = then_s
    welded.refuses = True
    executive.ask("write", device="welded", text="ON? 1\nCURR? 1\nON 1\n")
    executive.ask("write", device="psu", text="ON? 1\nCURR? 1\nON 1\nON 2\n")
    psu.wait(lambda: psu.on == {1, 2})
    executive.process.kill()
    psu.wait(lambda: not psu.on, 2.0 + SLOW_MACHINE_S)
    assert "NOT PROVEN SAFE: c; " in executive.wait_for_words()
    assert welded.on == {1}


@pytest.mark.system
@pytest.mark.alone
def test_what_only_another_output_can_cut_off_is_as_safe_as_that_one(tmp_path, stack, instruments):
    """An output without bytes of its own is drilled, disarmed and proven by the one that cuts it off."""
    relay = instruments()
    cut = (CutOutput(output="foreign", cut_by=("relay",), why="gives no safe_bytes"),)
    plan = plan_of(tmp_path, output_of("relay", "board"), cut=cut, hang_s=0.3)
    executive = started(stack, plan, board=relay)
    _, foreign, _ = executive.ask("drill")["results"]
    assert (foreign["output"], foreign["ok"]) == ("foreign", True)
    executive.arm()
    relay.refuses = True
    executive.ask("write", device="board", text="ON 1\n")
    assert [each["ok"] for each in executive.ask("disarm")["results"]] == [False, False]
    executive.process.kill()
    executive.wait_for_words()
    assert latched(plan).outputs == ("relay", "foreign")
    relay.refuses = False
    executive.wait_for_guardian()
    assert latched(plan).outputs == ()


@pytest.mark.system
@pytest.mark.alone
def test_a_plan_without_outputs_proves_nothing_and_says_so(tmp_path, stack):
    """Nothing was asked, so nothing is called safe."""
    plan = plan_of(tmp_path)
    executive = started(stack, plan)
    executive.arm()
    executive.process.kill()
    assert "it guards no output, so nothing was proven" in executive.wait_for_words()
    executive.wait_for_guardian()
    assert (events(plan, "done")[0]["proven"], events(plan, "done")[0]["unproven"]) == ([], [])


@pytest.mark.system
@pytest.mark.alone
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_the_executive_is_told_when_its_guardian_is_lost(tmp_path, stack, instruments, end):
    """A guardian that died or hangs is missed by the next beats, and no beat waits for it."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"), hang_s=0.3)
    executive = started(stack, plan, psu=psu)
    executive.arm()
    began = time.monotonic()
    os.kill(executive.guardian, end)
    told = executive.hear()
    assert "the guardian" in told["lost"]
    assert told["seconds"] < 0.1
    assert time.monotonic() - began < 0.6 + SLOW_MACHINE_S
    assert executive.ask("close") == {"ok": True}
    executive.wait_for_guardian()


def test_signals_of_a_terminal_do_not_end_it(tmp_path, stack, instruments):
    """The guardian is out of reach of what ends an executive, and in no folder that somebody wants to unmount."""
    psu = instruments()
    plan = plan_of(tmp_path, output_of("one", "psu"))
    executive = started(stack, plan, psu=psu)
    executive.arm()
    for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1):
        os.kill(executive.guardian, each)
    assert os.getsid(executive.guardian) == executive.guardian
    process = Path(f"/proc/{executive.guardian}")
    assert str((process / "cwd").readlink()) == "/"
    assert not until(executive.watched, 0.0)
    held = {str(each.readlink()) for each in (process / "fd").iterdir()}
    assert {name for name in held if name.startswith("/dev/pts")} == {psu.url}
    executive.process.kill()
    psu.wait(lambda: not psu.on)
    executive.wait_for_words()


def test_two_guardians_do_not_know_each_other(tmp_path, stack, instruments):
    """One executive's death leaves another's bench as it is."""
    one, other = instruments(), instruments()
    (tmp_path / "other").mkdir()
    first = started(stack, plan_of(tmp_path, output_of("one", "psu")), psu=one)
    plan = plan_of(tmp_path / "other", output_of("one", "psu"))
    second = started(stack, plan, psu=other)
    first.arm()
    second.arm()
    first.process.kill()
    first.wait_for_words()
    assert (one.on, other.on) == (set(), {1})
    assert latch.read(plan.latches[0]) is None
