"""The far ends of a simulated bench: a world on lines and buses."""

from __future__ import annotations

from dataclasses import dataclass

from hil.clock.virtual import VirtualClock
from hil.model.bench import BenchSpec, InstrumentSpec, SimulatedBench
from hil.simulation.world import World, build_world
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.simulated_line import SimulatedLine

__all__ = ["SimulatedEnds", "simulated_ends"]


@dataclass(frozen=True, slots=True)
class SimulatedEnds(Stateful):
    """The far ends of every port and bus of a simulated bench, and the world behind them."""

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
