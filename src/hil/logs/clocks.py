"""Parsing of times as people and loggers write them: hours and minutes, days, ISO 8601 dates."""

from __future__ import annotations

import re

import numpy as np

__all__ = ["Clock"]

_DATE = re.compile(
    r"(\d{4}([-/])\d\d\2\d\d|\d\d?\.\d\d?\.\d{4})[T ]+(\d\d?):(\d\d)(?::(\d\d(?:[.,]\d*)?))?\s*(Z|UTC|[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
_TIME = re.compile(r"([-+]?)(?:(\d+)\s*(?:d|days?)?[ .,:]+)?(\d+):(\d\d):(\d\d(?:[.,]\d*)?)")


class Clock:
    """Parser for the times of one column, in seconds; dates count from midnight of the first one."""

    def __init__(self) -> None:
        self._days: dict[str, int] = {}

    def __call__(self, cell: str) -> float:
        """Parse a cell to seconds.

        Raises:
            ValueError: it is neither a number, `hh:mm:ss.sss`, `3 days 04:05:06`, nor a date with a time. A date is one
                of ISO 8601, also with slashes, or day, month and year with points; 11/12/2026 may be two days.
        """
        text = cell.strip().strip('"')
        date = _DATE.fullmatch(text)
        if date is not None:
            day, _, hours, minutes, seconds, zone = date.groups()
            return self._since(day) + _seconds(hours, minutes, seconds or "0") - _offset(zone or "Z")
        time = _TIME.fullmatch(text)
        if time is not None:
            sign, days, hours, minutes, seconds = time.groups()
            passed = 86400.0 * int(days or 0) + _seconds(hours, minutes, seconds)
            return -passed if sign == "-" else passed
        return float(text)

    def _since(self, day: str) -> float:
        if day not in self._days:
            iso = "-".join(part.zfill(2) for part in reversed(day.split("."))) if "." in day else day.replace("/", "-")
            self._days[day] = int(np.datetime64(iso, "D").astype(np.int64))
        first = next(iter(self._days.values()))
        return 86400.0 * (self._days[day] - first)


def _seconds(hours: str, minutes: str, seconds: str) -> float:
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds.replace(",", "."))


def _offset(zone: str) -> float:
    if zone[0] not in "+-":
        return 0.0
    passed = 3600.0 * int(zone[1:3]) + 60.0 * int(zone[-2:])
    return passed if zone[0] == "+" else -passed
