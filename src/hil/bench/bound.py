"""A bound bench: drivers on open ports, whatever the ports lead to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, cast

from hil.bench.connections import clamps_of, server_of, servers_first
from hil.clock.live import LiveClock
from hil.clock.port import Clock
from hil.instruments.driver import Connection, Driver, OpenedAnew, ServesBus
from hil.instruments.registry import DRIVERS
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.bench import BenchSpec, InstrumentSpec
from hil.model.errors import Refused
from hil.model.identity import Source
from hil.simulation.person import Person
from hil.simulation.world import World
from hil.wire.checkpoint import Checkpoint
from hil.wire.exchange import Brake, Handed, publish_bus, publish_stream, withdraw
from hil.wire.opening import open_bus, open_port
from hil.wire.port import I2cBus
from hil.wire.replay import Playback, ReplayedBus, ReplayedStream
from hil.wire.simulated_line import SimulatedLine
from hil.wire.tap import TappedPort
from hil.wire.transcript import Transcript

__all__ = ["BoundBench", "build", "publish_recorded", "url_of"]


@dataclass(kw_only=True)
class BoundBench:
    """A bench with its drivers on open ports; close it to free its URLs.

    Attributes:
        spec: the bench file.
        source: where the bytes come from.
        clock: the bench's clock.
        transcript: where every operation is noted.
        drivers: by instrument.
        ports: the open byte streams.
        buses: the buses that instruments serve, by name.
        world: plants, peers and person, on a simulated bench only.
        lines: the byte streams of a simulated bench, by instrument.
        playback: the record that answers, on a replayed bench, and on a resumed one until it continues.
        go_on: lets a resumed bench continue from its checkpoint, if its record does not say when.
        live: the clock of a bench outside this process, None for all others.
        outside: whether the bench is outside this process, or was when it was recorded.
        speed: bench seconds per second of real time; 1 except for a served bench.
        descriptors: of the open ports of a bench outside this process, by instrument.
        where: path or URL of such a port, by instrument.
        brake: blocks operations on such ports while the bench is armed, once a stop was requested.
    """

    spec: BenchSpec
    source: Source
    clock: Clock
    transcript: Transcript
    drivers: Mapping[str, Driver]
    world: World | None = None
    lines: Mapping[str, SimulatedLine] = field(default_factory=dict)
    playback: Playback | None = None
    ports: list[TappedPort] = field(default_factory=list)
    buses: dict[str, I2cBus] = field(default_factory=dict)
    go_on: Callable[[], None] = lambda: None
    live: LiveClock | None = None
    outside: bool = False
    speed: float = 1.0
    descriptors: dict[str, int] = field(default_factory=dict)
    where: Mapping[str, str] = field(default_factory=dict)
    brake: Brake = field(default_factory=Brake)

    @cached_property
    def roles(self) -> Mapping[str, object]:
        """The role instances by their dotted names."""
        return {wire.name: self.drivers[wire.instrument].role(wire) for wire in self.spec.wiring}

    @property
    def has_person(self) -> bool:
        """Whether there is a simulated person: on simulated benches of this process only."""
        return self.source is Source.SIMULATED and self.live is None

    @property
    def person(self) -> Person:
        """The simulated person.

        Raises:
            Refused: if there is none.
        """
        if self.world is None:
            raise Refused(f"bench '{self.spec.name}' has no simulated person", "answer with --answers or --ask")
        return self.world.person

    def checkpoint(self) -> Checkpoint | None:
        """Return all that a simulated bench needs to continue from here.

        None while that is not known: bytes are in transit, or a record answers for the bench.
        """
        if self.world is None or not all(line.quiet for line in self.lines.values()):
            return None
        state = {
            "world": self.world.state(),
            "lines": {name: line.state() for name, line in self.lines.items()},
        }
        return Checkpoint(at_ns=self.clock.now_ns(), operations=self.transcript.operations, state=state)

    def reopened(self) -> None:
        """Notify the drivers that their ports were reopened, which may or may not have reset an instrument."""
        for driver in self.drivers.values():
            if isinstance(driver, OpenedAnew):
                driver.reopened()

    def close(self) -> None:
        """Close every port and free the bench's URLs."""
        for port in self.ports:
            port.close()
        withdraw(_world_url(self.source, self.spec.name))


def build(
    spec: BenchSpec,
    source: Source,
    clock: Clock,
    transcript: Transcript,
    *,
    world: World | None = None,
    lines: Mapping[str, SimulatedLine] = MappingProxyType({}),
    playback: Playback | None = None,
    live: LiveClock | None = None,
) -> BoundBench:
    """Build a bench on its published ends: ports, buses, drivers; see `BoundBench`."""
    drivers: dict[str, Driver] = {}
    bench = BoundBench(
        spec=spec,
        source=source,
        clock=clock,
        transcript=transcript,
        drivers=drivers,
        world=world,
        lines=lines,
        playback=playback,
        live=live,
        outside=live is not None,
    )
    try:
        for instrument in servers_first(spec):
            connection = _connect(bench, instrument)
            drivers[instrument.name] = DRIVERS[instrument.driver](connection)
    except BaseException:
        bench.close()
        raise
    return bench


def publish_recorded(spec: BenchSpec, source: Source, playback: Playback) -> dict[str, Handed[Any]]:
    """Let a record answer at every end of a bench until something else is handed to the ends; return the ends.

    A device on a bus that an instrument serves has no record of its own: its bytes are in that instrument's.
    """
    ends: dict[str, Handed[Any]] = {}
    for instrument in spec.instruments:
        if server_of(spec, instrument) is None:
            recorded = ReplayedBus if instrument.bus else ReplayedStream
            end = ends[instrument.name] = Handed(recorded(instrument.name, playback))
            publish = publish_bus if instrument.bus else publish_stream
            publish(url_of(source, spec, instrument.name), cast("Any", end))
    return ends


def _connect(bench: BoundBench, instrument: InstrumentSpec) -> Connection:
    return Connection(
        device=instrument.name,
        clock=bench.clock,
        clamps=clamps_of(bench.spec, instrument.name),
        port=None if instrument.bus else _port(bench, instrument),
        bus=_bus(bench, instrument) if instrument.bus else None,
        address=instrument.address,
        second_address=instrument.second_address,
        timeout=instrument.timeout_s or LONGEST_REPLY_S,
        terminator=instrument.line_end,
        names_asked=bench.playback is None or bench.playback.names_asked,
        sparing=bench.playback is None or bench.playback.sparing,
    )


def _port(bench: BoundBench, instrument: InstrumentSpec) -> TappedPort:
    url = url_of(bench.source, bench.spec, instrument.name)
    port = open_port(instrument.name, url, bench.clock, bench.transcript, baud=instrument.baud)
    bench.ports.append(port)
    return port


def _bus(bench: BoundBench, instrument: InstrumentSpec) -> I2cBus:
    server = server_of(bench.spec, instrument)
    if server is None:
        # A recorded device has its own record; a simulated one shares its bus with others.
        end = instrument.name if bench.playback is not None else instrument.bus
        return open_bus(instrument.name, url_of(bench.source, bench.spec, end), bench.clock, bench.transcript)
    # No tap here: every byte passes the tap of the server's port, and a second record would be replayed twice.
    if instrument.bus not in bench.buses:
        driver = bench.drivers[server.name]
        if not isinstance(driver, ServesBus):
            raise Refused(f"{server.name} serves no bus", f"give '{instrument.bus}' a port, or another instrument")
        frequency_hz = next(bus.frequency_hz for bus in bench.spec.buses if bus.name == instrument.bus)
        bench.buses[instrument.bus] = driver.bus(frequency_hz)
    return bench.buses[instrument.bus]


def url_of(source: Source, spec: BenchSpec, end: str) -> str:
    """Return the URL of one end of a bench within this process."""
    return f"{_world_url(source, spec.name)}{end}"


def _world_url(source: Source, name: str) -> str:
    return f"{'replay' if source is Source.REPLAYED else 'sim'}://{name}/"
