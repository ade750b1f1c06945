"""The simulated IIM-42652 as bench files know it."""

from __future__ import annotations

import re

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.iim42652.article import Article, ArticleTruth
from hil.simulation.peers.iim42652.sensor import Iim42652
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.truth import TruthError

__all__ = ["MODEL", "build"]

_ADDRESSES = (0x68, 0x69)
_BOOT_SECONDS = 1e-3


def build(setup: PeerSetup) -> Iim42652:
    """Build the sensor; terminals `rate` (three axes, deg/s), `temperature` (degC) and `power` (V) go to plant signals.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth, connections = setup.truth, setup.connections
    address = setup.instrument.address or _ADDRESSES[0]
    if address not in _ADDRESSES:
        raise TruthError(truth.path[:-1], f"an IIM-42652 answers at 0x68 or 0x69, not at 0x{address:02X}")
    article_truth = ArticleTruth.read(truth)
    boot = truth.number("boot_time", _BOOT_SECONDS, minimum=0)
    rate, temperature = connections.axes("rate"), connections.signal("temperature")
    power = connections.signal("power")
    for fault in setup.faults.of("identity"):
        if not re.fullmatch(r"0x[0-9A-Fa-f]{1,2}", fault.text):
            raise TruthError(
                (*truth.path[:-1], "faults"), f"expected a register value such as '0x47', not '{fault.text}'"
            )
    setup.finish()
    article = Article(
        article_truth,
        rate=rate,
        temperature=temperature,
        faults=setup.faults,
        seeds=setup.seeds,
        name=setup.instrument.name,
    )
    return Iim42652(address, article, power, round(boot * NANOSECONDS))


MODEL = PeerModel(link="bus", fault_kinds=("asleep", "identity", "saturated", "stuck", "temperature-raw"), build=build)
"""The model behind the driver `iim42652`."""
