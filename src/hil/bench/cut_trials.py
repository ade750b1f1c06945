"""Low-energy trials of cut paths: a current flows, the path is taken, and the current stops."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

from hil.bench.bound import BoundBench
from hil.bench.gate import Gate
from hil.bench.safe_off import left_on
from hil.clock.port import NANOSECONDS
from hil.instruments.cycler_role import Cycler
from hil.instruments.roles import Relays, Supply
from hil.model.bench import Position, ReducedLevel, Wire
from hil.model.cutting import CutPath
from hil.model.errors import HilError
from hil.model.prefixed import prefixed

__all__ = ["cut_path_gates"]

_FLOWS_WITHIN_S = 2.0
_PAUSE_S = 0.1
_FLOWING_SHARE = 0.5
_LONGEST_TRIAL_S = 30.0
"""A slower watchdog is not tried at every arming."""

_HEADROOM_V = 0.05
"""A cell this close to the reduced level takes too little current to show anything."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trial:
    """A supply at its reduced level, connected through something that a cut path opens.

    Attributes:
        supply: the wire whose current is read.
        feeds: wires of further supplies that have to be on.
        position: the relays to move before, None if a cycler closes its own.
        cycler: the wire of the cycler that connects the supply to its cell; None if relays do.
    """

    supply: Wire
    feeds: tuple[Wire, ...] = ()
    position: Position | None = None
    cycler: Wire | None = None


def cut_path_gates(bench: BoundBench) -> Iterator[Gate]:
    """Try every cut path that can be tried at a reduced level, and report the ones that were not.

    Everything is off when a gate is yielded, or the gate fails.
    """
    for path in bench.spec.cut_paths:
        name = f"cut path of {path.output}: {path.means}"
        if reason := _untried(path):
            yield Gate(name, ok=True, detail=f"within {path.within_s:g} s; not tried: {reason}")
            continue
        trial = _trial_of(bench, path)
        if trial is None:
            proven = f"{path.by} was proven {path.state}" if path.by else f"within {path.within_s:g} s"
            yield Gate(name, ok=True, detail=f"{proven}; not tried: no measurement at low energy would show it")
            continue
        yield _tried(bench, path, trial, name)


def _untried(path: CutPath) -> str:
    if path.hardware:
        return "no software is part of it"
    return f"it takes longer than {_LONGEST_TRIAL_S:g} s" if path.watchdog and path.within_s > _LONGEST_TRIAL_S else ""


def _trial_of(bench: BoundBench, path: CutPath) -> _Trial | None:
    spec = bench.spec
    wire, by = spec.wire(path.output), spec.wire(path.by or path.watchdog)
    if wire.role == "supply" and wire.reduced and by.role == "relays":
        positions = (item for item in wire.reduced.positions if item.relays == by.name and item.conducts)
        closed = next((item for item in positions if item.closed), None)
        return _Trial(supply=wire, position=closed) if closed else None
    if wire.role == "supply" and wire.reduced and wire.charges == by.name:
        return _Trial(supply=wire, feeds=_feeds(bench, by), cycler=by)
    if wire.role == "cycler":
        charger = next((item for item in spec.wiring if item.charges == wire.name and item.reduced), None)
        if charger and by in _feeds(bench, wire):
            return _Trial(supply=charger, feeds=_feeds(bench, wire), cycler=wire)
    return None


def _feeds(bench: BoundBench, cycler: Wire) -> tuple[Wire, ...]:
    """Return the supplies without which the cycler's relays are open."""
    names = {path.by for path in bench.spec.cut_paths if path.output == cycler.name}
    return tuple(wire for wire in bench.spec.wiring if wire.name in names and wire.role == "supply" and wire.reduced)


def _tried(bench: BoundBench, path: CutPath, trial: _Trial, name: str) -> Gate:
    try:
        if trial.cycler and (reason := _cannot(bench, trial.cycler, trial.supply)):
            return Gate(name, ok=True, detail=f"not tried: {reason}")
        gate = _flow_and_cut(bench, path, trial, name)
    except HilError as error:
        gate = Gate(name, ok=False, detail=str(error))
    moved = {trial.supply.name, *(feed.name for feed in trial.feeds)}
    moved |= {trial.position.relays} if trial.position else set()
    moved |= {trial.cycler.name} if trial.cycler else set()
    problems = left_on([step for step in bench.spec.safe_off if step.output in moved], bench)
    return Gate(name, ok=False, detail="; ".join(problems)) if problems else gate


def _cannot(bench: BoundBench, cycler: Wire, charger: Wire) -> str:
    """Return why no current would flow into the cell, empty if one would."""
    role = cast("Cycler", bench.roles[cycler.name])
    if role.level() == "1":
        return "a device of level 1 runs whole tests only"
    volts, level = role.voltage().value, cast("ReducedLevel", charger.reduced).voltage
    if volts > level - _HEADROOM_V:
        return f"the cell has {volts:.3f} V, so no current flows into it at {level:g} V"
    return ""


def _flow_and_cut(bench: BoundBench, path: CutPath, trial: _Trial, name: str) -> Gate:
    level = cast("ReducedLevel", trial.supply.reduced)
    if trial.position:
        relays = cast("Relays", bench.roles[trial.position.relays])
        relays.release_all()
        for contact in trial.position.closed:
            relays.close(contact)
    for wire in (*trial.feeds, trial.supply):
        _on(bench, wire)
    if trial.cycler:
        cycler = cast("Cycler", bench.roles[trial.cycler.name])
        cycler.prepare(1)
        cycler.start()
    least = level.current * _FLOWING_SHARE if trial.cycler else level.lowest_current
    before = _current(bench, trial.supply, _FLOWS_WITHIN_S, lambda amperes: amperes >= least)
    if before < least:
        detail = f"{prefixed(before, 'A')} before the cut, expected at least {least:g} A: check load and contacts"
        return Gate(name, ok=False, detail=detail)
    start_ns = bench.clock.now_ns()
    taken = [step for step in bench.spec.safe_off if step.output == path.by]  # a watchdog only has to be left alone
    if problems := left_on(taken, bench):
        return Gate(name, ok=False, detail="; ".join(problems))
    most = level.highest_current if trial.cycler else level.lowest_current
    within_s = path.within_s * max(1.0, bench.speed)  # as of the safe-off, see `make_safe`
    left_s = within_s - (bench.clock.now_ns() - start_ns) / NANOSECONDS
    after = _current(bench, trial.supply, left_s, lambda amperes: abs(amperes) <= most)
    seconds = (bench.clock.now_ns() - start_ns) / NANOSECONDS
    detail = f"{prefixed(before, 'A')} before the cut, {prefixed(after, 'A')} after {seconds:.2g} s"
    if not abs(after) <= most:
        return Gate(
            name,
            ok=False,
            detail=f"{detail}: it does not cut {path.output} off; check for a welded contact and the wiring",
        )
    if seconds > within_s:
        return Gate(name, ok=False, detail=f"{detail}, {within_s:g} s allowed")
    return Gate(name, ok=True, detail=detail)


def _on(bench: BoundBench, wire: Wire) -> None:
    level, supply = cast("ReducedLevel", wire.reduced), cast("Supply", bench.roles[wire.name])
    supply.configure(level.voltage, level.current)
    supply.enable()


def _current(bench: BoundBench, wire: Wire, within_s: float, enough: Callable[[float], bool]) -> float:
    """Read a supply's current [A] until it is as expected or time is up, and return the last reading."""
    supply = cast("Supply", bench.roles[wire.name])
    deadline_ns = bench.clock.now_ns() + round(max(within_s, 0.0) * NANOSECONDS)
    while True:
        amperes = supply.current().value
        if enough(amperes) or bench.clock.now_ns() >= deadline_ns:
            return amperes
        bench.clock.sleep(_PAUSE_S)
