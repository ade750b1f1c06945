"""Visits to a bench outside runs: check it, try its outputs, or make it safe."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from hil.bench.binding import bind_simulated, check_twin, simulated_twin
from hil.bench.bound import BoundBench
from hil.bench.file.reading import load_bench
from hil.bench.gate import Gate
from hil.bench.lease import Lease, refuse_latched
from hil.bench.live import Opened, bind_live
from hil.bench.port_identity import WrongPort, strangers_on_network
from hil.bench.safe_off import SafeResult, make_safe, watch_after
from hil.bench.serving import ServedEnds, served
from hil.clock import wall
from hil.evidence.events import NOTHING, Anomaly, Event, EventSink
from hil.evidence.folder import GUARDIAN
from hil.executive.ending.signals import Alarm, handle_signals
from hil.executive.ending.stop import StopFlags
from hil.executive.setup.configuration import reach_of
from hil.executive.setup.workspace import Workspace, find_workspace
from hil.executive.watching.arming import FIRST_ARMING, ArmedBench
from hil.executive.watching.machine import LiveMachine, live_machine
from hil.executive.watching.ports import Machine, NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.timeline import Timeline
from hil.model.bench import BenchSpec
from hil.model.errors import DeviceFault, Refused
from hil.model.identity import Source
from hil.wire.transcript import Transcript

__all__ = ["Checked", "check_bench", "safe_bench", "serve_bench"]

_VISITS = ".visits"
_PAUSES_S = (0.2, 0.7, 1.3)
"""Pauses before lines are retried while another process polls the instruments; unequal, so as not to stay in step."""

GateSink = Callable[[Gate], None]
"""Takes a gate as soon as it is known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """Result of a bench check.

    Attributes:
        ready: whether every gate holds.
        safe: whether every output was proven safe in the end, if any was driven.
        stopped: who or what requested a stop, empty if nobody did.
    """

    ready: bool
    safe: bool = True
    stopped: str = ""


def check_bench(
    start: Path, name: str, source: Source, *, energise: bool, served: Path | None = None, tell: GateSink
) -> Checked:
    """Check the readiness gates of a bench; without `energise`, or if one does not hold, nothing is driven.

    If a port is missing, or belongs to another board, only that is reported. A latch is a gate that does not hold.
    With `energise` the bench is guarded, and left, as in a run: see `ArmedBench`.

    Args:
        start: the folder from which the workspace is searched for.
        name: the bench's name.
        source: hardware or simulated.
        energise: whether outputs are tried at their reduced level.
        served: the folder in which another process serves the bench.
        tell: called with every gate.

    Raises:
        Refused: for an unknown bench, one held by a run, or a latched one that is to be driven.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    with ExitStack() as stack:
        flags = StopFlags()
        alarm = stack.enter_context(handle_signals(flags)) if energise else None
        try:
            visit = stack.enter_context(_visit(start, name, source, served, driven=energise))
        except WrongPort as error:
            return _checked(error.gates, tell)
        except DeviceFault as error:
            return _checked([Gate(f"port of {error.device}", ok=False, detail=str(error))], tell)
        if alarm is not None:
            return _energised(visit, flags, alarm, tell)
        look = ArmedBench(visit.bench, None, flags, NoMachine()).look()
        return _checked(chain(look, _latch_gates(visit.bench.spec, source, served)), tell)


def _checked(gates: Iterable[Gate], tell: GateSink) -> Checked:
    ready = True
    for gate in gates:
        tell(gate)
        ready = ready and gate.ok
    return Checked(ready=ready)


def _energised(visit: _Visit, flags: StopFlags, alarm: Alarm, tell: GateSink) -> Checked:
    """Arm the bench, and leave it; whatever happens in between, it is made safe, proven safe, and watched."""
    bench = visit.bench
    with visit.tenancy(tell) as tenant:
        machine: Machine = NoMachine()
        if bench.live is not None:
            machine = live = live_machine(bench, bench.live, flags, tenant, visit.workspace.inhibitor)
            alarm.keep(_Heartbeat(live))
        armed = ArmedBench(bench, None, flags, machine, thorough=True)
        course = _Unwatched(timeline_of(bench, machine, _Uneventful()))
        left: list[str] = []
        try:
            refusal = armed.arm(FIRST_ARMING, course, lambda gate, _: tell(gate))
        finally:
            if armed.touched:
                armed.switch_off()
                course.come()  # time taken by people or the guardian's drill does not count for the safe-off
                left += armed.make_safe(lambda _: None)
            left += armed.let_go()
            if armed.touched:
                left += _watched_afterwards(bench, flags, tell)
                armed.unsafe = bool(left)
            armed.latch("the check could not prove the bench safe")
        if armed.touched:
            tell(Gate("safe at the end", ok=not left, detail="; ".join(left) or "every line of safe_off is proven"))
        return Checked(ready=not (refusal or left), safe=not left, stopped=flags.reason)


def _watched_afterwards(bench: BoundBench, flags: StopFlags, tell: GateSink) -> list[str]:
    """Watch what was made safe, as after a run; return what did not stay safe."""
    wrong: list[str] = []

    def take(result: SafeResult) -> None:
        tell(Gate(f"{result.output} afterwards", ok=result.ok, detail=result.detail))
        if not result.ok:
            wrong.append(f"{result.output}: {result.detail}")

    with flags.shielded():
        watch_after(bench.spec.watch_after, bench.roles, bench.clock, lambda *_: None, take)
    return wrong


class _Heartbeat:
    """Heartbeat of a visit to the guardian during long exchanges with slow instruments, as in a run."""

    def __init__(self, machine: LiveMachine) -> None:
        self.between = machine.between

    def attend(self, alone_s: float, silent_s: float) -> None:
        """Do nothing: no case is running."""


class _Unwatched:
    """Course of a bench that no monitor watches: its outputs are tried, and read, one at a time."""

    fresh_until_ns = None

    def __init__(self, timeline: Timeline) -> None:
        self.timeline = timeline
        self.come = timeline.come


class _Uneventful:
    """Course of a visit, which is not recorded."""

    course = 0


def _latch_gates(spec: BenchSpec, source: Source, served: Path | None) -> Iterator[Gate]:
    reach = reach_of(spec, source, served)
    try:
        refuse_latched(reach.leases if reach else ())
    except Refused as error:
        yield Gate("not latched", ok=False, detail=str(error))


def safe_bench(
    start: Path, name: str, source: Source, *, served: Path | None = None, tell: Callable[[str], None]
) -> list[SafeResult]:
    """Execute every line of a bench's safe-off and return the result of each; see `check_bench`.

    A bench can be made safe even if a process holds it, and even if an instrument cannot be reached or another one
    answers in its place: its lines are then not proven. The holder of the bench is reported.
    """
    results: list[SafeResult] = []
    held: list[str] = []

    def by_force(holder: str) -> None:
        held.append(holder)
        tell(holder)

    with handle_signals(StopFlags()), _visit(start, name, source, served, by_force=by_force) as visit:  # to its end
        bench, strangers = visit.bench, strangers_on_network(visit.bench)
        for step in bench.spec.safe_off:
            if (name := bench.spec.wire(step.output).instrument) in strangers:
                detail = f"not driven: another instrument answers at the port of {name}: {strangers[name]}"
                results.append(SafeResult(step.output, step.state, ok=False, detail=detail, seconds=0.0))
            else:
                make_safe([step], bench.roles, bench.clock, results.append, speed=bench.speed)
        for pause_s in _PAUSES_S if held else ():
            _prove_again(bench, results, strangers, pause_s)
    return results


def _prove_again(bench: BoundBench, results: list[SafeResult], strangers: Collection[str], pause_s: float) -> None:
    """Retry lines that were not proven: the process that holds the bench may have read their replies."""
    if all(result.ok for result in results):
        return
    bench.clock.sleep(pause_s * bench.speed)
    for place, step in enumerate(bench.spec.safe_off):
        if not results[place].ok and bench.spec.wire(step.output).instrument not in strangers:
            again: list[SafeResult] = []
            make_safe([step], bench.roles, bench.clock, again.append, speed=bench.speed)
            results[place] = again[0]


@contextmanager
def serve_bench(start: Path, name: str, folder: Path, *, speed: float, first_port: int) -> Iterator[ServedEnds]:
    """Open the ends of a simulated bench for other processes, until the context is left.

    Raises:
        Refused: for an unknown bench, one without a simulated twin, or a folder or port that is not available.
        ConfigurationError: with everything that is wrong with the bench file.
    """
    with served(_simulated(start, name), folder, speed=speed, first_port=first_port) as ends:
        yield ends


@dataclass(frozen=True, slots=True)
class _Visit:
    """A visited bench, with its leases."""

    workspace: Workspace
    bench: BoundBench
    lease: Lease
    leases: Sequence[str]

    @contextmanager
    def tenancy(self, tell: GateSink) -> Iterator[_Tenant]:
        """Give the visit a name and a folder for what the guardian may have to write; both are removed if unused."""
        name = f"{wall.compact_utc()}-{self.bench.spec.name}-check-{secrets.token_hex(3)}"
        folder = self.workspace.reports / _VISITS / name
        journal = folder / GUARDIAN
        if self.bench.live is not None:
            try:
                journal.parent.mkdir(parents=True)
            except OSError as error:
                hint = "the guardian writes there what it does; check who may write in it"
                raise Refused(f"{folder} cannot be made: {error.strerror}", hint) from error
        self.lease.name(name)
        try:
            yield _Tenant(folder, self.leases, self.lease, _Anomalies(tell))
        finally:
            with suppress(OSError):
                for made in (journal.parent, folder, folder.parent):
                    made.rmdir()


@dataclass(frozen=True, slots=True)
class _Tenant:
    """See `hil.executive.watching.ports.Tenant`."""

    folder: Path
    leases: Sequence[str]
    lease: Lease
    events: EventSink


class _Anomalies:
    """Event sink of a visit: anomalies are reported to the person, anything else is dropped."""

    def __init__(self, tell: GateSink) -> None:
        self._tell = tell

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Report an anomaly."""
        del beside
        if isinstance(event, Anomaly):
            self._tell(Gate("afterwards", ok=False, detail=event.text))


@contextmanager
def _visit(
    start: Path,
    name: str,
    source: Source,
    served: Path | None,
    *,
    driven: bool = False,
    by_force: Callable[[str], None] | None = None,
) -> Iterator[_Visit]:
    spec = _simulated(start, name) if source is Source.SIMULATED else _read(start, name)
    reach = reach_of(spec, source, served)
    with ExitStack() as stack:
        leases = reach.leases if reach else []
        lease = _leased(leases, by_force)
        stack.callback(lease.release)
        if reach is None:
            bench = bind_simulated(spec, Transcript(None))
        else:
            if driven:
                refuse_latched(leases)
            opened = Opened(spec, reach, by_force=by_force is not None)
            bench = bind_live(spec, reach, wall.utc_now(), Transcript(None), opened)
        stack.callback(bench.close)
        yield _Visit(find_workspace(start), bench, lease, leases)


def _leased(keys: Sequence[str], by_force: Callable[[str], None] | None) -> Lease:
    """Take the bench's leases; by force, continue without them, and report who has them."""
    try:
        return Lease(keys, "hil bench")
    except Refused as error:
        if by_force is None:
            raise
        by_force(str(error))
        return Lease((), "hil bench")


def _read(start: Path, name: str) -> BenchSpec:
    workspace = find_workspace(start)
    return load_bench(workspace.benches, name, workspace.root)


def _simulated(start: Path, name: str) -> BenchSpec:
    """Return a bench file whose simulated twin has been checked."""
    workspace = find_workspace(start)
    spec = load_bench(workspace.benches, name, workspace.root, twin=check_twin)
    simulated_twin(spec)
    return spec
