"""Exchanges on a line: silence, bytes, and the reply among other traffic."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterable

from hil.guardian.ports.line import Line
from hil.model.safing import Exchange

__all__ = ["Dialogue", "Patience"]

_MOST_HEARD = 16_384
_LEAST_TO_WRITE_S = 0.05
_SHOWN = 60


class Patience:
    """Seconds that several exchanges together may wait in vain; unlimited without a number."""

    def __init__(self, seconds: float = math.inf) -> None:
        self._left = seconds

    def of(self, seconds: float) -> float:
        """Return how many of these seconds may be waited."""
        return min(seconds, max(self._left, 0.0))

    def spent(self, seconds: float) -> None:
        """Note seconds that were waited in vain."""
        self._left -= seconds


class Dialogue:
    """Exchanges on one line.

    Attributes:
        heard_anything: whether a byte came since this was last set to False.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self.heard_anything = False
        self._heard = b""

    def resync(self, exchanges: Iterable[Exchange], patience: Patience) -> None:
        """Resynchronise with the instrument, and forget what came.

        The line's past is unknown, so silence counts from now.
        """
        self.line.busy_until = max(self.line.busy_until, time.monotonic())
        for each in exchanges:
            self.make(each, patience)
        self._forget()

    def make(self, exchange: Exchange, patience: Patience) -> str:
        """Make an exchange; return what went wrong, empty if nothing did.

        A line that never falls silent is written to anyway. A reply counts from when the bytes are written; if none
        are written, what came since the last exchange counts, too.

        Raises:
            Gone: if the port is gone.
        """
        self._wait_for_silence(exchange.quiet_s, patience.of(exchange.within_s))
        if exchange.send:
            self._forget()
            until = time.monotonic() + max(patience.of(exchange.within_s), _LEAST_TO_WRITE_S)
            taken = self.line.say(exchange.send, until)
            if taken < len(exchange.send):
                return f"took {taken} of {len(exchange.send)} bytes"
        return self._wait_for_reply(exchange, patience) if exchange.expect else ""

    def _wait_for_silence(self, quiet_s: float, longest_s: float) -> None:
        if not quiet_s:
            return
        self._hear(0.0)  # bytes not yet fetched may have come just now
        give_up = time.monotonic() + quiet_s + longest_s
        while (now := time.monotonic()) < give_up and (left := self.line.busy_until + quiet_s - now) > 0:
            self._hear(now + left)

    def _wait_for_reply(self, exchange: Exchange, patience: Patience) -> str:
        pattern = re.compile(exchange.expect, re.DOTALL)
        began = time.monotonic()
        until = began + patience.of(exchange.within_s)
        while wrong := self._judged(pattern, exchange.between):
            if not self._hear(until):
                patience.spent(time.monotonic() - began)
                break
        return wrong

    def _judged(self, pattern: re.Pattern[bytes], between: tuple[float, float] | None) -> str:
        """Return what is wrong with the newest match, and consume it; older ones are stale."""
        found = list(pattern.finditer(self._heard))
        if not found:
            return f"said {_shown(self._heard)}, not {pattern.pattern!r}"
        newest = found[-1]
        if between is not None and not _within(newest, between):
            return f"said {_shown(newest.group())}, which is not from {between[0]:g} to {between[1]:g}"
        self._heard = self._heard[newest.end() :]
        return ""

    def _hear(self, until: float) -> bool:
        """Take what is there or comes until then; return whether anything did."""
        data = self.line.hear(until)
        if data:
            self.heard_anything = True
            self._heard = (self._heard + data)[-_MOST_HEARD:]
        return bool(data)

    def _forget(self) -> None:
        for _ in range(8):  # a line that never falls silent must not block this
            if not self.line.hear(0.0):
                break
            self.heard_anything = True
        self._heard = b""


def _within(match: re.Match[bytes], between: tuple[float, float]) -> bool:
    try:
        return between[0] <= float(match.group(1)) <= between[1]
    except (TypeError, ValueError):
        return False


def _shown(heard: bytes) -> str:
    return repr(heard[-_SHOWN:]) if heard else "nothing"
