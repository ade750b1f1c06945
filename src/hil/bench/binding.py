"""The composition root: a bench file becomes drivers on ports, whatever is behind the ports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, cast

from hil.bench.connections import clamps_of, server_of, servers_first
from hil.bench.file.places import place_of
from hil.clock.virtual import VirtualClock
from hil.documents.findings import Findings
from hil.instruments.driver import Connection, Driver, ServesBus
from hil.instruments.registry import driver_class
from hil.model.bench import BenchSpec, InstrumentSpec, SimulatedBench
from hil.model.errors import Refused
from hil.model.identity import Source
from hil.simulation.ends import simulated_ends
from hil.simulation.person import Person
from hil.simulation.world import World, truth_errors
from hil.wire.checkpoint import Checkpoint
from hil.wire.exchange import publish_bus, publish_stream, withdraw
from hil.wire.handover import Handed
from hil.wire.opening import open_bus, open_port
from hil.wire.port import I2cBus
from hil.wire.replay import Handover, Playback, ReplayedBus, ReplayedStream
from hil.wire.simulated_line import SimulatedLine
from hil.wire.tap import TappedPort
from hil.wire.transcript import Transcript

__all__ = ["BoundBench", "bind_replayed", "bind_resumed", "bind_simulated", "check_twin", "simulated_twin"]


@dataclass(kw_only=True)
class BoundBench:
    """A bench with its drivers on open ports. Close it, so that its URLs are free again.

    Attributes:
        spec: the bench file.
        source: where the bytes come from.
        clock: the bench's clock.
        transcript: where every operation is noted.
        drivers: per instrument.
        ports: the open byte streams.
        buses: those that an instrument serves, by name.
        world: plants, peers and person, on a simulated bench only.
        lines: the byte streams of a simulated bench, by instrument.
        playback: the record that answers, on a replayed bench, and on a resumed one until it goes on.
        go_on: lets a resumed bench go on from its checkpoint, where its record does not tell when.
    """

    spec: BenchSpec
    source: Source
    clock: VirtualClock
    transcript: Transcript
    drivers: Mapping[str, Driver]
    world: World | None = None
    lines: Mapping[str, SimulatedLine] = field(default_factory=dict)
    playback: Playback | None = None
    ports: list[TappedPort] = field(default_factory=list)
    buses: dict[str, I2cBus] = field(default_factory=dict)
    go_on: Callable[[], None] = lambda: None

    @cached_property
    def roles(self) -> Mapping[str, object]:
        """The role instances by their dotted names."""
        return {wire.name: self.drivers[wire.instrument].role(wire) for wire in self.spec.wiring}

    @property
    def has_person(self) -> bool:
        """Whether there is a simulated person: on simulated benches only."""
        return self.source is Source.SIMULATED

    @property
    def person(self) -> Person:
        """The simulated person.

        Raises:
            Refused: while there is none.
        """
        if self.world is None:
            raise Refused(f"bench '{self.spec.name}' has no simulated person", "answer with --answers or --ask")
        return self.world.person

    def checkpoint(self) -> Checkpoint | None:
        """Return all that a simulated bench needs to go on from here.

        None while it cannot be told: bytes are on their way, or a record answers for the bench.
        """
        if self.world is None or not all(line.quiet for line in self.lines.values()):
            return None
        state = {
            "world": self.world.state(),
            "lines": {name: line.state() for name, line in self.lines.items()},
        }
        return Checkpoint(at_ns=self.clock.now_ns(), operations=self.transcript.operations, state=state)

    def close(self) -> None:
        """Close every port and free the bench's URLs."""
        for port in self.ports:
            port.close()
        withdraw(_world_url(self.source, self.spec.name))


def bind_simulated(spec: BenchSpec, transcript: Transcript) -> BoundBench:
    """Build the simulated twin: plants, peers and a virtual clock behind `sim://` ports.

    Raises:
        Refused: if the bench file has no simulated twin.
        TruthError: if a truth of plants or peers is wrong; `check_twin` finds all of them, with their places.
    """
    twin = simulated_twin(spec)
    clock = VirtualClock(twin.epoch)
    ends = simulated_ends(spec, twin, clock)
    for name, line in ends.lines.items():
        publish_stream(_url(Source.SIMULATED, spec, name), line)
    for name, bus in ends.buses.items():
        publish_bus(_url(Source.SIMULATED, spec, name), bus)
    return _bound(spec, Source.SIMULATED, clock, transcript, world=ends.world, lines=ends.lines)


def bind_resumed(
    spec: BenchSpec,
    transcript: Transcript,
    record: Path,
    checkpoint: Checkpoint,
    where: Callable[[], str],
    *,
    asked: bool = False,
) -> BoundBench:
    """Build the simulated twin on the record of a run so far; from the checkpoint on its world goes on.

    Args:
        spec: the bench file.
        transcript: where every operation is noted.
        record: the transcript of the run so far.
        checkpoint: what `BoundBench.checkpoint` returned then.
        where: tells the present step, for messages.
        asked: whether it goes on when `go_on` is called, instead of where its record comes to the checkpoint.
    """
    twin = simulated_twin(spec)
    clock = VirtualClock(twin.epoch)
    ends: dict[str, Handed[Any]] = {}

    def go_on() -> None:
        clock.wait_until(checkpoint.at_ns)
        simulated = simulated_ends(spec, twin, clock)
        try:
            simulated.restore(checkpoint.state)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            playback.diverge(f"the simulated bench cannot go on from its checkpoint: {type(error).__name__}: {error}")
        bench.world, bench.lines, bench.playback = simulated.world, simulated.lines, None
        for name, end in ends.items():
            end.hand_to(simulated.of(spec.instrument(name)))

    handover = None if asked else Handover(checkpoint.operations, checkpoint.at_ns, go_on)
    playback = Playback(record, clock, where, handover)
    for instrument in spec.instruments:
        if server_of(spec, instrument):
            continue
        recorded = ReplayedBus if instrument.bus else ReplayedStream
        end = ends[instrument.name] = Handed(recorded(instrument.name, playback))
        publish = publish_bus if instrument.bus else publish_stream
        publish(_url(Source.SIMULATED, spec, instrument.name), cast("Any", end))
    bench = _bound(spec, Source.SIMULATED, clock, transcript, playback=playback)
    if asked:
        bench.go_on = go_on
    return bench


def bind_replayed(spec: BenchSpec, transcript: Transcript, record: Path, where: Callable[[], str]) -> BoundBench:
    """Build the bench on a recorded transcript behind `replay://` ports.

    What hangs on a bus that an instrument serves has no record of its own: its bytes are in that instrument's.
    """
    clock = VirtualClock(spec.simulated.epoch if spec.simulated else "1970-01-01T00:00:00Z")
    playback = Playback(record, clock, where)
    for instrument in spec.instruments:
        url = _url(Source.REPLAYED, spec, instrument.name)
        if server_of(spec, instrument):
            continue
        if instrument.bus:
            publish_bus(url, ReplayedBus(instrument.name, playback))
        else:
            publish_stream(url, ReplayedStream(instrument.name, playback))
    return _bound(spec, Source.REPLAYED, clock, transcript, playback=playback)


def simulated_twin(spec: BenchSpec) -> SimulatedBench:
    """Return the twin of a bench file, or refuse."""
    if spec.simulated is None:
        raise Refused(f"bench '{spec.name}' has no simulated twin", "add a 'simulated' section to its bench.yaml")
    return spec.simulated


def check_twin(spec: BenchSpec, file: Path, shown: str) -> None:
    """Check what only plants, peers and drivers understand: truths, and the settings of wires.

    Raises:
        ConfigurationError: with everything that is wrong, and where.
    """
    findings = Findings()
    for error in truth_errors(simulated_twin(spec), spec.instruments, spec.buses):
        findings.add(place_of(file, shown, ("simulated", *map(str, error.path))), error.message)
    findings.raise_if_any()
    bench = bind_simulated(spec, Transcript(None))
    try:
        for index, wire in enumerate(spec.wiring):
            try:
                bench.drivers[wire.instrument].role(wire)
            except Refused as error:
                findings.add(place_of(file, shown, ("wiring", str(index))), str(error))
    finally:
        bench.close()
    findings.raise_if_any()


def _bound(
    spec: BenchSpec,
    source: Source,
    clock: VirtualClock,
    transcript: Transcript,
    *,
    world: World | None = None,
    lines: Mapping[str, SimulatedLine] = MappingProxyType({}),
    playback: Playback | None = None,
) -> BoundBench:
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
    )
    try:
        for instrument in servers_first(spec):
            connection = _connect(bench, instrument)
            drivers[instrument.name] = driver_class(instrument.driver)(connection)
    except BaseException:
        bench.close()
        raise
    return bench


def _connect(bench: BoundBench, instrument: InstrumentSpec) -> Connection:
    return Connection(
        device=instrument.name,
        clock=bench.clock,
        clamps=clamps_of(bench.spec, instrument.name),
        port=None if instrument.bus else _port(bench, instrument),
        bus=_bus(bench, instrument) if instrument.bus else None,
        address=instrument.address,
    )


def _port(bench: BoundBench, instrument: InstrumentSpec) -> TappedPort:
    url = _url(bench.source, bench.spec, instrument.name)
    port = open_port(instrument.name, url, bench.clock, bench.transcript, baud=instrument.baud)
    bench.ports.append(port)
    return port


def _bus(bench: BoundBench, instrument: InstrumentSpec) -> I2cBus:
    server = server_of(bench.spec, instrument)
    if server is None:
        # A recorded device has its own record; a simulated one shares its bus with others.
        end = instrument.name if bench.playback is not None else instrument.bus
        return open_bus(instrument.name, _url(bench.source, bench.spec, end), bench.clock, bench.transcript)
    # No tap here: every byte passes the tap of the server's port, and a second record would be replayed twice.
    if instrument.bus not in bench.buses:
        driver = bench.drivers[server.name]
        if not isinstance(driver, ServesBus):
            raise Refused(f"{server.name} serves no bus", f"give '{instrument.bus}' a port, or another instrument")
        frequency_hz = next(bus.frequency_hz for bus in bench.spec.buses if bus.name == instrument.bus)
        bench.buses[instrument.bus] = driver.bus(frequency_hz)
    return bench.buses[instrument.bus]


def _url(source: Source, spec: BenchSpec, end: str) -> str:
    return f"{_world_url(source, spec.name)}{end}"


def _world_url(source: Source, name: str) -> str:
    return f"{'replay' if source is Source.REPLAYED else 'sim'}://{name}/"
