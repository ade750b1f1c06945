"""The simulated board as bench files know it."""

from __future__ import annotations

import re

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.obc_link.article import CHANNELS, Article
from hil.simulation.peers.obc_link.board import ObcBoard, Reset
from hil.simulation.peers.obc_link.bus import NoAcknowledge
from hil.simulation.peers.obc_link.timing import BoardClock
from hil.simulation.peers.obc_link.uart import LoseFrames, Stall
from hil.simulation.truth import Truth

__all__ = ["MODEL", "build"]

_USUAL_BAUD = 921_600
_MICROSECONDS = 1_000_000
_LARGEST_DRIFT = 0.01
_RING = (4096, 16_384)
_BUILD = "9f3c21d07be45a18"
_CHIP = "20373257533055100041002b"


def build(setup: PeerSetup) -> ObcBoard:
    """Build the board; terminals `A0` to `A5` go to signals in V.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    clock = BoardClock(
        truth.number("clock_drift", 0.0, minimum=-_LARGEST_DRIFT, maximum=_LARGEST_DRIFT),
        round(truth.number("clock_offset", 0.0, minimum=0) * _MICROSECONDS),
    )
    points = {channel: setup.connections.signal(f"A{channel}") for channel in range(CHANNELS)}
    article = Article(
        firmware=_version(truth),
        build=_hexadecimal(truth, "build", _BUILD),
        chip=_hexadecimal(truth, "unique_id", _CHIP),
        ring=truth.integer("ring", _RING[1], minimum=_RING[0], maximum=_RING[1]),
        reference=truth.number("reference", 3.3, minimum=1.0, maximum=4.0),
        noise=truth.number("analog_noise", 0.5, minimum=0),
        inputs={channel: point for channel, point in points.items() if point is not None},
    )
    boots = truth.integer("boots", 41)
    seconds = (
        truth.number("command_time", 20e-6, minimum=0, maximum=0.01),
        truth.number("boot_time", 0.05, minimum=0, maximum=0.1),
    )
    setup.finish()
    command_ns, boot_ns = (round(value * NANOSECONDS) for value in seconds)
    return ObcBoard(
        article,
        setup.stream("analog"),
        clock,
        setup.faults,
        baud=setup.instrument.baud or _USUAL_BAUD,
        boots=boots,
        times_ns=(command_ns, boot_ns),
    )


def _version(truth: Truth) -> tuple[int, int, int]:
    text = truth.text("firmware", "1.0.0")
    if not re.fullmatch(r"(\d{1,2}|1\d\d|2[0-4]\d|25[0-5])(\.(\d{1,2}|1\d\d|2[0-4]\d|25[0-5])){2}", text):
        truth.wrong("firmware", f"expected a version such as '1.0.0', not '{text}'")
        return 0, 0, 0
    major, minor, patch = map(int, text.split("."))
    return major, minor, patch


def _hexadecimal(truth: Truth, key: str, usual: str) -> bytes:
    text = truth.text(key, usual)
    if not re.fullmatch(rf"[0-9A-Fa-f]{{{len(usual)}}}", text):
        truth.wrong(key, f"expected {len(usual)} hexadecimal digits, not '{text}'")
        return bytes(len(usual) // 2)
    return bytes.fromhex(text)


MODEL = PeerModel(link="serial", fault_kinds=(LoseFrames, NoAcknowledge, Reset, Stall), build=build, serves_bus=True)
"""The model behind the driver `obc-link`."""
