"""The world of a served bench: its clock and lines, and faults that come while it lives."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace

from hil.clock.virtual import VirtualClock
from hil.model.bench import BenchSpec, PeerSpec, SimulatedBench
from hil.model.errors import Refused
from hil.simulation.faults import Fault
from hil.simulation.served.line import ServedLine
from hil.simulation.truth import TruthError, declared, suggestion
from hil.simulation.world import World, build_world

__all__ = ["ServedBench"]


class ServedBench:
    """Plants, peers and lines of one simulated bench, which can be told of another fault at any moment.

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

        The world is built anew with the fault in its bench file, at this instant, and goes on from the state of the
        old one, as that of a resumed run does. So whatever can go wrong from the start on can go wrong later, and no
        peer has to know that faults may come while it lives.

        Raises:
            Refused: if there is no such device or fault; the world then goes on as it was.
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
    """Return a twin in which a device has one fault more, behind all others."""

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
