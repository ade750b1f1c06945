"""A bench that nobody can look after any more, or that somebody asked to stop, is not tried on."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import MagicMock, Mock

import pytest
from adcs_bench import adcs, bound
from case_parts import Written

from hil.bench.gate import Gate
from hil.clock.live import LiveClock
from hil.evidence.events import Entry
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.resuming.beginnings import Entering
from hil.executive.watching import arming
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.ports import Distress, NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.timeline import OnLiveBench, Places
from hil.model.identity import Dut, Model


def tried(written):
    """Return the gates of outputs that were tried."""
    names = [event["name"] for event in written.of("gate")]
    return [name for name in names if name.startswith("reduced level")]


DUT = Dut(serial="S", part="P", hardware="A", model=Model.EM)


def keeper_of(bench, flags, written, machine):
    """Return the keeper of a bench in this process."""
    return BenchKeeper(
        bench, DUT, flags, written, Mock(), machine, timeline_of(bench, machine, SimpleNamespace(course=0)), ()
    )


class StoppedAt(Written):
    """A journal that hears somebody ask to stop when a gate is written down."""

    def __init__(self, flags, name):
        super().__init__()
        self.flags = flags
        self.name = name

    def write(self, event, *, beside=None):
        """Take one event."""
        super().write(event, beside=beside)
        if getattr(event, "name", "") == self.name:
            self.flags.request("SIGTERM")


@pytest.mark.parametrize(
    "name",
    ["identity of psu1", "outputs of relay1", "safe state reached", "reduced level of supply.coil, relays released"],
)
def test_arming_ends_when_somebody_asks_to_stop(name):
    """The next gate says who stopped it; no output is tried after that, and all of them are off."""
    flags = StopFlags()
    written = StoppedAt(flags, name)
    with bound(adcs()) as bench:
        assert "stopped by SIGTERM" in keeper_of(bench, flags, written, NoMachine()).arm()
        assert not any(bench.roles[each].enabled() for each in ("supply.sensor", "supply.coil"))
    names = [event["name"] for event in written.of("gate")]
    assert len(names) == names.index(name) + 2
    assert written.events[-1]["ok"] is False
    assert written.events[-1]["detail"].startswith("stopped by SIGTERM; ")


def test_a_stop_while_the_guardian_is_drilled_ends_the_arming():
    """What waits for the guardian is left at once; nothing was driven, and the bench is made safe at the end."""
    flags, written = StopFlags(), Written()

    class Drilled(NoMachine):
        """A machine whose guardian is being drilled when somebody asks to stop."""

        def gates(self, freshness):
            """Wait."""
            yield Gate("sleep and shutdown held off", ok=True, detail="")
            flags.request("SIGHUP")
            flags.check()

    with bound(adcs()) as bench:
        keeper = keeper_of(bench, flags, written, Drilled())
        assert keeper.arm() == "guardian: stopped by SIGHUP; not started"
        assert tried(written) == []
        keeper.release()
    assert {event["ok"] for event in written.of("safe")} == {True}


def test_a_stop_while_it_is_armed_again_stops_the_case():
    """A resumed run that is stopped then ends as a stopped run, not as one that could not be armed."""
    flags, written = StopFlags(), Written()
    with bound(adcs()) as bench:
        keeper = keeper_of(bench, flags, written, NoMachine())
        flags.request("SIGINT")
        assert keeper.arm_again(7).startswith("identity of psu1: stopped by SIGINT")
        with pytest.raises(Stopped):
            keeper.scheduler.flags.check()


@pytest.mark.parametrize("at", ["outputs of relay1", "reduced level of supply.coil, relays released", "driven again"])
def test_a_stop_while_a_resumed_run_arms_again_waits_for_a_scheduling_point(at):
    """Nothing is raised where a case is only about to begin; every output is safe, and the next point ends the case."""
    flags = StopFlags()
    written = StoppedAt(flags, at)
    entry = Entry(place=3, boundary=1, void_to=2, operations=0, number=1, rows=(), kept="", over=False, failed=())
    beginning = SimpleNamespace(entries=[(entry, 0.0)], void_rows=None, given_up=(), earlier=None)
    with bound(adcs()) as bench:
        keeper = keeper_of(bench, flags, written, NoMachine())
        if at == "driven again":
            keeper.holding = SimpleNamespace(drive_again=lambda: (flags.request("SIGTERM"), flags.check()))
        Entering(MagicMock(), bench, keeper, beginning).after(3)
        assert not any(bench.roles[each].enabled() for each in ("supply.sensor", "supply.coil"))
        assert flags.reason == "SIGTERM"
        with pytest.raises(Stopped):
            keeper.scheduler.point()
    assert written.of("safe-end")[-1]["ok"] is True


def test_the_guardian_waits_for_one_gate_after_the_other():
    """An arming that goes on may take as long as its bench needs; that it does is told with every gate."""
    written = Written()

    class Counting(NoMachine):
        """A machine that counts what passed."""

        count = 0

        def passed(self):
            """Count."""
            Counting.count += 1

    with bound(adcs()) as bench:
        assert not keeper_of(bench, StopFlags(), written, Counting()).arm()
    assert Counting.count == len(written.of("gate")) > 10


def test_nothing_is_driven_before_the_guardian_watches(monkeypatch):
    """Until then a run that is stopped for ever by SIGSTOP has only asked questions: of supplies, and of relays."""
    sent, before = [], []

    class Watching(NoMachine):
        """A machine whose guardian watches with its last gate."""

        def gates(self, freshness):
            """Look at what has left so far."""
            del freshness
            yield Gate("sleep and shutdown held off", ok=True, detail="")
            before.extend(sent)
            yield Gate("guardian", ok=True, detail="watches")

    with bound(adcs()) as bench:
        note = bench.transcript.note

        def noting(device, name, start_ns, end_ns, asked=b"", *more, **told):
            if asked:
                sent.append((device, asked))
            note(device, name, start_ns, end_ns, asked, *more, **told)

        for port in bench.ports:
            monkeypatch.setattr(port, "_note", noting)
        assert not keeper_of(bench, StopFlags(), Written(), Watching()).arm()

    def drives(device, asked):
        return asked[1] not in {1, 3} if device == "relay1" else any(b"?" not in each for each in asked.split(b";"))

    assert {device for device, _ in before} == {"psu1", "relay1"}
    assert [each for each in before if drives(*each)] == []
    assert {device for device, asked in sent if drives(device, asked)} == {"psu1", "relay1"}


def test_arming_ends_when_the_guardian_dies_amid_it():
    """What was tried last is off again; no other output is switched on, and the gate says why."""
    written = Written()

    class Guarded(NoMachine):
        """A machine whose guardian dies after the first output was tried."""

        def distress(self):
            """Tell of the guardian."""
            return Distress("the guardian is gone", "guardian") if tried(written) else None

    with bound(adcs()) as bench:
        clock = LiveClock("2026-01-01T00:00:00Z")
        timeline = OnLiveBench(bench, clock, Guarded(), Places(SimpleNamespace(course=0)))
        keeper = BenchKeeper(bench, DUT, StopFlags(), written, Mock(), Guarded(), timeline, ())
        assert keeper.arm() == "bench looked after: the guardian is gone"
        assert not any(bench.roles[name].enabled() for name in ("supply.sensor", "supply.coil"))
    assert len(tried(written)) == 1
    last = written.events[-1]
    assert (last["name"], last["ok"], last["detail"]) == ("bench looked after", False, "the guardian is gone")


@pytest.mark.parametrize("what", ["guardian", "port", "machine"])
def test_nothing_is_switched_on_once_something_is_lost_amid_a_trial(monkeypatch, what):
    """The trial of an output is many exchanges long: none of them passes after the loss, and the gates say why."""
    lost = []

    class Losing(NoMachine):
        """A machine that loses something during a trial."""

        def distress(self):
            """Tell of it."""
            return lost[0] if lost else None

    def gates(bench, _dut):
        bench.brake.check()
        lost.append(Distress("it is gone", what))
        with pytest.raises(OSError, match="it is gone"):
            bench.brake.check()
        with bench.brake.released():
            bench.brake.check()
        yield Gate("reduced level of supply.coil", ok=False, detail="psu1: not asked")
        raise AssertionError("another output is tried")

    monkeypatch.setattr(arming, "energised_gates", gates)
    flags, written = StopFlags(), Written()
    with bound(adcs()) as bench:
        assert keeper_of(bench, flags, written, Losing()).arm() == "bench looked after: it is gone"
    assert [event["name"] for event in written.of("gate")][-2:] == [
        "reduced level of supply.coil",
        "bench looked after",
    ]
