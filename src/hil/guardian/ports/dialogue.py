"""Exchanges on a line: wait for silence, send bytes, find the reply among other traffic."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

from hil.guardian.plan_codec import LONGEST_SETTLING
from hil.guardian.ports.line import Line
from hil.model.safing import Exchange, SafeBytes

__all__ = ["Dialogue", "Patience"]

_MOST_HEARD = 16_384
_LEAST_TO_WRITE_S = 0.05
_SHOWN = 60


class Patience:
    """Budget of seconds that several exchanges together may wait in vain; unlimited by default."""

    def __init__(self, seconds: float = math.inf) -> None:
        self._left = seconds

    def of(self, seconds: float) -> float:
        """Return how many of these seconds may still be waited."""
        return min(seconds, max(self._left, 0.0))

    def spent(self, seconds: float) -> None:
        """Note seconds that were waited in vain."""
        self._left -= seconds


class Dialogue:
    """Exchanges on one line that others have used before.

    A reply seldom says which question it answers. Instruments answer in order, and each reply comes within the
    instrument's limit. So once a line has been silent for that limit no reply is outstanding, and the reply to
    the next question is the next one that comes. If a reply does not come as expected, silence is awaited again.

    Attributes:
        heard_anything: whether a byte came since the last `begin`.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self.heard_anything = False
        self._heard = b""
        self._in_step: tuple[Exchange, ...] | None = None
        self._owes = True
        self._asked = self._heard_at = line.now()  # whatever was asked before
        self._mute = ""
        self._reply = b""
        self._groups: tuple[bytes, ...] = ()

    def begin(self, code: SafeBytes, patience: Patience) -> None:
        """Resynchronise with the instrument, whose state is unknown."""
        self._in_step, self._mute = None, ""
        self.heard_anything = False
        self._ensure_in_step(code, patience)

    def off(self, code: SafeBytes, patience: Patience) -> str:
        """Send all commands, whatever the replies are; return what went wrong."""
        self._ensure_in_step(code, patience)
        wrong = [what for each in code.off if (what := self.make(each, patience))]
        if wrong:
            self._in_step = None
        return "; ".join(wrong)

    def prove(self, code: SafeBytes) -> str:
        """Query whether the output is safe, once no reply is outstanding; return what is not as it must be.

        If nothing came since `begin`, and one question went unanswered, no further one is asked.
        """
        if self._mute and not self.heard_anything:
            return self._mute
        self._ensure_in_step(code, Patience())
        for each in code.proof:
            if wrong := self._settled(code) or self.make(each, Patience()):
                self._in_step = None
                self._mute = wrong
                return wrong
        return ""

    def settle(self, code: SafeBytes) -> str:
        """Wait until no reply is outstanding, and discard what came; return why that cannot be known, if so."""
        wrong = self._settled(code)
        self._forget()
        return wrong

    def told(self, question: Exchange) -> bytes:
        """Ask a question and return the groups of its reply, or all of it; empty if it did not come as expected."""
        if self.make(question, Patience()):
            return b""
        if self._groups:
            return b" ".join(self._groups)
        came, pause_s = self._reply + self._heard, max(question.quiet_s, _LEAST_TO_WRITE_S)
        while len(came) < _MOST_HEARD and (more := self.line.hear(self.line.now() + pause_s)):
            came += more
        self._heard = b""
        return came

    def resync(self, exchanges: Iterable[Exchange], patience: Patience) -> None:
        """Resynchronise with the instrument, and discard what came.

        The line's past is unknown, so silence counts from now, and a reply may be outstanding.
        """
        self.line.busy_until = max(self.line.busy_until, self.line.now())
        for each in exchanges:
            self.make(each, patience)
        self._forget()
        self._owes, self._asked = True, max(self._asked, self.line.busy_until)

    def _ensure_in_step(self, code: SafeBytes, patience: Patience) -> None:
        if self._in_step != code.resync:
            self.resync(code.resync, patience)
            self._in_step = code.resync

    def _settled(self, code: SafeBytes) -> str:
        """Wait for every outstanding reply; return why it cannot be known whether it has come, if so."""
        give_up = self.line.now() + LONGEST_SETTLING * code.owed_s
        while self._owes and (until := self._owed_since(code) + code.owed_s) > self.line.now():
            if self.line.now() >= give_up:
                return f"is never silent for {code.owed_s:g} s, so that no reply can be matched with its question"
            self._hear(until)
        self._owes = False
        return ""

    def _owed_since(self, code: SafeBytes) -> float:
        return self._asked if code.talks else max(self._asked, self._heard_at)

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
            until = self.line.now() + max(patience.of(exchange.within_s), _LEAST_TO_WRITE_S)
            taken = self.line.say(exchange.send, until)
            if taken < len(exchange.send):
                return f"took {taken} of {len(exchange.send)} bytes"
        if not exchange.expect:
            return ""
        self._asked = max(self._asked, self.line.busy_until)
        wrong = self._wait_for_reply(exchange, patience)
        self._owes = self._owes or bool(wrong)
        return wrong

    def _wait_for_silence(self, quiet_s: float, longest_s: float) -> None:
        if not quiet_s:
            return
        self._hear(0.0)  # bytes not yet fetched may have come just now
        give_up = self.line.now() + quiet_s + longest_s
        while (now := self.line.now()) < give_up and (left := self.line.busy_until + quiet_s - now) > 0:
            self._hear(now + left)

    def _wait_for_reply(self, exchange: Exchange, patience: Patience) -> str:
        pattern = re.compile(exchange.expect, re.DOTALL)
        began = self.line.now()
        until = began + patience.of(exchange.within_s)
        while wrong := self._judged(pattern, exchange.between):
            if not self._hear(until):
                patience.spent(self.line.now() - began)
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
        self._reply, self._groups = newest.group(), newest.groups(b"")
        self._heard = self._heard[newest.end() :]
        return ""

    def _hear(self, until: float) -> bool:
        """Take what is there or comes until then; return whether anything did."""
        data = self.line.hear(until)
        if data:
            self.heard_anything = True
            self._heard_at = self.line.now()
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
