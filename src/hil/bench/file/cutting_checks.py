"""Checks of cut paths, of battery charging, and of the watch after a run."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.connections import can_harm, charges_a_battery, hazardous_wires, line_of, paths_of
from hil.bench.file.complaints import Complaints, known, listed, quantity_of
from hil.instruments.driver import OVER_VOLTAGE_LEVEL, offers
from hil.instruments.registry import DRIVERS
from hil.model.bench import BenchSpec, Wire
from hil.model.cutting import CutPath, WatchAfter
from hil.model.notation import Path

__all__ = ["charging", "cut_off", "cut_paths", "watched_after"]


def charging(spec: BenchSpec) -> Complaints:
    """Check that every battery has a charger, and that something other than its setting limits the voltage.

    The first guard is the supply's own over-voltage protection. If that has no level of its own, so that a wrong
    setting would raise it too, the cycler's measurement in the envelope has to be the guard.
    """
    cyclers = [wire.name for wire in spec.wiring if wire.role == "cycler"]
    charged = {wire.charges for wire in spec.wiring}
    for at, wire in listed("wiring", spec.wiring):
        if wire.role == "cycler" and wire.name not in charged:
            yield at, f"{wire.name}: no supply charges its battery; write 'charges: {wire.name}' at the one that does"
        if wire.charges:
            yield from known(at, "cycler", wire.charges, cyclers)
            for problem in _problems(spec, wire):
                yield at, f"{wire.name} {problem}"


def _problems(spec: BenchSpec, wire: Wire) -> Iterator[str]:
    if wire.role != "supply":
        yield "cannot charge: only a supply can"
        return
    drivers = [item.driver for item in spec.instruments if item.name == wire.instrument]
    if not drivers or drivers[0] not in DRIVERS:
        return
    if offers(DRIVERS[drivers[0]], OVER_VOLTAGE_LEVEL):
        if "over_voltage" not in wire.settings:
            yield "charges a battery: give it the setting over_voltage, little above the highest voltage of the battery"
    elif not _measured(spec, wire.charges):
        yield (
            f"charges a battery, and a {drivers[0]} has no over-voltage protection with a level of its own: add a"
            f" second guard, a limit of the envelope with max on the voltage of {wire.charges}"
        )


def _measured(spec: BenchSpec, cycler: str) -> bool:
    """Return whether the envelope limits the battery's voltage."""
    return any(
        (limit.output, limit.quantity, limit.is_derived) == (cycler, "voltage", False) and limit.maximum is not None
        for limit in spec.envelope
    )


def cut_paths(spec: BenchSpec) -> Complaints:
    """Check that every cut path can be taken, and does not go through the port of the output that it cuts off."""
    outputs = [wire.name for wire in spec.wiring]
    seen: set[tuple[str, str]] = set()
    for at, path in listed("cut_paths", spec.cut_paths):
        yield from known(at, "output", path.output, outputs)
        yield from known(at, "output", path.by, outputs)
        yield from known(at, "output", path.watchdog, outputs)
        for problem in _path_problems(spec, path):
            yield at, f"cut path of {path.output}: {problem}"
        if path.output and path.means and (path.output, path.means) in seen:
            yield at, f"cut path of {path.output}: {path.means} is given twice"
        seen.add((path.output, path.means))


def _path_problems(spec: BenchSpec, path: CutPath) -> Iterator[str]:
    if [bool(path.by), bool(path.watchdog), bool(path.hardware)].count(True) != 1:
        yield (
            "it needs one of by, an output whose safe state cuts it off, watchdog, an output whose instrument opens"
            " without a heartbeat, and hardware, in words"
        )
    if path.state and not path.by:
        yield "only 'by' has a state; leave it out"
    if path.by:
        yield from _by_problems(spec, path)


def _by_problems(spec: BenchSpec, path: CutPath) -> Iterator[str]:
    wires = {wire.name: wire for wire in spec.wiring}
    if path.by not in wires:
        return
    states = {step.output: step.state for step in spec.safe_off}
    if path.by not in states:
        yield f"{path.by} is missing from safe_off, so that nothing brings it to '{path.state}'"
    elif not path.state:
        yield f"write 'state: {states[path.by]}', the safe state of {path.by}"
    elif states[path.by] != path.state:
        yield f"safe_off brings {path.by} to '{states[path.by]}', not to '{path.state}'"
    if path.output in wires and path.by == path.output:
        yield "an output does not cut itself off"
    elif path.output in wires and _one_line(spec, wires[path.output].instrument, wires[path.by].instrument):
        yield f"{path.by} is on the same port, and is lost with it"


def _one_line(spec: BenchSpec, one: str, other: str) -> bool:
    names = {item.name for item in spec.instruments}
    return {one, other} <= names and line_of(spec, one) == line_of(spec, other)


def cut_off(spec: BenchSpec) -> Complaints:
    """Check that nothing that can do harm depends on one port alone."""
    names = {item.name for item in spec.instruments}
    battery = charges_a_battery(spec)
    for at, wire in listed("wiring", spec.wiring):
        if not wire.hazardous and not can_harm(wire):
            yield at, f"{wire.name}: only what drives something can be marked as not hazardous"
        if not wire.hazardous and wire.charges:
            yield at, f"{wire.name} charges a battery, which is hazardous"
    hazardous = {wire.name for wire in hazardous_wires(spec)}
    for at, wire in listed("wiring", spec.wiring):
        if wire.name not in hazardous or wire.instrument not in names or _paths(spec, wire.name):
            continue
        if battery:
            yield (
                at,
                (
                    f"{wire.name} has only one path, its own port, and this bench charges a battery: give it a line in"
                    " cut_paths that opens it when that port is gone"
                ),
            )
        else:
            yield (
                at,
                (
                    f"{wire.name} has no cut path: say in cut_paths what opens it when its own port is gone, or mark"
                    " the wire 'hazardous: false' where it can do no harm"
                ),
            )


def _paths(spec: BenchSpec, output: str) -> bool:
    wired = {wire.name for wire in spec.wiring}
    names = {item.name for item in spec.instruments}
    if any(path.by and path.by not in wired for path in spec.cut_paths):
        return True  # reported with the other wire
    if any(path.by and spec.wire(path.by).instrument not in names for path in spec.cut_paths):
        return True
    return bool(paths_of(spec, output))


def watched_after(spec: BenchSpec) -> Complaints:
    """Check that what is watched after the safe-off can be read, and can hold."""
    outputs = [wire.name for wire in spec.wiring]
    seen: set[tuple[str, str]] = set()
    for at, watch in listed("watch_after", spec.watch_after):
        yield from known(at, "output", watch.output, outputs)
        yield from quantity_of(at, watch.output, watch.quantity, watch.unit)
        yield from _watch_keys(at, watch)
        if watch.minimum is not None and watch.maximum is not None and watch.minimum > watch.maximum:
            yield at, f"watch_after of {watch.output}: min {watch.minimum:g} is above max {watch.maximum:g}"
        if (watch.output, watch.quantity) in seen:
            yield at, f"watch_after of {watch.output}: its {watch.quantity} is watched twice"
        seen.add((watch.output, watch.quantity))


def _watch_keys(at: Path, watch: WatchAfter) -> Complaints:
    between = {"min": watch.minimum, "max": watch.maximum, "for": watch.for_s}
    toward = {"tolerance": watch.tolerance, "within": watch.within_s}
    needed, other = (between, toward) if watch.toward is None else (toward, between)
    kind = "what stays between bounds" if watch.toward is None else "what goes toward a value"
    for key in (key for key, value in needed.items() if value is None):
        yield at, f"watch_after of {watch.output}: {kind} needs '{key}'"
    for key in (key for key, value in other.items() if value is not None):
        yield (*at, key), f"watch_after of {watch.output}: {kind} takes no '{key}'"
