"""How an instrument is reached, how far its outputs may be set, and what cuts them off when their own port is gone."""

from __future__ import annotations

from hil.instruments.driver import Clamps
from hil.instruments.registry import ROLES
from hil.model.bench import BenchSpec, InstrumentSpec, Wire
from hil.model.cutting import CutPath

__all__ = [
    "can_harm",
    "charges_a_battery",
    "clamps_of",
    "cut_path_shortfall",
    "hazardous_wires",
    "line_of",
    "paths_of",
    "server_of",
    "servers_first",
    "stays_on",
]


def server_of(spec: BenchSpec, instrument: InstrumentSpec) -> InstrumentSpec | None:
    """Return the instrument that serves the bus of another one, None if the bus or port is the host's own."""
    name = next((bus.instrument for bus in spec.buses if bus.name == instrument.bus), "")
    return spec.instrument(name) if name else None


def servers_first(spec: BenchSpec) -> list[InstrumentSpec]:
    """Return the instruments in the file's order, but none before the one that serves its bus."""

    def depth(instrument: InstrumentSpec) -> int:
        server = server_of(spec, instrument)
        return depth(server) + 1 if server else 0

    return sorted(spec.instruments, key=depth)


def clamps_of(spec: BenchSpec, instrument: str) -> Clamps:
    """Return the clamps on one instrument's outputs."""
    by_channel = {
        wire.channel: tuple(clamp for clamp in spec.clamps if clamp.output == wire.name)
        for wire in spec.wiring
        if wire.instrument == instrument
    }
    return Clamps(by_channel)


def line_of(spec: BenchSpec, instrument: str) -> str:
    """Return the instrument of the host's own whose port or bus carries everything that is sent to one instrument."""
    found = spec.instrument(instrument)
    while server := server_of(spec, found):
        found = server
    return found.bus or found.name


def hazardous_wires(spec: BenchSpec) -> tuple[Wire, ...]:
    """Return the wires whose outputs must not stay on when nobody can reach them."""
    return tuple(wire for wire in spec.wiring if wire.hazardous and can_harm(wire))


def can_harm(wire: Wire) -> bool:
    """Return whether the wire's role is one whose outputs can do harm, whatever the bench file says of this one."""
    role = ROLES.find(wire.role)
    return role is not None and role.hazardous


def charges_a_battery(spec: BenchSpec) -> bool:
    """Return whether one of the supplies charges a battery."""
    return any(wire.charges for wire in spec.wiring)


def paths_of(spec: BenchSpec, output: str) -> dict[str, CutPath]:
    """Return the cut paths of one output that do not share anything: by the port that they go through, or in words.

    A path through the output's own port is none, and two through one port are one: a line that is dead is dead for
    both.

    Args:
        spec: the bench file; it was checked.
        output: dotted name of a wire.
    """
    own = line_of(spec, spec.wire(output).instrument)
    found: dict[str, CutPath] = {}
    for path in spec.cut_paths:
        if path.output != output:
            continue
        through = line_of(spec, spec.wire(path.by).instrument) if path.by else path.means
        if through != own:
            found.setdefault(through, path)
    return found


def stays_on(spec: BenchSpec) -> dict[str, CutPath | None]:
    """Return, for every output that can do harm, what opens it first if run and guardian end at once; None if nothing.

    Args:
        spec: the bench file; it was checked.
    """
    keepers = [path for path in spec.cut_paths if not path.needs_host]
    found: dict[str, CutPath | None] = {}
    for wire in hazardous_wires(spec):
        own = [path for path in keepers if path.output == wire.name]
        found[wire.name] = min(own, key=lambda path: path.within_s, default=None)
    return found


def cut_path_shortfall(spec: BenchSpec, least: int) -> list[str]:
    """Return a sentence for every output that can do harm and has fewer independent cut paths, nothing if none is.

    Args:
        spec: the bench file; it was checked.
        least: how many each needs in addition to its own port.
    """
    told = []
    for wire in hazardous_wires(spec):
        paths = paths_of(spec, wire.name)
        if len(paths) < least:
            there = " and ".join(path.means for path in paths.values())
            have = f"{len(paths)}: {there}" if paths else "none"
            told.append(
                f"{wire.name} needs {least} cut path{'s' * (least > 1)} in addition to its own port, it has {have}"
            )
    return told
