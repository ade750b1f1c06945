"""A driver's connection to a peer: through the simulated port or bus, the tap and the virtual clock."""

from __future__ import annotations

from contextlib import contextmanager

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.faulty import FaultyBusPeer, FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.exchange import publish_bus, publish_stream, withdraw
from hil.wire.opening import open_bus, open_port
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.simulated_line import SimulatedLine
from hil.wire.transcript import Transcript

__all__ = ["facing"]

_WORLD = "sim://contract/"


@contextmanager
def facing(
    model,
    *,
    driver,
    truth=None,
    faults=(),
    clamps=None,
    connects=None,
    plants=None,
    baud=0,
    address=0,
    transcript=None,
    timeout=LONGEST_REPLY_S,
    terminator=b"",
):
    """Yield a driver whose connection ends at a peer of `model`, and the clock.

    Args:
        model: the `PeerModel`.
        driver: the driver's class.
        truth: the peer's truth section.
        faults: rows of the peer's faults.
        clamps: clamps by channel.
        connects: the peer's terminals.
        plants: plants by name, advanced by the clock.
        baud: speed of the line; 0 is a network.
        address: unit or bus address.
        transcript: where the operations of a port are noted; None notes none.
        timeout: how long a reply may take [s].
    """
    clock = VirtualClock()
    plants = plants or {}
    for plant in plants.values():
        plant.follow(clock.now_ns)
    spec = InstrumentSpec(name="device", driver="any", address=address)
    known = fault_kinds(model)
    wrong = read_faults(faults, ("faults",), known)
    seeds = Seeds(1)
    peer = model.build(
        PeerSetup(
            instrument=spec,
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections(connects or {}, plants, set(), ("connects",)),
            faults=wrong,
            seeds=seeds,
        )
    )
    noise = seeds.stream("device", "faults")
    port = bus = None
    if model.link == "serial":
        faulty = FaultySerialPeer(peer, wrong, noise)
        line = SimulatedLine("device", faulty, clock, baud=baud)
        faulty.attach(line, clock)
        publish_stream(f"{_WORLD}device", line)
        port = open_port("device", f"{_WORLD}device", clock, transcript or Transcript(None), baud=baud)
    else:
        faulty = FaultyBusPeer(peer, wrong, noise)
        faulty.attach(clock)
        publish_bus(f"{_WORLD}bus", SimulatedBus(clock, 400_000, [faulty]))
        bus = open_bus("device", f"{_WORLD}bus", clock, Transcript(None))
    try:
        yield (
            driver(
                Connection(
                    device="device",
                    clock=clock,
                    clamps=Clamps(clamps or {}),
                    terminator=terminator,
                    port=port,
                    bus=bus,
                    address=address,
                    timeout=timeout,
                )
            ),
            clock,
        )
    finally:
        if port is not None:
            port.close()
        withdraw(_WORLD)
