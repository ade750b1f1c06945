"""The world of one simulated bench: plants, peers, operator, their clock, and the far ends of its lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.clock.virtual import Event, VirtualClock
from hil.model.bench import BenchSpec, Bus, InstrumentSpec, PeerSpec, PlantSpec, SimulatedBench
from hil.simulation.faults import Faults, read_faults
from hil.simulation.peers.faulty import FaultyBusPeer, FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerModel, PeerSetup
from hil.simulation.person import Person
from hil.simulation.plants.plant import Plant
from hil.simulation.registry import FAULTS, PEERS, PLANTS, fault_kinds, offered
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Path, Truth, TruthError, UnknownPlant, suggestion
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import BusPeer, SerialPeer
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.simulated_line import SimulatedLine

__all__ = ["DeviceClock", "SimulatedEnds", "World", "build_world", "simulated_ends", "truth_errors"]


class DeviceClock:
    """One peer's view of the bench's clock: simultaneous events follow the order of the bench file.

    All functions are the clock's own, because peers call them for every byte.

    Args:
        clock: the bench's clock.
        device: the peer's position in the bench file.
    """

    def __init__(self, clock: VirtualClock, device: int) -> None:
        self.now_ns = clock.now_ns
        self.at: Callable[..., Event] = partial(clock.at, device=device)
        self.calm_until_ns = clock.calm_until_ns


@dataclass(slots=True, kw_only=True)
class World(Stateful):
    """Everything behind the ports of one simulated bench.

    Bus peers are already attached to the clock; a serial peer is attached together with its line, using
    `clock_of(device)`.

    Attributes:
        clock: the bench's virtual clock.
        plants: physics by name.
        serial_peers: simulated instruments on byte streams, by device.
        bus_peers: simulated devices on I2C buses, by bus; those of a bus that an instrument serves are its peer's too.
        devices: every device's position in the bench file, which orders simultaneous events.
        person: the simulated operator.
    """

    plants: Kept[dict[str, Plant]] = field(default_factory=dict)
    serial_peers: dict[str, SerialPeer] = field(default_factory=dict)
    bus_peers: dict[str, list[BusPeer]] = field(default_factory=dict)
    devices: dict[str, int] = field(default_factory=dict)
    person: Person
    by_device: Kept[dict[str, SerialPeer | BusPeer]] = field(default_factory=dict)
    clock: Kept[VirtualClock]

    def clock_of(self, device: str) -> DeviceClock:
        """Return the clock for attaching a serial peer, together with its line."""
        return DeviceClock(self.clock, self.devices[device])


def build_world(
    spec: SimulatedBench, instruments: tuple[InstrumentSpec, ...], clock: VirtualClock, buses: tuple[Bus, ...] = ()
) -> World:
    """Build the world of a bench on a clock at the epoch.

    An instrument without an entry under `peers` has no simulated end. Only `buses` served by an instrument matter:
    its peer receives the devices on them.

    Raises:
        TruthError: with the first thing that is wrong in the simulated part of the bench file; `truth_errors`
            finds all of them.
    """
    builder = _Builder(spec, instruments, clock, buses)
    builder.build()
    if builder.errors:
        raise builder.errors[0]
    return builder.world()


def truth_errors(
    spec: SimulatedBench, instruments: tuple[InstrumentSpec, ...], buses: tuple[Bus, ...] = ()
) -> tuple[TruthError, ...]:
    """Return every error in the simulated part of a bench file, in order."""
    builder = _Builder(spec, instruments, VirtualClock(), buses)
    builder.build()
    return tuple(builder.errors)


class _Builder:
    """Builds section by section, collecting errors instead of stopping."""

    def __init__(
        self,
        spec: SimulatedBench,
        instruments: tuple[InstrumentSpec, ...],
        clock: VirtualClock,
        buses: tuple[Bus, ...],
    ) -> None:
        self.errors: list[TruthError] = []
        self._served = {bus.instrument: bus.name for bus in buses if bus.instrument}
        self._spec = spec
        self._instruments = {instrument.name: instrument for instrument in instruments}
        self._devices = {name: number for number, name in enumerate(self._instruments, start=1)}
        self._clock = clock
        self._seeds = Seeds(spec.seed)
        self._taken: set[str] = set()
        self._plants: dict[str, Plant] = {}
        self._serial: dict[str, FaultySerialPeer] = {}
        self._bus: dict[str, list[BusPeer]] = {}
        self._by_device: dict[str, SerialPeer | BusPeer] = {}
        self._person = Person({}, {})

    def build(self) -> None:
        """Build plants, peers, and the simulated operator."""
        for plant in self._spec.plants:
            self._guard(lambda plant=plant: self._build_plant(plant))  # type: ignore[misc]  # binds the loop's value
        for peer in self._spec.peers:
            self._guard(lambda peer=peer: self._build_peer(peer))  # type: ignore[misc]  # binds the loop's value
        self._guard(self._build_person)

    def world(self) -> World:
        """Return the world, with plants and buses on the clock, and served buses at their instruments."""
        for plant in self._plants.values():
            plant.follow(self._clock.now_ns)
        world = World(
            clock=self._clock,
            plants=self._plants,
            serial_peers=dict(self._serial),
            bus_peers=self._bus,
            devices=self._devices,
            person=self._person,
            by_device=self._by_device,
        )
        for device, peer in self._by_device.items():
            if device not in self._serial:
                cast("BusPeer", peer).attach(DeviceClock(self._clock, self._devices[device]))
        for device, bus in self._served.items():
            if device in self._serial:
                self._serial[device].serve(self._bus.get(bus, ()))
        return world

    def _guard(self, build: Callable[[], None]) -> None:
        try:
            build()
        except TruthError as error:
            self.errors += (one for one in (error, *error.others) if not self._follows(one))

    def _follows(self, error: TruthError) -> bool:
        """Return whether an error is a consequence of a reported one: a plant that could not be built."""
        there = {plant.name for plant in self._spec.plants}
        return isinstance(error, UnknownPlant) and error.plant in there

    def _build_plant(self, spec: PlantSpec) -> None:
        path = ("plants", spec.name)
        model = offered(PLANTS, spec.model, (*path, "model"))
        grid_ns = round(spec.grid_s * NANOSECONDS)
        if grid_ns < 1:
            self.errors.append(TruthError((*path, "grid"), "'grid' must be at least 1 ns"))
        self._plants[spec.name] = model.build(spec.name, grid_ns or NANOSECONDS, Truth(spec.truth, (*path, "truth")))

    def _build_peer(self, spec: PeerSpec) -> None:
        path = ("peers", spec.device)
        instrument = self._instruments.get(spec.device)
        if instrument is None:
            hint = suggestion(spec.device, tuple(self._instruments))
            raise TruthError(path, f"no instrument '{spec.device}'{hint}")
        model = offered(PEERS, spec.model or instrument.driver, (*path, "model"))
        if (model.link == "bus") != bool(instrument.bus):
            raise TruthError((*path, "model"), f"this peer hangs on a {_LINKS[model.link]}, '{spec.device}' does not")
        if spec.device in self._served and not model.serves_bus:
            raise TruthError(
                (*path, "model"), f"this peer serves no bus, so {self._served[spec.device]} has no devices"
            )
        setup = PeerSetup(
            instrument=instrument,
            truth=Truth(spec.truth, (*path, "truth")),
            connections=Connections(spec.connects, self._plants, self._taken, (*path, "connects")),
            faults=self._faults(spec, model, (*path, "faults")),
            seeds=self._seeds,
        )
        self._place(model, setup)

    def _faults(self, spec: PeerSpec, model: PeerModel, path: Path) -> Faults:
        """Return a peer's faults; errors in them do not hide other errors of the peer."""
        try:
            return _faults(spec, model, path)
        except TruthError as error:
            self.errors += (error, *error.others)
            return Faults()

    def _place(self, model: PeerModel, setup: PeerSetup) -> None:
        device, noise = setup.instrument.name, setup.stream("faults")
        built = model.build(setup)
        if model.link == "serial":
            self._serial[device] = FaultySerialPeer(cast("SerialPeer", built), setup.faults, noise)
            self._by_device[device] = self._serial[device]
        else:
            wrapped = FaultyBusPeer(cast("BusPeer", built), setup.faults, noise)
            self._bus.setdefault(setup.instrument.bus, []).append(wrapped)
            self._by_device[device] = wrapped

    def _build_person(self) -> None:
        self._person = Person(self._spec.person, self._plants)


_LINKS = {"bus": "bus", "serial": "byte stream"}


def _faults(spec: PeerSpec, model: PeerModel, path: Path) -> Faults:
    kinds = fault_kinds(model)
    own = {kind.name for kind in kinds}
    for place, row in enumerate(spec.faults):
        name = str(row.get("kind", ""))
        if name in FAULTS and name not in own:  # for another link, or unusable: the reason is reported
            offered(FAULTS, name, (*path, place, "kind"))
    return read_faults(spec.faults, path, kinds)


@dataclass(frozen=True, slots=True)
class SimulatedEnds(Stateful):
    """The far ends of all ports and buses of a simulated bench, with their world."""

    world: Kept[World]
    lines: Kept[dict[str, SimulatedLine]]
    buses: dict[str, SimulatedBus]

    def of(self, instrument: InstrumentSpec) -> SimulatedLine | SimulatedBus:
        """Return the far end of an instrument's line or bus."""
        return self.buses[instrument.bus] if instrument.bus else self.lines[instrument.name]


def simulated_ends(spec: BenchSpec, twin: SimulatedBench, clock: VirtualClock) -> SimulatedEnds:
    """Build the world of a bench on a clock, and put its peers on lines and buses.

    Args:
        spec: the bench file.
        twin: its simulated part.
        clock: the bench's clock.

    Raises:
        TruthError: if a truth of plants or peers is wrong.
    """
    world = build_world(twin, spec.instruments, clock, spec.buses)
    lines: dict[str, SimulatedLine] = {}
    for number, instrument in enumerate(spec.instruments, start=1):
        if not instrument.bus:
            peer = world.serial_peers[instrument.name]
            lines[instrument.name] = SimulatedLine(instrument.name, peer, clock, number=number, baud=instrument.baud)
            peer.attach(lines[instrument.name], world.clock_of(instrument.name))
    buses = {
        bus.name: SimulatedBus(clock, bus.frequency_hz, world.bus_peers.get(bus.name, ()))
        for bus in spec.buses
        if not bus.instrument
    }
    return SimulatedEnds(world, lines, buses)
