"""What of a bench outside this process leaves a run that can be resumed, and what ends it for good."""

from __future__ import annotations

import os
import pty
from types import SimpleNamespace

import pytest
from case_parts import Case, Watch, Written

from hil.bench.gate import Gate
from hil.clock.live import LiveClock
from hil.clock.virtual import VirtualClock
from hil.evidence.events import Failed
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.machine import LiveMachine
from hil.executive.watching.ports import Distress, NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import CaseTimeout, Scheduler
from hil.model.bench import SafeStep
from hil.model.errors import Garbled, NoReply, Rejected, Tripped
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.wire.exchange import Brake
from hil.wire.transcript import Transcript

SILENT = NoReply("psu1", "nothing came")
GONE = NoReply("psu1", "its port is gone (Input/output error)", "check cable, power and hub", gone=True)


class Leaving(Watch):
    """Asks a run to stay open, as the keeper of a bench does."""

    def __init__(self, flags):
        super().__init__()
        self.flags = flags

    def lost(self, distress):
        """Take a loss."""
        super().lost(distress)
        self.flags.leave_off(distress.reason)


@pytest.fixture
def case(tmp_path):
    """A case on a bench outside this process, which has begun."""
    made = Case(tmp_path, "T-010")
    made.watch = made.scheduler._reports = Leaving(made.flags)
    made.scheduler._bench.live = LiveClock("2026-01-01T00:00:00Z")
    made.flags.turns = 1
    return made


@pytest.mark.parametrize(("fault", "what"), [(SILENT, "reply"), (GONE, "port")])
def test_silence_of_a_live_bench_is_a_loss(case, fault, what):
    """The case is not judged, whatever it lets through: it is made again when the run is resumed."""
    case.supply.fault = fault
    with pytest.raises(Stopped):
        case.coil.disable()
    assert case.watch.losses == [Distress(fault.message, what, "psu1")]
    assert case.flags.leave_open
    with pytest.raises(Stopped):
        case.coil.enable()
    assert [name for name, _ in case.supply.calls] == ["disable"]
    assert len(case.watch.losses) == 1
    case.run.raised(Stopped(case.flags.reason))
    case.run.raised(RuntimeError("a teardown that failed for want of its port"))
    assert case.run.outcome().verdict is Verdict.ABORTED
    assert [event["message"] for event in case.written.of("fault")] == [fault.message]


@pytest.mark.parametrize("fault", [Garbled("psu1", "said Q"), Rejected("psu1", "error -221")])
def test_nonsense_of_a_port_that_is_there_is_not(case, fault):
    """It is an ERROR, as on every bench."""
    case.supply.fault = fault
    with pytest.raises(type(fault)):
        case.coil.disable()
    assert not case.watch.losses
    assert case.run.outcome().verdict is Verdict.ERROR


def test_silence_of_the_device_under_test_is_its_own(tmp_path):
    """It is what the case is about."""
    case = Case(tmp_path, "T-010", dut=True)
    case.scheduler._bench.live = LiveClock("2026-01-01T00:00:00Z")
    case.supply.fault = GONE
    with pytest.raises(NoReply):
        case.coil.disable()
    assert not case.watch.losses


def test_silence_of_a_bench_in_this_process_is_not_a_loss(tmp_path):
    """Nobody has pulled a cable there."""
    case = Case(tmp_path, "T-010")
    case.supply.fault = GONE
    with pytest.raises(NoReply):
        case.coil.disable()
    assert not case.watch.losses
    assert case.run.outcome().verdict is Verdict.ERROR


def scheduled(distress):
    """Return a scheduler of a live bench whose machine is in distress, its flags, and what it reports."""
    clock, flags = LiveClock("2026-01-01T00:00:00Z"), StopFlags()
    flags.turns = 1
    watch = Leaving(flags)
    bench = SimpleNamespace(clock=clock, live=clock, playback=None, speed=1.0, transcript=Transcript(None), ports=[])

    class Machine(NoMachine):
        """A machine in distress."""

        def distress(self):
            """Tell of it."""
            return distress

    made = Scheduler(bench, [], flags, watch, timeline_of(bench, Machine(), SimpleNamespace(course=7)))
    made.watch_from_now()
    return made, flags, watch


def test_a_lost_guardian_leaves_the_run_open():
    """It does not trip: nothing was wrong with the bench."""
    made, flags, watch = scheduled(Distress("the guardian is gone", "guardian"))
    with pytest.raises(Stopped, match="a lost guardian: the guardian is gone"):
        made.point()
    assert (flags.leave_open, flags.reason) == (True, "a lost guardian: the guardian is gone")
    assert not watch.trips
    assert made.tripped is None


def test_the_end_of_the_device_under_test_trips():
    """As it always did."""
    made, flags, watch = scheduled(Distress("the port of obc1 is gone"))
    with pytest.raises(Tripped):
        made.point()
    assert not watch.losses
    assert not flags.reason


class Silent:
    """A supply's role that does not answer."""

    def disable(self):
        """Wait in vain."""
        raise SILENT


class Proving(NoMachine):
    """A machine whose guardian proves in the end what the run could not."""

    proven = True

    def end(self, *, proven):
        """Find what was on at first."""
        assert not proven
        return ["supply.coil: not proven"]


def kept(machine, *, live=True):
    """Return the keeper of a bench whose supply is silent, and what is written down."""
    clock, flags, written = LiveClock("2026-01-01T00:00:00Z"), StopFlags(), Written()
    flags.turns = 1
    step = SafeStep(output="supply.coil", state="off", within_s=1.0)
    psu1 = SimpleNamespace(dut=False, name="psu1")
    spec = SimpleNamespace(
        envelope=(), rest=(step,), safe_off=(step,), hold=(), watch_after=(), instrument=lambda _: psu1
    )
    bench = SimpleNamespace(
        clock=clock, live=clock if live else None, playback=None, speed=1.0, transcript=Transcript(None), spec=spec
    )
    bench.roles, bench.brake = {"supply.coil": Silent()}, Brake()
    timeline = timeline_of(bench, machine, SimpleNamespace(course=0))
    return BenchKeeper(bench, None, flags, written, None, machine, timeline, ()), flags, written


def test_a_rest_state_that_silence_keeps_from_is_a_loss():
    """The case before has its verdict; the next one is run when the run is resumed."""
    keeper, flags, written = kept(Proving())
    assert keeper.rest() == ""
    assert (flags.leave_open, keeper.stays_open) == (True, True)
    (lost,) = written.of("lost")
    assert (lost["what"], lost["device"]) == ("reply", "psu1")
    assert keeper.rest() == ""
    assert len(written.of("lost")) == 1


def test_a_rest_state_that_is_not_reached_in_this_process_ends_the_run():
    """As it always did."""
    keeper, flags, _ = kept(NoMachine(), live=False)
    assert keeper.rest().startswith("the bench did not reach its rest state: supply.coil is not off")
    assert not flags.reason


def test_what_the_guardian_proves_after_a_loss_is_safe():
    """The run could not reach it; the port came back, and the guardian was there."""
    keeper, _, written = kept(Proving())
    keeper.rest()
    assert keeper.unsafe
    keeper._armed.touched = True
    keeper.release()
    assert not keeper.unsafe
    assert keeper.stays_open
    assert not written.of("host-gate")


def test_all_is_switched_off_before_anything_is_proven():
    """At the end, and after a stop already where the bench would come to rest; never on a bench that was not armed."""
    order: list[str] = []

    class Slow(NoMachine):
        """A machine whose instruments reply late."""

        def switch_off(self):
            """Switch off."""
            order.append("switched off")

    keeper, flags, _ = kept(Slow())
    keeper._bench.roles["supply.coil"] = SimpleNamespace(disable=lambda: order.append("proven"))
    keeper.safe()
    assert order == ["proven"]
    keeper._armed.touched = True
    keeper.rest()
    assert order[1:] == ["proven"]
    keeper.safe()
    assert order[2:] == ["switched off", "proven"]
    flags.request("SIGINT")
    keeper.rest()
    assert order[4:] == ["switched off", "proven"]


@pytest.mark.parametrize(("holds", "unsafe"), [(False, False), (True, True)])
def test_a_refused_arming_whose_safe_off_is_late_ends_safe(monkeypatch, holds, unsafe):
    """What was proven after its time is proven; on a bench that was armed its line has to hold."""
    keeper, _, written = kept(NoMachine())
    armed, clock = keeper._armed, VirtualClock()
    monkeypatch.setattr(keeper._bench, "clock", clock)
    keeper._bench.roles["supply.coil"] = SimpleNamespace(disable=lambda: clock.sleep(1.5))
    gate = Gate("reduced level of supply.coil", ok=holds, detail="0.3 A")
    monkeypatch.setattr(armed, "_gates", lambda *_: iter([(gate, False, True)]))
    armed.touched = True
    armed.arm(-1, None, lambda *_: None)
    keeper.safe()
    (line,) = written.of("safe")
    assert (line["ok"], line["detail"]) == (False, "reached after 1.5 s, 1 s allowed")
    assert [event["ok"] for event in written.of("safe-end")] == [not unsafe]
    assert keeper.unsafe is unsafe


@pytest.mark.parametrize(("dut", "what"), [(False, "port"), (True, "")])
def test_whose_port_hung_up(dut, what):
    """That of an instrument is a loss, that of the device under test its end."""
    near, far = pty.openpty()
    instrument = SimpleNamespace(dut=dut)
    spec = SimpleNamespace(instrument=lambda _: instrument)
    bench = SimpleNamespace(spec=spec, descriptors={"psu1": far}, source=Source.SIMULATED)
    machine = LiveMachine(bench, SimpleNamespace(lost=""), None, None)
    assert machine.distress() is None
    os.close(near)
    machine._looked = 0.0
    found = machine.distress()
    os.close(far)
    assert (found.what, found.text) == (what, "the port of psu1 is gone")


def test_what_failed_before_the_run_was_interrupted_counts(tmp_path):
    """However often it is repeated after that."""
    case = Case(tmp_path, "T-010")
    case.run.check.keep([Failed(case="c", requirement="T-010", parameter="ratio", of=None, reason="0.4 is above 0.3")])
    outcome = case.run.outcome()
    assert outcome.requirements == {"T-010": Verdict.FAIL}
    assert "T-010 ratio is FAIL: before the run was interrupted, 0.4 is above 0.3" in outcome.reasons


def test_an_interruption_makes_no_case_too_long(case):
    """Two weeks in which nobody resumed a run are not two weeks of its case."""
    case.scheduler.begin_case(case.run, 60 * 10**9)
    case.scheduler.put_off(14 * 86400 * 10**9)
    case.clock.sleep(14 * 86400.0 + 59.0)
    case.scheduler.point()
    case.clock.sleep(2.0)
    with pytest.raises(CaseTimeout):
        case.scheduler.point()
