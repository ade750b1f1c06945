"""The encoder of one axis: its angle with the instant at which it was taken, and the rate over a window."""

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
"""Relative standard uncertainty of the bench's clock: a quartz without a certificate."""
_GAP_S = 0.03
_BETWEEN = 16
_ALL_S = 0.3
"""What so many questions and replies take on the line at 9600 baud."""
_VERSION = rb"(?:\A|\n)ESP\d+[-\w]* +(?i:Version) [^\r\n]*\r\n"
_END = rb" *\r\n"


@dataclass(frozen=True, slots=True)
class Reading:
    """One look at the encoder.

    Attributes:
        angle: in deg; full turns are counted.
        at: seconds of the bench's clock, in the middle between question and reply.
        within: half of the time between question and reply [s].
    """

    angle: float
    at: float
    within: float


class Encoder:
    """Reads angles, and never the commanded velocity.

    Args:
        session: the controller's session.
        clock: the bench's clock.
        axis: its number.
        accuracy: standard uncertainty of one angle, from the stage's certificate [deg].
    """

    def __init__(self, session: EspSession, clock: Clock, axis: int, accuracy: float) -> None:
        self._session = session
        self._clock = clock
        self._axis = axis
        self._accuracy = accuracy
        self._resolution: float | None = None

    def resolution(self) -> float:
        """Return the encoder's step [deg]; it is asked once."""
        if self._resolution is None:
            self._resolution = self._session.query(f"{self._axis}SU?", _as_step)
        return self._resolution

    def look(self) -> Reading:
        """Take one reading."""
        angle, times = self._session.timed(f"{self._axis}TP?", as_decimal)
        return Reading(angle, (times.sent + times.received) / 2, (times.received - times.sent) / 2)

    def angle(self, reading: Reading) -> Figure:
        """Return the angle of a reading: its step is a uniform distribution (GUM 4.3.7), the certificate adds."""
        step = self.resolution() / math.sqrt(12)
        return Figure(value=reading.angle, unit="deg", uncertainty=math.hypot(step, self._accuracy))

    def instant(self, reading: Reading) -> Figure:
        """Return when a reading was taken: anywhere between question and reply."""
        return Figure(value=reading.at, unit="s", uncertainty=reading.within / math.sqrt(3))

    def window(self) -> tuple[Reading, Reading]:
        """Take two readings, 0.2 s apart."""
        first = self.look()
        self._clock.sleep(_WINDOW_S)
        return first, self.look()

    def rate(self) -> Figure:
        """Return the rate over a window in deg/s; encoder, both instants and the bench's clock make its uncertainty."""
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
    """Return the bytes that stop one axis, and show that the table stands still.

    A killed program may have left half a line, and a carriage return would let the controller execute it: `1MV+` begins
    a movement. So the first thing sent is `VE?`: after half a line it makes nonsense of it, after nothing it changes
    nothing. The error buffer is left as it is.

    The driver cuts the motor's power when the encoder stands still. Here nobody waits for that: power goes right after
    the stop, as at an emergency stop, and what still turns runs out by friction. So a controller that does not obey its
    stop is stopped too.

    Whether the table stands is asked of its encoder: two angles that agree, with as many questions between them that
    some hundredths of a second pass. All leave at once, because only replies to one question can be compared with each
    other.

    Args:
        axis: its number.
        rate: bounds of the velocity that the controller reports [deg/s], None if it is not to be asked.
        within_s: how long a reply may take [s].
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
    """Return questions and replies of a motor without power, and of a table within 0.001 deg before and after them."""
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
