"""Following a run from another process: its journal as it grows, and whether it is still running."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.clock import wall
from hil.documents.canonical import JsonError, parse_strict
from hil.evidence.durable import open_plain
from hil.evidence.events import Event
from hil.evidence.events.codec import decode
from hil.evidence.folder import JOURNAL, is_held, is_sealed
from hil.report.live.outlook import Outlook
from hil.report.live.readings import Reading, Readings

__all__ = ["Follower", "Line"]

_BLOCK = 8_000_000
_LONG_ENOUGH_S = 1.0  # before that, the pace of bench time is unknown


@dataclass(frozen=True, slots=True)
class Line:
    """One event with what stands beside it."""

    event: Event
    wall: Mapping[str, Any]


class Follower:
    """Reads what a run writes, without a lock and without a write; half a line is left until it is whole.

    Args:
        folder: the run's folder.

    Attributes:
        outlook: where the run is, as of the last `read`.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.outlook = Outlook()
        self._readings = Readings(folder)
        self._offset = 0
        self._last: Line | None = None
        self._start: Line | None = None

    @property
    def last_utc(self) -> str:
        """UTC of the newest event, empty before the first."""
        return str(self._last.wall.get("utc", "")) if self._last else ""

    @property
    def age(self) -> float | None:
        """Seconds since the newest event; None before the first, and where the machine was booted since."""
        now = wall.stamp()
        if self._last is None or self._last.wall.get("boot_id") != now.boot_id:
            return None
        return now.boot - float(self._last.wall["boot"])

    def read(self) -> list[Line]:
        """Return the events since the last call."""
        found: list[Line] = []
        while block := self._block():
            for raw in block.splitlines():
                line = _line(raw)
                if line is not None:
                    self.outlook.take(line.event)
                    if line.event.kind() == "resumed" or (self._start is None and line.event.kind() == "case"):
                        self._start = line
                    found.append(line)
        if found:
            self._last = found[-1]
        return found

    def readings(self) -> list[Reading]:
        """Return the newest recorded values, and update the outlook's pace of bench time."""
        found = self._readings.newest(self.outlook)
        self.outlook.pace = self._pace()
        return found

    def _pace(self) -> float:
        """Return how many seconds of bench time passed in a second since the first case, or since it was resumed."""
        now = wall.stamp()
        if self._start is None or self._start.wall.get("boot_id") != now.boot_id:
            return 1.0
        took = now.boot - float(self._start.wall["boot"])
        return max(1.0, (self.outlook.t - self._start.event.t) / took) if took >= _LONG_ENOUGH_S else 1.0

    def goes_on(self) -> bool:
        """Return whether a process works on the run; it is sealed, or was interrupted, if none does."""
        return is_held(self.folder) and not is_sealed(self.folder)

    def sealed(self) -> bool:
        """Return whether the run is sealed."""
        return is_sealed(self.folder)

    def _block(self) -> bytes:
        """Return the next whole lines, nothing where there are none yet."""
        try:
            with open_plain(self.folder / JOURNAL) as stream:
                stream.seek(self._offset)
                read = stream.read(_BLOCK)
                while b"\n" not in read and (more := stream.read(_BLOCK)):
                    read += more
        except OSError:
            return b""
        whole = read[: read.rfind(b"\n") + 1]
        self._offset += len(whole)
        return whole


def _line(raw: bytes) -> Line | None:
    """Return one event, None for anything else: `hil verify` reports what is wrong with a journal."""
    try:
        value = parse_strict(raw)
        body, beside = (value.get("body"), value.get("wall")) if isinstance(value, dict) else (None, None)
        return Line(decode(body), beside if isinstance(beside, dict) else {}) if isinstance(body, dict) else None
    except JsonError:
        return None
