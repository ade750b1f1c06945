"""Benches outside this process: hardware, and simulated ones that another process serves."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.bench.bound import BoundBench, build, publish_recorded, url_of
from hil.bench.connections import server_of
from hil.bench.gate import Gate
from hil.bench.port_identity import WrongPort, is_serial_device, port_gates
from hil.bench.serving import ends_of
from hil.clock.live import LiveClock
from hil.instruments.wrapped import hosted_port, is_wrapped
from hil.model.bench import BenchSpec, InstrumentSpec
from hil.model.errors import HilError, Refused
from hil.model.identity import Source
from hil.model.serial_line import SerialLine
from hil.wire.exchange import Brake, Braked, FarEnd, Unreachable, publish_bus, publish_stream
from hil.wire.keys import keys_of, keys_of_served
from hil.wire.opening import MESSAGES, PortKind, hardware_bus, kind_of
from hil.wire.replay import Playback
from hil.wire.transcript import Transcript

if TYPE_CHECKING:
    from hil.wire.live_stream import LiveStream

__all__ = ["Opened", "Reach", "bind_live", "bind_live_again", "reach_of_hardware", "reach_of_served", "require_boards"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How a bench outside this process is reached.

    Attributes:
        source: how its evidence counts.
        ports: path or URL, by instrument.
        buses: device of each of the host's own I2C buses, by name.
        served: the folder in which it is served, None for hardware.
        speed: bench seconds per second of real time; 1 for hardware.
    """

    source: Source
    ports: Mapping[str, str]
    buses: Mapping[str, str] = field(default_factory=dict)
    served: Path | None = None
    speed: float = 1.0

    @property
    def leases(self) -> list[str]:
        """The keys that only one run may hold at a time: those of all instruments, however a file names them."""
        if self.served is not None:
            return list(keys_of_served(self.served))
        ends = [*self.ports.values(), *self.buses.values()]
        return list(dict.fromkeys(key for end in ends for key in keys_of(end)))


def reach_of_hardware(spec: BenchSpec) -> Reach:
    """Return where the bench file says that the instruments are."""
    ports = {item.name: item.port for item in spec.instruments if not item.bus}
    buses = {bus.name: bus.port for bus in spec.buses if bus.port}
    return Reach(source=Source.HARDWARE, ports=ports, buses=buses)


def reach_of_served(spec: BenchSpec, folder: Path) -> Reach:
    """Ask the bench that is served in a folder where its instruments are.

    Raises:
        Refused: if none is served there, or it is another one, or has a bus that cannot be served.
    """
    if on_host := [item.name for item in spec.instruments if item.bus and server_of(spec, item) is None]:
        raise Refused(
            f"bench '{spec.name}' has {', '.join(on_host)} on the host's own bus, which cannot be served",
            "run it with --source simulated alone, in one process",
        )
    ports, speed = ends_of(folder, spec.name)
    wanted = {item.name for item in spec.instruments if not item.bus}
    if wanted != set(ports):
        differing = ", ".join(sorted(wanted ^ set(ports)))
        raise Refused(f"the bench in {folder} is not '{spec.name}': {differing} differ", "name its folder")
    return Reach(source=Source.SIMULATED, ports=ports, served=folder, speed=speed)


class Opened:
    """The open ports of a bench outside this process; nothing is sent.

    Args:
        spec: the bench file.
        reach: where it is.
        by_force: opens what it can, even beside another process; instruments at the other ports do not answer.

    Raises:
        WrongPort: if a serial port is not that of the board that the bench file names.
        NoReply: if a port cannot be opened.
    """

    def __init__(self, spec: BenchSpec, reach: Reach, *, by_force: bool = False) -> None:
        self.brake = Brake()
        self._ends: dict[str, Any] = _open(spec, reach, self.brake, by_force=by_force)

    def take(self) -> dict[str, Any]:
        """Return the ports; the caller closes them."""
        ends, self._ends = self._ends, {}
        return ends

    def close(self) -> None:
        """Close the ports that were not taken."""
        _close(self.take())


def bind_live(
    spec: BenchSpec, reach: Reach, epoch: str, transcript: Transcript, opened: Opened | None = None
) -> BoundBench:
    """Build a bench on its ports outside this process; nothing is sent.

    Args:
        spec: the bench file.
        reach: where it is.
        epoch: UTC of the bench's time zero, ISO 8601.
        transcript: where every operation is noted.
        opened: its ports; opened here if not given.

    Raises:
        WrongPort, NoReply: see `Opened`.
    """
    clock = LiveClock(epoch, speed=reach.speed)
    opened = opened or Opened(spec, reach)
    ends = opened.take()
    try:
        for name, end in ends.items():
            publish = publish_bus if name in reach.buses else publish_stream
            publish(url_of(reach.source, spec, name), end)
        bench = build(spec, reach.source, clock, transcript, live=clock)
    except BaseException:
        _close(ends)
        raise
    bench.descriptors, bench.where, bench.speed = _descriptors(ends, reach), reach.ports, reach.speed
    bench.brake = opened.brake
    clock.begin()
    return bench


def bind_live_again(
    spec: BenchSpec, reach: Reach, epoch: str, transcript: Transcript, record: Path, where: Callable[[], str]
) -> BoundBench:
    """Build a bench on the record of a run so far; after `go_on` it is the bench outside this process.

    Args:
        spec: the bench file.
        reach: where it is.
        epoch: UTC of the bench's time zero, ISO 8601.
        transcript: where every operation is noted.
        record: the transcript of the run so far.
        where: returns the current step, for messages.

    Raises:
        WrongPort, NoReply: as `bind_live`, before anything of the record is used: the run stays as it is.
    """
    clock = LiveClock(epoch, speed=reach.speed)
    brake = Brake()
    opened = _open(spec, reach, brake)
    try:
        playback = Playback(record, clock, where)
        ends = publish_recorded(spec, reach.source, playback)
        bench = build(spec, reach.source, clock, transcript, playback=playback, live=clock)
    except BaseException:
        _close(opened)
        raise
    bench.speed, bench.brake = reach.speed, brake

    def go_on() -> None:
        for name, end in ends.items():
            bus = spec.instrument(name).bus
            end.hand_to(opened[bus or name])
        for name in reach.ports:
            with suppress(OSError):  # arming detects a port that is gone by now
                opened[name].discard()  # what came while the record was retraced
        bench.descriptors, bench.where = _descriptors(opened, reach), reach.ports
        bench.playback = None
        clock.begin()

    bench.go_on = go_on
    return bench


def _open(spec: BenchSpec, reach: Reach, brake: Brake, *, by_force: bool = False) -> dict[str, Any]:
    strangers = _strangers(spec) if reach.source is Source.HARDWARE else {}
    if not by_force:
        require_boards(spec, reach)

    def end(name: str, opened: Callable[[], Any]) -> Any:  # noqa: ANN401 - streams and buses
        try:
            if name in strangers:
                raise strangers[name]
            return opened()
        except HilError as error:
            if not by_force:
                raise
            return Unreachable(error)

    ends: dict[str, Any] = {}
    try:
        for name, url in reach.ports.items():
            item = spec.instrument(name)
            line = item.serial_line if reach.source is Source.HARDWARE else None  # a pseudo-terminal has none
            opened = end(name, partial(_stream, item, url, reach.source, line, alone=not by_force))
            ends[name] = opened if isinstance(opened, Unreachable) else Braked(opened, brake)
        for name, path in reach.buses.items():
            ends[name] = end(name, partial(hardware_bus, name, path))
    except BaseException:
        _close(ends)
        raise
    return ends


def _stream(item: InstrumentSpec, url: str, source: Source, line: SerialLine | None, *, alone: bool) -> FarEnd:
    from hil.wire.line_stream import LineStream, port_of  # noqa: PLC0415 - same
    from hil.wire.live_stream import LiveStream  # noqa: PLC0415 - what it imports exists on Linux only
    from hil.wire.visa import VisaStream  # noqa: PLC0415 - same

    if source is Source.HARDWARE and is_wrapped(item):
        return LineStream(hosted_port(item, url))
    if kind_of(url) is PortKind.VISA:
        return VisaStream(item.name, url, item.baud)
    if kind_of(url) in {PortKind.RFC2217, *MESSAGES}:
        return LineStream(port_of(item.name, url, item.baud, line))
    return LiveStream(item.name, url, item.baud, line, alone=alone)


def require_boards(spec: BenchSpec, reach: Reach) -> None:
    """Require the board of the bench file at every serial port of hardware, and every I2C bus; no byte is sent.

    Raises:
        WrongPort: with every port that is missing or belongs to another board, and every bus that cannot be opened.
    """
    if reach.source is not Source.HARDWARE:
        return
    gates = [gate for error in _strangers(spec).values() for gate in error.gates] + list(_closed_buses(reach))
    if gates:
        raise WrongPort(*gates)


def _closed_buses(reach: Reach) -> Iterator[Gate]:
    """Yield a gate for every bus that cannot be opened; opening one moves no line of it."""
    from hil.wire.obstacles import obstacle  # noqa: PLC0415 - groups of users exist on Linux only

    for name, path in reach.buses.items():
        try:
            os.close(os.open(path, os.O_RDWR | os.O_CLOEXEC))
        except OSError as error:
            why, hint = obstacle(path, error)
            yield Gate(f"bus {name}", ok=False, detail=f"{path} cannot be opened: {why} ({hint})")


def _strangers(spec: BenchSpec) -> dict[str, WrongPort]:
    """Return why a serial port stays closed, by instrument: on another board the first byte may start something."""
    devices = [instrument.name for instrument in spec.instruments if is_serial_device(instrument)]
    gates = zip(devices, port_gates(spec), strict=True)
    return {name: WrongPort(gate) for name, gate in gates if not gate.ok}


def _close(ends: Mapping[str, Any]) -> None:
    for end in ends.values():
        if hasattr(end, "closed"):
            end.closed()


def _descriptors(ends: Mapping[str, Braked[LiveStream] | Unreachable], reach: Reach) -> dict[str, int]:
    opened = {name: ends[name] for name in reach.ports}
    return {name: end.fileno() for name, end in opened.items() if not isinstance(end, Unreachable)}
