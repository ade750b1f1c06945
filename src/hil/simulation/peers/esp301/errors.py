"""The simulated controller's error buffer: ten entries, oldest first, each with its time in ticks."""

from __future__ import annotations

from collections.abc import Mapping

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["ErrorBuffer", "EspError"]

_DEPTH = 10
_AXIS = 100
_NO_ERROR = "NO ERROR DETECTED"
_TEXTS: Mapping[int, str] = {
    6: "COMMAND DOES NOT EXIST",
    7: "PARAMETER OUT OF RANGE",
    9: "AXIS NUMBER OUT OF RANGE",
    37: "AXIS NUMBER MISSING",
    38: "COMMAND PARAMETER MISSING",
}
_AXIS_TEXTS: Mapping[int, str] = {
    1: "PARAMETER OUT OF RANGE",
    8: "MOTOR / STAGE NOT CONNECTED",
    10: "MAXIMUM VELOCITY EXCEEDED",
    11: "MAXIMUM ACCELERATION EXCEEDED",
    13: "MOTOR NOT ENABLED",
}


class EspError(Exception):
    """A command that is refused with this code; codes of axis n are n * 100 and more."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class ErrorBuffer(Stateful):
    """A first-in, first-out buffer; where it is full, the oldest entry is lost."""

    entries: Kept[list[tuple[int, int]]]

    def __init__(self) -> None:
        self.entries = []

    def push(self, code: int, ticks: int) -> None:
        """Add an error."""
        self.entries = [*self.entries, (code, ticks)][-_DEPTH:]

    def take(self, ticks: int) -> tuple[int, int, str]:
        """Take the oldest error out: code, its time, its text; code 0 and the time now where there is none."""
        if not self.entries:
            return 0, ticks, _NO_ERROR
        code, when = self.entries.pop(0)
        text = _TEXTS.get(code) if code < _AXIS else _AXIS_TEXTS.get(code % _AXIS)
        return code, when, text or "RESERVED"
