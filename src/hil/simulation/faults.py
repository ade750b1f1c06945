"""What goes wrong with peers, and when: the `faults` of a bench file."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from hil.simulation.truth import Path, Truth, suggestion

__all__ = ["BUS_FAULTS", "SERIAL_FAULTS", "Fault", "Faults", "read_faults"]

SERIAL_FAULTS = ("chatty", "dead", "garbled", "late", "partial")
"""What can happen to any instrument on a byte stream."""

BUS_FAULTS = ("dead", "garbled")
"""What can happen to any device on an I2C bus."""

_FOREVER = 2**63


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that goes wrong from one instant of the bench's clock to another.

    Attributes:
        kind: what goes wrong.
        start_ns: first instant, counted from the epoch.
        end_ns: first instant at which it is over.
        duration_ns: `late`: what is added; `chatty`: the pause between unsolicited bytes.
        share: `garbled`: the part of the bytes that are hit; `slipping`: the part of the rate that remains;
            `torn-lines`: the part of the lines that are hit.
        number: `partial`: bytes that come through; `refuse-off`: channel, 0 for all; `welded`: contact;
            `temperature-raw`: counts of the temperature; `lose-frames`, `lost-lines`: how many;
            `nack`: the bus address.
        field: `saturated`: what is added to every axis, in the sensor's unit [uT, deg/s]; `spike`: what is added to
            the voltage [V].
        text: `chatty`: the bytes; `identity`: who answers instead; `refuse-off`: what it says, `on` or `off`;
            `stuck-relay`: which one; `no-stop`: whether switching the motor off stops it, `cuts` or `stays`.
    """

    kind: str
    start_ns: int = 0
    end_ns: int = _FOREVER
    duration_ns: int = 0
    share: float = 1.0
    number: int = 0
    field: float = 0.0
    text: str = ""

    def holds(self, now_ns: int) -> bool:
        """Return whether it is wrong at that instant."""
        return self.start_ns <= now_ns < self.end_ns


@dataclass(frozen=True, slots=True)
class Faults:
    """All faults of one peer."""

    faults: tuple[Fault, ...] = ()

    def of(self, *kinds: str) -> tuple[Fault, ...]:
        """Return the faults of these kinds, whenever they hold."""
        return tuple(fault for fault in self.faults if fault.kind in kinds)

    def now(self, kind: str, now_ns: int, number: int = 0) -> Fault | None:
        """Return the first fault of that kind that holds; a number asks for its own or for all."""
        for fault in self.faults:
            if fault.kind == kind and fault.holds(now_ns) and (not number or fault.number in {0, number}):
                return fault
        return None


def read_faults(rows: Sequence[Mapping[str, object]], path: Path, kinds: Sequence[str]) -> Faults:
    """Read the `faults` of a peer that knows these kinds.

    Raises:
        TruthError: with everything that is wrong in the first row that has something wrong.
    """
    return Faults(tuple(_read(Truth(row, (*path, place)), kinds) for place, row in enumerate(rows)))


def _read(truth: Truth, kinds: Sequence[str]) -> Fault:
    kind = truth.text("kind")
    if kind and kind not in kinds:
        truth.wrong("kind", f"unknown fault '{kind}'{suggestion(kind, kinds)}")
    fault = Fault(kind=kind, start_ns=truth.duration_ns("from", 0), end_ns=truth.duration_ns("until", _FOREVER))
    if kind in kinds and kind in _SETTINGS:
        fault = _SETTINGS[kind](truth, fault)
    truth.finish()
    return fault


def _late(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, duration_ns=truth.duration_ns("by"))


def _garbled(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, share=truth.number("share", 1.0, minimum=0, maximum=1))


def _chatty(truth: Truth, fault: Fault) -> Fault:
    every_ns = truth.duration_ns("every")
    if every_ns <= 0:
        truth.wrong("every", "expected a duration above 0 s")
    return replace(fault, duration_ns=every_ns, text=truth.text("text", "?\r\n"))


def _partial(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, number=truth.integer("bytes", 1))


def _identity(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, text=truth.text("value"))


def _refuse_off(truth: Truth, fault: Fault) -> Fault:
    says = truth.text("says", "on", choices=("off", "on"))
    return replace(fault, number=truth.integer("channel", 0), text=says)


def _welded(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, number=truth.integer("contact", minimum=1))


def _slipping(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, share=truth.number("share", 0.9, minimum=0, maximum=1))


def _no_stop(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, text=truth.text("power", "cuts", choices=("cuts", "stays")))


def _temperature_raw(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, number=truth.integer("counts", 24_000, minimum=-32_767, maximum=32_767))


def _lose_frames(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, number=truth.integer("frames", 1, minimum=1))


def _lost_lines(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, number=truth.integer("lines", 1, minimum=1))


def _stuck_relay(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, text=truth.text("relay", choices=("charge", "discharge")))


def _nack(truth: Truth, fault: Fault) -> Fault:
    text = truth.text("address")
    if re.fullmatch(r"0x[0-7][0-9A-Fa-f]", text):
        return replace(fault, number=int(text, 16))
    if text:
        truth.wrong("address", f"expected an address such as '0x68', not '{text}'")
    return fault


def _saturated(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, field=truth.number("field", 5000.0))


def _spike(truth: Truth, fault: Fault) -> Fault:
    return replace(fault, field=truth.number("volts", 0.1))


_SETTINGS: Mapping[str, Callable[[Truth, Fault], Fault]] = {
    "chatty": _chatty,
    "garbled": _garbled,
    "identity": _identity,
    "late": _late,
    "lose-frames": _lose_frames,
    "lost-lines": _lost_lines,
    "nack": _nack,
    "no-stop": _no_stop,
    "partial": _partial,
    "refuse-off": _refuse_off,
    "saturated": _saturated,
    "slipping": _slipping,
    "spike": _spike,
    "stuck-relay": _stuck_relay,
    "temperature-raw": _temperature_raw,
    "torn-lines": _garbled,
    "welded": _welded,
}
