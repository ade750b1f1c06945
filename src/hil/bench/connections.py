"""Connections of an instrument: its line, the clamps on its outputs, and their cut paths if the line is dead."""

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
    """Return the instrument that serves another one's bus, None if the bus or port is the host's own."""
    name = next((bus.instrument for bus in spec.buses if bus.name == instrument.bus), "")
    return spec.instrument(name) if name else None


def servers_first(spec: BenchSpec) -> list[InstrumentSpec]:
    """Return the instruments in file order, but each after the one that serves its bus."""

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
    """Return the instrument on the host's own port or bus through which everything sent to this one passes."""
    found = spec.instrument(instrument)
    while server := server_of(spec, found):
        found = server
    return found.bus or found.name


def hazardous_wires(spec: BenchSpec) -> tuple[Wire, ...]:
    """Return the wires whose outputs must not stay on when they cannot be reached."""
    return tuple(wire for wire in spec.wiring if wire.hazardous and can_harm(wire))


def can_harm(wire: Wire) -> bool:
    """Return whether outputs of the wire's role can do harm, whatever the bench file says about this wire."""
    role = ROLES.find(wire.role)
    return role is not None and role.hazardous


def charges_a_battery(spec: BenchSpec) -> bool:
    """Return whether one of the supplies charges a battery."""
    return any(wire.charges for wire in spec.wiring)


def paths_of(spec: BenchSpec, output: str) -> dict[str, CutPath]:
    """Return the independent cut paths of one output, by the port that each goes through, or by its description.

    A path through the output's own port does not count, and two through one port count once: a dead line is dead for
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
    """Return, for every output that can do harm, what opens it first if run and guardian both end, or None.

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
    """Return a sentence for every output that can do harm and has too few independent cut paths.

    Args:
        spec: the bench file; it was checked.
        least: the number that each needs in addition to its own port.
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
