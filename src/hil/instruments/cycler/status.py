"""The reply to STATE: what a level 2 device does and measures, and what its clock shows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

from hil.instruments.cycler.session import Session
from hil.instruments.cycler.told import Reading

__all__ = ["Status", "drift_between"]

_STEP_S = 0.001
_EXCHANGES = 3
_BYTE_S = 10 / 9600


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """One exchange of STATE.

    Attributes:
        run: of the last test, `-` if there was none.
        relays: `C`, `D` or `-`.
        reading: what it measures.
        device_ms: its time without wraps.
        low_s: bench time before which the stamp was not made: the question was still on the line.
        high_s: bench time after which it was not made: the reply was on the line.
    """

    run: str
    relays: str
    reading: Reading
    device_ms: int
    low_s: float
    high_s: float

    @classmethod
    def ask(cls, session: Session) -> Self:
        """Ask, and let what the lines have told go on from the reply.

        Raises:
            DeviceFault: it does not answer, or nonsense.
        """
        told = session.numbered()
        running, sent_s = told.running, session.clock.now()
        words = session.fields("STATE")
        received_s = session.clock.now()
        try:
            voltage, current, energy, temperature = (float(words[name]) for name in "viet")
            state, cycle, lines = words["state"].lower(), float(words["cycle"]), int(words["lines"])
            device_ms = told.resume(lines, int(words["ms"]), state, cycle)
            found = cls(
                run=words["run"],
                relays=words["relays"],
                reading=(voltage, current, energy, temperature),
                device_ms=device_ms,
                low_s=min(sent_s + session.sent_bytes * _BYTE_S, received_s),
                high_s=max(received_s - session.reply_bytes * _BYTE_S, sent_s),
            )
        except (KeyError, ValueError) as error:
            raise session.nonsense(" ".join(f"{name}={value}" for name, value in words.items())) from error
        if told.went_back:
            session.went_back(told, running=running)
        told.reading, told.read_s, told.heard_s = found.reading, received_s, received_s
        return found

    @classmethod
    def ask_for_time(cls, session: Session) -> Self:
        """Ask a few times and return the quickest exchange, which dates the device's time best.

        Raises:
            DeviceFault: as `ask`.
        """
        return min((cls.ask(session) for _ in range(_EXCHANGES)), key=lambda status: status.spread_s)

    @property
    def middle_s(self) -> float:
        """The bench's time that is taken for that of the device's stamp."""
        return (self.low_s + self.high_s) / 2

    @property
    def spread_s(self) -> float:
        """How far apart the bounds of the stamp are; where the line is faster than it should be, they cross."""
        return abs(self.high_s - self.low_s)

    @property
    def uncertainty(self) -> float:
        """Standard uncertainty of `middle_s` in s: the stamp was made between the bounds, and has steps of 1 ms."""
        return math.hypot(self.spread_s, _STEP_S) / math.sqrt(12)


def drift_between(first: Status, last: Status) -> tuple[float, float] | tuple[None, None]:
    """Return the rate of the device's clock against the bench's minus 1, and its standard uncertainty.

    It is the quotient of the times between two exchanges, minus 1, where there was any between them.
    """
    seconds = last.middle_s - first.middle_s
    if seconds <= 0:
        return None, None
    drift = (last.device_ms - first.device_ms) * _STEP_S / seconds - 1.0
    return drift, math.hypot(first.uncertainty, last.uncertainty) / seconds
