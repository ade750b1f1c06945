"""The world of a served bench: its clock and lines, and fault injection at run time."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from math import isfinite
from typing import TypeVar

from hil.clock.virtual import VirtualClock
from hil.model.bench import BenchSpec, PeerSpec, SimulatedBench
from hil.model.errors import Refused
from hil.simulation.faults import Fault
from hil.simulation.plants.plant import Plant
from hil.simulation.served.ends import ServedLine
from hil.simulation.truth import TruthError, declared, suggestion
from hil.simulation.world import World, build_world

__all__ = ["ServedBench", "true_state"]


class ServedBench:
    """Plants, peers and lines of one simulated bench, which can be given another fault at any moment.

    Args:
        spec: the bench file.
        twin: its simulated part.

    Raises:
        TruthError: if a truth of plants or peers is wrong.

    Attributes:
        spec: the bench file.
        clock: the bench's clock; another one after a fault was injected.
        world: plants and peers; likewise.
        lines: the byte streams by instrument, always the same ones.
    """

    def __init__(self, spec: BenchSpec, twin: SimulatedBench) -> None:
        self.spec = spec
        self._twin = twin
        self.lines = {item.name: ServedLine(item.name, item.baud) for item in spec.instruments if not item.bus}
        self.clock = VirtualClock(twin.epoch)
        self.world = self._build(twin, self.clock)
        self._connect()

    def inject(self, device: str, row: Mapping[str, object]) -> None:
        """Add a fault to a device: a row as in the bench file, but `from` and `until` count from now.

        The world is rebuilt with the fault in its bench file, at this instant, and continues from the state of the
        old one, as that of a resumed run does. So whatever can go wrong from the start on can go wrong later, and no
        peer has to know that faults may come while it lives.

        Raises:
            Refused: if there is no such device or fault; the world then continues as it was.
        """
        names = [peer.device for peer in self._twin.peers]
        if device not in names:
            raise Refused(f"no simulated device '{device}'{suggestion(device, names)}", "name one of the bench file")
        clock = VirtualClock(self._twin.epoch)
        clock.wait_until(self.clock.now_ns())
        try:
            twin = _with_fault(self._twin, device, _from_now(row, clock.now_ns()))
            world = self._build(twin, clock)
        except TruthError as error:
            raise Refused(f"{device}: {error.message}", "see the faults in the reference of bench files") from error
        world.restore(deepcopy(self.world.state()))
        self._twin, self.clock, self.world = twin, clock, world
        self._connect()

    def _build(self, twin: SimulatedBench, clock: VirtualClock) -> World:
        """Build a world; its peers know their lines, which still belong to the world before."""
        world = build_world(twin, self.spec.instruments, clock, self.spec.buses)
        for name, line in self.lines.items():
            world.serial_peers[name].attach(line, world.clock_of(name))
        return world

    def _connect(self) -> None:
        for name, line in self.lines.items():
            line.connect(self.world.serial_peers[name], self.world.clock_of(name))


def _with_fault(twin: SimulatedBench, device: str, row: Mapping[str, object]) -> SimulatedBench:
    """Return a twin in which a device has one fault more, after all others."""

    def wrong(peer: PeerSpec) -> PeerSpec:
        return replace(peer, faults=(*peer.faults, row)) if peer.device == device else peer

    return replace(twin, peers=tuple(map(wrong, twin.peers)))


def _from_now(row: Mapping[str, object], now_ns: int) -> Mapping[str, object]:
    """Return a fault's row with instants that count from the epoch.

    Raises:
        TruthError: if they are no durations.
    """
    asked = {key: value for key, value in row.items() if key in {"from", "until"}}
    window = declared(Fault, asked, "fault", ("faults",))
    after_ns = {"from": window.start_ns, **({"until": window.end_ns} if "until" in asked else {})}
    return {**row, **{key: _written(now_ns + after) for key, after in after_ns.items()}}


def _written(instant_ns: int) -> str:
    """Write an instant as bench files have it; the fraction is exact."""
    return f"{instant_ns // 1000}.{instant_ns % 1000:03d} us"


_Item = TypeVar("_Item")


def true_state(bench: ServedBench, path: str) -> object:
    """Return what stands at a dotted path, all of it for an empty one.

    `plants.coil` has every signal and input of a plant; `plants.coil.field.x` is one signal, `plants.coil.field` a
    group of them, and where there is no signal of that name it is an input. `peers.psu1.channels.2.on` is what the peer
    itself keeps, by the names that it keeps it under; `lines.psu1` returns whether a client is there, and what
    overflowed.

    Raises:
        Refused: if there is nothing of that name.
    """
    section, _, rest = path.partition(".")
    name, _, inner = rest.partition(".")
    world = bench.world
    known: dict[str, Mapping[str, object]] = {"lines": bench.lines, "peers": world.by_device, "plants": world.plants}
    if not section:
        return {key: {item: _part(bench, key, item, "") for item in items} for key, items in known.items()}
    items = _one_of(known, section)
    if not name:
        return {item: _part(bench, section, item, "") for item in items}
    _one_of(items, name)
    return _part(bench, section, name, inner)


def _part(bench: ServedBench, section: str, name: str, path: str) -> object:
    if section == "plants":
        return _of_plant(bench.world.plants[name], path)
    if section == "peers":
        state = bench.world.by_device[name].state()
        # On a byte stream the peer is wrapped in what goes wrong around it.
        found: object = state["peer"] if name in bench.lines else state
    else:
        line = bench.lines[name]
        found = {"open": line.is_open, "lost": line.lost}
    for key in path.split(".") if path else ():
        found = _inside(found, key)
    return _plain(found)


def _of_plant(plant: Plant, path: str) -> object:
    signals = sorted(plant.signals)
    if not path:
        seen = {name: _plain(plant.observe(name)) for name in signals}
        return {"signals": seen, "inputs": {name: _plain(value) for name, value in sorted(plant.inputs.items())}}
    if path in plant.signals:
        return _plain(plant.observe(path))
    group = [name for name in signals if name.startswith(f"{path}.")]
    if group:
        return {name.removeprefix(f"{path}."): _plain(plant.observe(name)) for name in group}
    return _plain(_one_of({**dict.fromkeys(signals), **plant.inputs}, path))


def _inside(found: object, key: str) -> object:
    if isinstance(found, list) and key.isdecimal() and int(key) < len(found):
        return found[int(key)]
    return _one_of(found if isinstance(found, Mapping) else {}, key)


def _one_of(items: Mapping[str, _Item], name: str) -> _Item:
    if name not in items:
        raise Refused(f"there is no '{name}'{suggestion(name, tuple(items))}", "ask for the state of '' to see all")
    return items[name]


def _plain(value: object) -> object:
    """Return a value as JSON has it; numbers that JSON has not are texts, such as `inf`."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value
