"""What of a bench file tells how an instrument is reached, and what its outputs may be told."""

from __future__ import annotations

from hil.instruments.driver import Clamps
from hil.model.bench import BenchSpec, InstrumentSpec

__all__ = ["clamps_of", "line_of", "server_of", "servers_first"]


def server_of(spec: BenchSpec, instrument: InstrumentSpec) -> InstrumentSpec | None:
    """Return the instrument behind which another one hangs, None where its bus or port is the host's own."""
    name = next((bus.instrument for bus in spec.buses if bus.name == instrument.bus), "")
    return spec.instrument(name) if name else None


def servers_first(spec: BenchSpec) -> list[InstrumentSpec]:
    """Return the instruments in the file's order, but none before the one behind which it hangs."""

    def depth(instrument: InstrumentSpec) -> int:
        server = server_of(spec, instrument)
        return depth(server) + 1 if server else 0

    return sorted(spec.instruments, key=depth)


def clamps_of(spec: BenchSpec, instrument: str) -> Clamps:
    """Return the limits on what one instrument's outputs may be told."""
    by_channel = {
        wire.channel: tuple(clamp for clamp in spec.clamps if clamp.output == wire.name)
        for wire in spec.wiring
        if wire.instrument == instrument
    }
    return Clamps(by_channel)


def line_of(spec: BenchSpec, instrument: str) -> str:
    """Return the instrument of the host's own whose port or bus carries all that one instrument is told."""
    found = spec.instrument(instrument)
    while server := server_of(spec, found):
        found = server
    return found.bus or found.name
