"""The encoder of one axis: its angle with the instant at which it was taken, and the rate over a window."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hil.clock.port import Clock
from hil.instruments.newport_esp301.session import EspSession, as_decimal
from hil.model.figure import Figure

__all__ = ["Encoder", "Reading"]

_WINDOW_S = 0.2
_BENCH_CLOCK = 1e-4
"""Relative standard uncertainty of the bench's clock: a quartz without a certificate."""


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
