"""The simulated cycler as bench files know it."""

from __future__ import annotations

import re

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.cycler.article import Article, Gauge, Spike
from hil.simulation.peers.cycler.firmware import Firmware, Reset
from hil.simulation.peers.cycler.output import LostLines, Output, TornLines
from hil.simulation.peers.cycler.relays import CHARGE, DISCHARGE, Relays, StuckRelay
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.obc_link.timing import BoardClock
from hil.simulation.peers.power import Power
from hil.simulation.truth import Truth

__all__ = ["MODEL", "build"]

_LARGEST_DRIFT = 0.01


def build(setup: PeerSetup) -> Firmware:
    """Build the cycler.

    Terminals `voltage` [V], `current` [A, positive into the battery] and `temperature` [degC] go to signals, `charge`
    and `discharge` to inputs that are true where the relay is closed; `power` [V] to the signal of the rail that feeds
    the coils, where they are not fed with the device.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    extended = truth.text("level", "2", choices=("1", "2")) == "2"
    device_clock = BoardClock(truth.number("clock_drift", 0.0, minimum=-_LARGEST_DRIFT, maximum=_LARGEST_DRIFT), 0)
    article = _article(setup, extended=extended)
    boots = truth.integer("boots", 41)
    contacts = {relay: setup.connections.input(relay) for relay in (CHARGE, DISCHARGE)}
    power = Power(setup.connections.signal("power"))
    setup.finish()
    relays = Relays({relay: point for relay, point in contacts.items() if point is not None}, setup.faults, power)
    output = Output(
        extended=extended, device_clock=device_clock, faults=setup.faults, chance=setup.stream("torn lines")
    )
    return Firmware(article, relays, output, device_clock, boots=boots, faults=setup.faults)


def _article(setup: PeerSetup, *, extended: bool) -> Article:
    truth = setup.truth
    return Article(
        extended=extended,
        cycles=truth.integer("cycles", 10, minimum=1, maximum=9999),
        charge_end=round(truth.number("charge_end", 0.05, minimum=0.005, maximum=1.0) * 1000),
        discharge_end=round(truth.number("discharge_end", 2.7, minimum=2.5, maximum=3.6) * 1000),
        firmware=_pattern(truth, "firmware", "1.0.0", r"\d{1,3}\.\d{1,3}\.\d{1,3}", "a version such as '1.0.0'"),
        serial=_pattern(truth, "serial", "C0001", "[A-Z0-9]{1,8}", "up to eight capital letters and digits"),
        resets_on_open=truth.flag("reset_on_open", True),
        boot_ns=round(truth.number("boot_time", 1.6, minimum=0.05, maximum=10) * NANOSECONDS),
        voltage=_gauge(setup, "voltage", 0.0, 1000),
        current=_gauge(setup, "current", 0.0, 1000),
        temperature=_gauge(setup, "temperature", 25.0, 10),
        spikes=setup.faults.of(Spike),
    )


def _gauge(setup: PeerSetup, name: str, unconnected: float, scale: int) -> Gauge:
    truth = setup.truth
    return Gauge(
        signal=setup.connections.signal(name),
        unconnected=unconnected,
        factor=scale * truth.number(f"{name}_gain", 1.0, minimum=0.5, maximum=2.0),
        shift=scale * truth.number(f"{name}_offset", 0.0),
        noise=scale * truth.number(f"{name}_noise", 0.0, minimum=0),
        stream=setup.stream(name),
    )


def _pattern(truth: Truth, key: str, usual: str, pattern: str, expected: str) -> str:
    text = truth.text(key, usual)
    if not re.fullmatch(pattern, text):
        truth.wrong(key, f"expected {expected}, not '{text}'")
    return text


MODEL = PeerModel(link="serial", fault_kinds=(LostLines, Reset, Spike, StuckRelay, TornLines), build=build)
"""The model of the battery test apparatus."""
