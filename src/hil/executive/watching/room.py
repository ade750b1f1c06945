"""Room for a plan's recordings: what cannot be met on this bench is refused before anything is energised."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

from hil.bench.bound import BoundBench
from hil.bench.envelope import Monitor
from hil.bench.gate import Gate
from hil.clock.port import NANOSECONDS
from hil.executive.setup.head import PlannedCase
from hil.executive.watching.feeding import OFTEN
from hil.executive.watching.monitoring import Monitoring
from hil.executive.watching.sharing import ENOUGH, Pace, refusal
from hil.instruments.registry import ROLES
from hil.instruments.sampled import ReadBacks, Sampled
from hil.model.bench import Wire
from hil.model.errors import HilError
from hil.requirements.requirement import Records, Requirement

__all__ = ["Asked", "asked_of", "room_gate"]

_NAME = "room for recordings"


@dataclass(frozen=True, slots=True)
class Asked:
    """A recording that a case must take, with a rate or a longest gap.

    Attributes:
        requirement: the id of the requirement that asks for it.
        records: what it asks for.
        fixtures: the fixtures that the case needs, including roles.
    """

    requirement: str
    records: Records
    fixtures: frozenset[str]


def asked_of(
    cases: Iterable[PlannedCase], left_out: Container[str], requirement: Callable[[str], Requirement]
) -> list[Asked]:
    """Return the recordings that cases must take.

    Args:
        cases: all planned cases.
        left_out: the ids of those that will not be run.
        requirement: returns the catalogue's entry for an id.
    """
    found = dict[Asked, None]()
    for case in cases:
        for name in () if case.id in left_out else case.requirements:
            if (records := requirement(name).records) and (records.rate_hz or records.max_gap_s):
                found[Asked(name, records, case.fixtures)] = None
    return list(found)


@dataclass(frozen=True, slots=True)
class _Sampled:
    """A recording of a sampled role: who asks for it, its pace, and the limits that are read beside it."""

    requirement: str
    wire: Wire
    sampled: Sampled
    pace: Pace
    beside: Sequence[Monitor]

    @property
    def within(self) -> list[Monitor]:
        """The limits that must be read before its last sample."""
        return [each for each in self.beside if each.allowed_ns < self.pace.lasts_ns]


def room_gate(bench: BoundBench, monitoring: Monitoring, asked: Iterable[Asked]) -> Iterator[Gate]:
    """Time readings and samples, and check that rate, gap and maximum ages of recordings can all be met.

    Only sampled roles count, and only recordings longer than a limit may go without a reading: for all others there is
    room before their first sample. The rate is the one that the requirement asks for: that of the case is known only
    when the case gets there. The device under test is not sampled here, nor anything that the bench has to feed
    first; their samples count as taking no time.
    """
    tight = [each for each in _sampled(bench, monitoring.all, asked) if each.within]
    if not tight:
        return
    fed = {each.name for each in bench.spec.instruments if each.powered_by}
    for monitor in dict.fromkeys(monitor for each in tight for monitor in each.within):
        if monitor.derivation is None and bench.spec.wire(monitor.limit.output).instrument not in fed:
            _repeated(bench, monitor.read_once, monitor.lasted)
    for each in {each.wire.name: each for each in tight}.values():
        if not bench.spec.instrument(each.wire.instrument).dut and each.wire.instrument not in fed:
            _repeated(bench, each.sampled.sample, partial(monitoring.bus.sampled, each.wire.name))
    told, ok = [], True
    for each in tight:
        pace = replace(each.pace, sample_ns=monitoring.bus.proven_ns(each.wire.name))
        problem = refusal(pace, each.beside)
        ok = ok and not problem
        told.append(f"'{pace.name}' of {each.requirement}: {problem or _found(pace, each.within)}")
    yield Gate(_NAME, ok=ok, detail="; ".join(told))


def _repeated(bench: BoundBench, call: Callable[[], object], lasted: Callable[[int], None]) -> None:
    """Time a call as often as needed; one that does not answer is reported where it is used."""
    with suppress(HilError):
        for _ in range(ENOUGH):
            began_ns = bench.clock.now_ns()
            call()
            lasted(bench.clock.now_ns() - began_ns)


def _sampled(bench: BoundBench, monitors: Sequence[Monitor], asked: Iterable[Asked]) -> Iterator[_Sampled]:
    """Yield the recordings that only one role of the bench can provide, if that one is sampled."""
    for each in asked:
        records, wires = each.records, [wire for wire in bench.spec.wiring if wire.role in each.fixtures]
        found = [(wire, role) for wire in wires if (role := _role(bench, wire, records)) is not None]
        if len(found) != 1 or hasattr(bench.roles[found[0][0].name], "drain"):
            continue
        (wire, sampled), gap_s = found[0], records.max_gap_s
        period_ns = round(NANOSECONDS / records.rate_hz if records.rate_hz else NANOSECONDS * (gap_s or 0))
        lasts_ns = round((records.duration_s or 0) * NANOSECONDS)
        pace = Pace(
            name=records.recording,
            period_ns=period_ns,
            sample_ns=0,
            count=max(1, lasts_ns // period_ns) if lasts_ns else None,
            gap_ns=round(gap_s * NANOSECONDS) if gap_s else None,
        )
        channels = {(channel.name, channel.unit) for channel in sampled.channels()}
        beside = [
            monitor
            for monitor in monitors
            if monitor.limit.output != wire.name
            or (monitor.limit.quantity, monitor.limit.unit) not in channels
            or monitor.limit.period_s * NANOSECONDS < OFTEN * period_ns
        ]
        yield _Sampled(each.requirement, wire, sampled, pace, beside)


def _role(bench: BoundBench, wire: Wire, records: Records) -> Sampled | None:
    """Return a role for sampling if it has the channels that a requirement asks for; otherwise None."""
    filled = bench.roles[wire.name]
    if hasattr(filled, "blocks"):
        return None
    if not hasattr(filled, "sample"):
        filled = ReadBacks(ROLES[wire.role], filled)
    sampled: Sampled = filled  # type: ignore[assignment]  # the attribute was checked
    names = {channel.name for channel in sampled.channels()}
    return sampled if names and names.issuperset(records.channels) else None


def _found(pace: Pace, within: Sequence[Monitor]) -> str:
    """Return what was measured, if there is room."""
    sample = f"a sample takes {pace.sample_ns / 1e6:.4g} ms, " if pace.sample_ns else ""
    readings = ", ".join(f"{each.limit.id} {each.least_room_ns / 1e6:.4g} ms" for each in within)
    return f"{sample}one is due every {pace.period_ns / 1e6:.4g} ms; with a quarter to spare, readings take: {readings}"
