"""What ends a hold, and what is driven after it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from case_parts import Written
from typed_events import event_of

from hil.clock.virtual import VirtualClock
from hil.executive.ending.stop import StopFlags, Stopped
from hil.executive.watching.holding import Driven, Holding
from hil.model.bench import SafeStep, Wire
from hil.model.errors import NoReply, Tripped
from hil.wire.transcript import Transcript


class Coil:
    """A supply that notes what it is told, and falls silent if it is to."""

    def __init__(self):
        self.told = []
        self.silent = False

    def disable(self):
        """Switch off."""
        self.told.append("disable")

    def enable(self):
        """Switch on."""
        if self.silent:
            raise NoReply("psu1", "no reply", "look at its line")
        self.told.append("enable")


class Scheduler:
    """A scheduling point that lets bench time pass, and can end."""

    def __init__(self, clock, ending=None):
        self.clock, self.ending = clock, ending
        self.watching, self.deadline_ns, self.faults = True, 10_000_000_000, []
        self.seen = []
        self.timeline = SimpleNamespace(mark_hold=lambda _: None)
        self.monitoring = SimpleNamespace(
            case=SimpleNamespace(fault=lambda instrument, fault: self.faults.append((instrument, fault)))
        )

    def now_ns(self):
        """Return the bench's time."""
        return self.clock.now_ns()

    def watch_from_now(self):
        """Do nothing."""

    def idle(self, *, held):
        """Let a minute pass, and end if that is asked for."""
        assert held
        self.clock.sleep(60.0)
        self.seen.append(self.deadline_ns)
        if self.ending:
            raise self.ending
        self.holding(event_of(kind="hold-asked", release=True, by="Eve", text=""))


@pytest.fixture
def bench():
    """Return a bench with one coil, which is on."""
    wire = Wire(role="supply", instance="coil", instrument="psu1")
    spec = SimpleNamespace(
        name="b",
        hold=(SafeStep(output="supply.coil", state="off", within_s=1.0),),
        wiring=(wire,),
        instrument=lambda name: name,
        wire=lambda _: wire,
    )
    clock = VirtualClock()
    roles = {"supply.coil": Coil()}
    return SimpleNamespace(
        spec=spec, clock=clock, roles=roles, transcript=Transcript(None), playback=None, live=None, speed=1.0
    )


def hold(bench, ending=None):
    """Hold the bench until the scheduling point ends it; return the events, the scheduler, and what was raised."""
    written, raised = Written(), None
    scheduler = Scheduler(bench.clock, ending)
    holding = Holding(bench, StopFlags(), written, scheduler)
    scheduler.holding = holding
    drive = {"kind": "effect", "effect": "drives", "name": "supply.coil.enable", "arguments": {}, "t": 0.0}
    holding(event_of(**drive))
    holding(event_of(kind="hold-asked", release=False, by="Ada", text="door"))
    try:
        holding.tick()
    except (Stopped, Tripped, NoReply) as error:
        raised = error
    return written.events, scheduler, raised


def test_time_on_hold_does_not_count_for_the_case(bench):
    """The case has no limit while it is held, and as much time as before after it."""
    (first, end), scheduler, _ = hold(bench)
    assert (first["kind"], end["kind"], end["how"], end["by"], end["duration"]) == (
        "hold",
        "hold-end",
        "released",
        "Eve",
        60.0,
    )
    assert end["beside"]["held"] > 0
    assert scheduler.seen == [None]
    assert scheduler.deadline_ns == 70_000_000_000
    assert bench.roles["supply.coil"].told == ["disable", "enable"]


@pytest.mark.parametrize("ending", [Stopped("Ada"), Tripped("too hot", "it is safe")], ids=["stop", "trip"])
def test_a_stop_or_a_trip_ends_a_hold(bench, ending):
    """Nothing is switched on again, and the end of the hold is written down."""
    written, _, raised = hold(bench, ending)
    assert raised is ending
    assert [(event["kind"], event.get("how")) for event in written] == [("hold", None), ("hold-end", "ended")]
    assert bench.roles["supply.coil"].told == ["disable"]


def test_an_output_that_falls_silent_is_a_fault_of_the_bench(bench):
    """What was driven cannot be brought back, so the case learns of it."""
    bench.roles["supply.coil"].silent = True
    written, scheduler, raised = hold(bench)
    assert isinstance(raised, NoReply)
    assert scheduler.faults == [("psu1", raised)]
    assert written[-1]["how"] == "ended"


def driven(*calls):
    """Return what is driven after these calls of `output.operation` with their arguments."""
    found = Driven()
    for second, (name, arguments) in enumerate(calls):
        found.take(event_of(kind="effect", effect="drives", name=name, arguments=arguments, t=float(second)))
    return found


def told(calls):
    """Return operation and arguments of calls."""
    return [(call.operation, call.arguments) for call in calls]


def test_the_last_call_of_each_operation_is_driven_again():
    """A voltage is set before its output is on; what a state of rest made void, and what failed, is left out."""
    five, six = {"voltage": 5.0, "current": 1.0}, {"voltage": 6.0, "current": 1.0}
    found = driven(("supply.a.configure", five), ("supply.a.enable", {}), ("supply.a.configure", six))
    assert told(found.of("supply.a")) == [("configure", six), ("enable", {})]
    found.take(event_of(kind="effect", effect="drives", name="supply.a.disable", arguments={}, t=3.0))
    assert told(found.of("supply.a")) == [("disable", {})]
    found.take(event_of(kind="effect", effect="drives", name="thermal.hold", arguments={}, raised="NoReply"))
    assert found.of("thermal") == ()
    found.take(event_of(kind="rest"))
    assert found.of("supply.a") == ()


def test_each_contact_is_as_it_was():
    """Of close and open of one contact the last one counts."""
    a, b = {"contact": "a"}, {"contact": "b"}
    found = driven(("relays.close", a), ("relays.close", b), ("relays.open", a))
    assert told(found.of("relays")) == [("open", a), ("close", b)]


def test_calls_of_all_outputs_come_in_the_order_in_which_they_were_needed():
    """A sensor is woken after its supply is on, and what begins a test of its own is nobody's but the case's."""
    on = ("supply.sensor.enable", {})
    found = driven(on, ("magnetometer.start", {}), ("cycler.prepare", {}), ("cycler.start", {}), on)
    assert [(call.output, call.operation, call.first_t) for call in found.calls] == [
        ("supply.sensor", "enable", 0.0),
        ("magnetometer", "start", 1.0),
        ("cycler", "prepare", 2.0),
    ]
