"""Parts of a case without a bench: events in a list, a supply in memory, a clock that jumps."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from types import SimpleNamespace

import msgspec

from hil.bench.envelope import Monitor
from hil.clock.virtual import VirtualClock
from hil.evidence.events import Event
from hil.executive.cases.artifacts import Artifacts
from hil.executive.cases.case_run import CaseRun
from hil.executive.cases.charts import Charts
from hil.executive.cases.checks import Checks
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import Escapes
from hil.executive.cases.facade import Facade
from hil.executive.cases.operator import Operator
from hil.executive.cases.recorder import Recorder
from hil.executive.cases.steps import Steps
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.row_store import RowStore
from hil.executive.people.answers import Nobody
from hil.executive.people.at_hand import AtHand
from hil.executive.people.files import Shelf
from hil.executive.setup.head import PlannedCase
from hil.executive.setup.workspace import Workspace
from hil.executive.watching.ports import Distress, NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import Scheduler
from hil.instruments.sampled import Channel
from hil.model.bench import CalibratedRange, Calibration, InstrumentSpec, Wire
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure
from hil.model.identity import Source
from hil.requirements.requirement import Decision, Kind, Limit, Records, Requirement
from hil.wire.transcript import Transcript

__all__ = [
    "CALIBRATION",
    "REQUIREMENTS",
    "Case",
    "Magnetometer",
    "Supply",
    "Watch",
    "Written",
    "limit",
    "monitor",
    "scheduler",
]

CALIBRATION = Calibration(
    certificate="C-1",
    due="2027-01-01",
    ranges=(
        CalibratedRange(quantity="voltage", unit="V", low=-1, high=10, absolute=0.002, relative=0.01),
        CalibratedRange(quantity="field", unit="uT", low=-100, high=100, absolute=0.2, relative=0.01),
    ),
)

REQUIREMENTS = (
    Requirement(
        id="T-010",
        rev=1,
        text="Ratio.",
        kind=Kind.LIMIT,
        limits=(Limit(parameter="ratio", unit="1", minimum="0.5", maximum="1.5", decision=Decision.SIMPLE),),
    ),
    Requirement(
        id="T-020",
        rev=1,
        text="Axes.",
        kind=Kind.LIMIT,
        limits=(Limit(parameter="rate", of=("x", "y"), unit="deg/s", maximum="0.5", decision=Decision.SIMPLE),),
    ),
    Requirement(
        id="T-030",
        rev=1,
        text="Record.",
        kind=Kind.RECORD,
        records=Records(recording="field", channels=("x", "y"), rate_hz=10.0, duration_s=1.0, max_gap_s=0.2),
    ),
    Requirement(
        id="T-040", rev=1, text="Answers.", kind=Kind.LIMIT, limits=(Limit(parameter="answers", equals="yes"),)
    ),
    Requirement(
        id="T-050",
        rev=1,
        text="Voltage.",
        kind=Kind.LIMIT,
        limits=(Limit(parameter="voltage", unit="V", minimum="4.9", maximum="5.1"),),
    ),
    Requirement(id="T-080", rev=1, text="Known.", kind=Kind.CHARACTERISE, limits=(Limit(parameter="noise", unit="V"),)),
)


class Written:
    """Takes events, and keeps them."""

    def __init__(self) -> None:
        self.events: list[dict[str, object]] = []

    def write(self, event: Event, *, beside: object = None) -> None:
        """Take one event."""
        self.events.append(msgspec.to_builtins(event) | ({"beside": beside} if beside else {}))

    def of(self, *kinds: str) -> list[dict[str, object]]:
        """Return the events of some kinds."""
        return [event for event in self.events if event["kind"] in kinds]


class Watch:
    """Takes what a scheduler reports."""

    def __init__(self) -> None:
        self.readings: list[tuple[str, float, float]] = []
        self.trips: list[object] = []
        self.losses: list[Distress] = []
        self.lates: list[tuple[str, float]] = []
        self.ticks = 0
        self.told: list[str] = []
        self.feeds: list[tuple[str, str]] = []

    def reading(self, limit: str, t: float, figure: Figure) -> None:
        """Take a reading."""
        self.readings.append((limit, t, figure.value))

    def fed(self, limit: str, recording: str) -> None:
        """Take a limit that a recording feeds."""
        self.feeds.append((limit, recording))

    def late(self, limit: str, seconds: float) -> None:
        """Take a late turn."""
        self.lates.append((limit, seconds))

    def trip(self, trip: object) -> None:
        """Take a trip."""
        self.trips.append(trip)

    def lost(self, distress: Distress) -> None:
        """Take a loss."""
        self.losses.append(distress)

    def safe(self) -> None:
        """Note the word."""
        self.told.append("safe")

    def give_up(self) -> None:
        """Note the word."""
        self.told.append("give up")

    def hold_as_recorded(self) -> None:
        """Hold nothing."""

    def tick(self) -> None:
        """Count."""
        self.ticks += 1


class Supply:
    """A supply's role in memory; `fault` is raised by its next operations where it is set."""

    def __init__(self, clock: VirtualClock | None = None) -> None:
        self.calls: list[tuple[str, tuple[object, ...]]] = []
        self.fault: Exception | None = None
        self.volts = 5.0
        self._clock = clock

    def _call(self, name: str, *arguments: object) -> None:
        self.calls.append((name, arguments))
        if self._clock:
            self._clock.sleep(0.01)
        if self.fault:
            raise self.fault

    def configure(self, voltage: float, current: float) -> None:
        """Take a setting."""
        self._call("configure", voltage, current)

    def disable(self) -> None:
        """Switch off."""
        self._call("disable")

    def voltage(self) -> Figure:
        """Return the voltage."""
        self._call("voltage")
        return Figure(value=self.volts, unit="V")

    def current(self) -> Figure:
        """Return a current that no certificate covers."""
        self._call("current")
        return Figure(value=0.1, unit="A")


class Magnetometer:
    """A magnetometer's role in memory: x counts samples, y is constant; it falls silent where `fault` is set."""

    def __init__(self, clock: VirtualClock, takes_s: float = 0.001) -> None:
        self.fault: Exception | None = None
        self.silent_from = 10**9
        self._clock = clock
        self._takes_s = takes_s
        self._samples = count()

    def channels(self) -> tuple[Channel, ...]:
        """Return two channels."""
        return Channel("x", "uT"), Channel("y", "uT")

    def sample(self) -> tuple[float, ...]:
        """Return the next sample."""
        number = next(self._samples)
        self._clock.sleep(self._takes_s)
        if self.fault and number >= self.silent_from:
            raise self.fault
        return float(number), -40.0


def limit(name="v", *, maximum=10.0, period=1.0, max_age=5.0, debounce=1, output="supply"):
    """Return a limit of the envelope."""
    return EnvelopeLimit(
        id=name,
        output=output,
        quantity="voltage",
        unit="V",
        minimum=None,
        maximum=maximum,
        period_s=period,
        max_age_s=max_age,
        debounce=debounce,
    )


def monitor(clock, spec, *, value=5.0, takes=0.004):
    """Return a monitor whose reading takes time; `value` may be a function that gives it, or raises."""

    def read() -> Figure:
        clock.sleep(takes)
        return Figure(value=value() if callable(value) else value, unit=spec.unit)

    return Monitor(spec, read, clock.now_ns())


def scheduler(clock, *monitors, flags=None, watch=None):
    """Return a scheduler that watches from now."""
    bench = SimpleNamespace(clock=clock, live=None, playback=None, speed=1.0, transcript=Transcript(None), ports=[])
    made = Scheduler(
        bench,
        monitors,
        flags or StopFlags(),
        watch or Watch(),
        timeline_of(bench, NoMachine(), SimpleNamespace(course=0)),
    )
    made.watch_from_now()
    return made


class Case:
    """A case with a supply and a magnetometer; `run` is what the executive keeps of it."""

    def __init__(
        self,
        folder: Path,
        *requirements: str,
        answers=None,
        recall=None,
        dut=False,
        hand=None,
        asked=(),
        watched=(),
        sample_s=0.001,
    ) -> None:
        """Make one; `asked` are more requirements, `watched` are limits, each with how long its reading takes [s]."""
        self.clock = VirtualClock()
        self.written = Written()
        self.flags = StopFlags()
        self.watch = Watch()
        self.supply = Supply()
        self.sensor = Magnetometer(self.clock, sample_s)
        monitors = [monitor(self.clock, spec, takes=takes) for spec, takes in watched]
        self.scheduler = scheduler(self.clock, *monitors, flags=self.flags, watch=self.watch)
        chosen = {item.id: item for item in (*REQUIREMENTS, *asked) if item.id in requirements or item in asked}
        self.requirements = chosen
        steps = Steps("plan/test_x.py::test_x", self.written, self.clock.now)
        effects = Effects(self.written, steps, recall, self.flags.undisturbed)
        (folder / "data/recordings").mkdir(parents=True)
        attachments = folder / "data/attachments"
        attachments.mkdir(parents=True)
        self.store = RowStore(folder, self.written)
        used: dict[str, str] = {}
        self.run = CaseRun(
            planned=PlannedCase(
                id=steps.case, title="A case", plan="plan", requirements=tuple(chosen), max_duration_s=60.0
            ),
            requirements=chosen,
            steps=steps,
            effects=effects,
            check=Checks(chosen, steps, self.written),
            record=Recorder(steps, self.scheduler, effects, self.store, Source.SIMULATED, tuple(chosen.values())),
            artifact=Artifacts(steps, effects, self.written, attachments, set()),
            chart=Charts(chosen, steps, self.written),
            operator=Operator(
                answers or Nobody(),
                effects,
                steps,
                self.written,
                Shelf(attachments, attachments, self.scheduler.point, set()),
                AtHand(instruments=hand or {}),
            ),
            scheduler=self.scheduler,
            escapes=Escapes(
                self.flags, Workspace(root=folder, name="", testplans=folder, fixtures=folder, reports=folder)
            ),
            journal=self.written,
            source=Source.SIMULATED,
            used=used,
        )
        self.instrument = InstrumentSpec(name="psu1", driver="none", calibration=CALIBRATION, dut=dut)
        sensor = InstrumentSpec(name="mag1", driver="none", calibration=CALIBRATION, dut=dut)
        wire = Wire(role="supply", instance="coil", instrument="psu1")
        self.coil = Facade(wire, self.instrument, self.supply, effects, self.run)
        wire = Wire(role="magnetometer", instance="", instrument="mag1")
        self.field = Facade(wire, sensor, self.sensor, effects, self.run)
