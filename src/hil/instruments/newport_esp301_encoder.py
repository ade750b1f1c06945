"""Encoder of one axis: its angle with the time of reading, and the rate over a window."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.clock.port import Clock
from hil.instruments.newport_esp301_session import EspSession, as_decimal
from hil.instruments.safing import NUMBER
from hil.model.figure import Figure
from hil.model.safing import Exchange, SafeBytes

__all__ = ["Encoder", "Reading", "stopped"]

_WINDOW_S = 0.2
_BENCH_CLOCK = 1e-4
"""Relative standard uncertainty of the bench's clock, an uncertified quartz."""
_GAP_S = 0.03
_BETWEEN = 16
_ALL_S = 0.3
"""Time on the line for all these queries and replies at 9600 baud."""
_VERSION = rb"(?:\A|\n)ESP\d+[-\w]* +(?i:Version) [^\r\n]*\r\n"
_END = rb" *\r\n"


@dataclass(frozen=True, slots=True)
class Reading:
    """One reading of the encoder.

    Attributes:
        angle: angle in deg, not wrapped at full turns.
        at: bench time in s, midway between query and reply.
        within: half of the time between query and reply [s].
    """

    angle: float
    at: float
    within: float


class Encoder:
    """The axis's encoder; the commanded velocity is never used.

    Args:
        session: the controller's session.
        clock: the bench's clock.
        axis: axis number.
        accuracy: standard uncertainty of one angle, from the stage's certificate [deg].
    """

    def __init__(self, session: EspSession, clock: Clock, axis: int, accuracy: float) -> None:
        self._session = session
        self._clock = clock
        self._axis = axis
        self._accuracy = accuracy
        self._resolution: float | None = None

    def resolution(self) -> float:
        """Return the encoder's resolution [deg]; queried once."""
        if self._resolution is None:
            self._resolution = self._session.query(f"{self._axis}SU?", _as_step)
        return self._resolution

    def look(self) -> Reading:
        """Take one reading."""
        angle, times = self._session.timed(f"{self._axis}TP?", as_decimal)
        return Reading(angle, (times.sent + times.received) / 2, (times.received - times.sent) / 2)

    def angle(self, reading: Reading) -> Figure:
        """Return a reading's angle; uncertainty: uniform over one step (GUM 4.3.7), combined with the certificate's."""
        step = self.resolution() / math.sqrt(12)
        return Figure(value=reading.angle, unit="deg", uncertainty=math.hypot(step, self._accuracy))

    def instant(self, reading: Reading) -> Figure:
        """Return the time of a reading, uniform between query and reply."""
        return Figure(value=reading.at, unit="s", uncertainty=reading.within / math.sqrt(3))

    def window(self) -> tuple[Reading, Reading]:
        """Take two readings, 0.2 s apart."""
        first = self.look()
        self._clock.sleep(_WINDOW_S)
        return first, self.look()

    def rate(self) -> Figure:
        """Return the rate over a window in deg/s; its uncertainty combines encoder, both instants and bench clock."""
        first, last = self.window()
        seconds = last.at - first.at
        rate = (last.angle - first.angle) / seconds
        angles = math.hypot(*(self.angle(reading).uncertainty or 0.0 for reading in (first, last)))
        instants = math.hypot(*(self.instant(reading).uncertainty or 0.0 for reading in (first, last)))
        parts = (angles / seconds, rate * instants / seconds, rate * _BENCH_CLOCK)
        return Figure(value=rate, unit="deg/s", uncertainty=math.hypot(*parts))

    def at_rest(self) -> bool:
        """Return whether the angle stays within two steps over a window."""
        first, last = self.window()
        return abs(last.angle - first.angle) <= 2 * self.resolution()


def _as_step(reply: str) -> float:
    step = as_decimal(reply)
    if not step > 0:
        raise ValueError("a step above 0")
    return step


def stopped(axis: int, rate: tuple[float, float] | None, within_s: float) -> SafeBytes:
    """Return the bytes that stop one axis and prove standstill.

    A killed program may have left half a line, which a carriage return would execute: `1MV+` starts a movement. So the
    first thing sent is `VE?`: appended to half a line it makes that invalid, on its own it changes nothing. The error
    buffer is left as it is.

    The driver switches the motor off once the encoder is at rest. Here there is no such wait: power goes off right
    after the stop, as at an emergency stop, and the table coasts down by friction. So a table whose controller ignores
    the stop is stopped too.

    Standstill is proven by the encoder: two equal angles, with enough queries between them for some hundredths of a
    second to pass. All are sent together, because only replies within one exchange can be compared with each
    other.

    Args:
        axis: axis number.
        rate: bounds of the velocity that the controller reports [deg/s], None to skip that query.
        within_s: reply timeout [s].
    """
    asked = [_asked("VE?", _VERSION, within_s), _asked(f"{axis}MD?", rb"\A *1" + _END, within_s)]
    asked.append(_asked(*_standing(axis), within_s + _ALL_S))
    if rate is not None:
        asked.append(_asked(f"{axis}TV?", rb"\A *" + NUMBER + _END, within_s, rate))
    return SafeBytes(
        resync=(Exchange(send=b"VE?\r", quiet_s=_GAP_S),),
        off=(Exchange(send=b"%dST\r" % axis), Exchange(send=b"%dMF\r" % axis)),
        proof=tuple(asked),
        owed_s=within_s,
        who=asked[0],
    )


def _standing(axis: int) -> tuple[str, bytes]:
    """Return the queries and reply patterns of a motor that is off and a table that moves less than 0.001 deg."""
    angle, powered = f"{axis}TP?", f"{axis}MO?"
    questions = "\r".join((angle, *[powered] * _BETWEEN, angle))
    replies = rb"\A *([+-]?\d+\.\d{3})\d*" + _END + rb"(?: *0" + _END + rb"){%d} *\1\d*" % _BETWEEN + _END
    return questions, replies


def _asked(question: str, reply: bytes, within_s: float, between: tuple[float, float] | None = None) -> Exchange:
    return Exchange(
        send=question.encode("ascii") + b"\r",
        expect=reply,
        within_s=within_s,
        quiet_s=_GAP_S,
        between=between,
    )
