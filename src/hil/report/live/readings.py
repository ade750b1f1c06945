"""The newest value of everything that is recorded, from the ends of the row files."""

from __future__ import annotations

import math
import os
import struct
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError
from hil.evidence.durable import open_plain
from hil.evidence.events import Recording
from hil.evidence.folder import RECORDINGS
from hil.model.errors import HilError
from hil.report.live.outlook import Outlook
from hil.report.material import inners, parse, text
from hil.report.numbers import number, quantity, with_unit

__all__ = ["Reading", "Readings"]

_BENCH = "data/bench/bench.yaml"
_LONGEST_HEADER = 1_000_000
_NUMBER = 8
_PLAIN = frozenset({"id", "output", "quantity", "unit", "min", "max", "period", "max_age", "debounce"})
"""What the bench file says of a limit on a quantity that is read, not computed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The newest value of one channel.

    Attributes:
        recording: the recording's name; the id of its limit where the envelope watches it.
        channel: the channel's name.
        value: the value, NaN where the instrument had none; None where it is computed from the rows that feed it.
        unit: its unit.
        instrument: what measured it.
        t: the row's time in s.
        watched: whether it is the envelope's.
        fed: the id of the recording that it is judged on and read from, empty where the envelope takes readings.
        minimum, maximum: limits of the envelope, None where there is none.
        flow: the current without which the limit does not count: charging, discharging or flowing; empty if always.
        counts: whether the limit counts now; None where that current is not known.
    """

    recording: str
    channel: str
    value: float | None
    unit: str
    instrument: str
    t: float
    watched: bool
    fed: str = ""
    minimum: float | None = None
    maximum: float | None = None
    flow: str = ""
    counts: bool | None = True

    def __str__(self) -> str:
        return "-" if self.value is None else quantity(self.value, self.unit, 5)

    @property
    def limits(self) -> str:
        """The limits in words, and when they count; empty where there is none."""
        low, high = (None if bound is None else number(bound) for bound in (self.minimum, self.maximum))
        if not low and not high:
            return ""
        bounds = f"{low} to {high}" if low and high else f"≥ {low}" if low else f"≤ {high}"
        condition = f" while {self.flow}" if self.flow else ""
        return f"{with_unit(bounds, self.unit)}{condition}{', does not count now' if self.counts is False else ''}"


class Readings:
    """Reads row files of a run in progress, without a lock, and never past their last whole row.

    Args:
        folder: the run's folder.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def newest(self, outlook: Outlook) -> list[Reading]:
        """Return the newest value of every channel of the open recordings, and let the outlook know their time."""
        timed = [item for item in outlook.recordings.items() if item[1].capture is None]
        begun = dict(sorted(timed, key=lambda item: item[1].case is None))
        rows = {name: row for name, event in begun.items() if (row := self._last(name, event)) is not None}
        found: list[Reading] = []
        for name, row in rows.items():
            outlook.at(row[0])
            feeding = outlook.fed.get(begun[name].name, "") if begun[name].case is None else ""
            if feeding in rows and rows[feeding][0] >= row[0]:
                found.append(self._fed(begun[name], feeding, begun[feeding], rows[feeding]))
            else:
                found.extend(self._reading(begun[name], place, row) for place in range(1, len(row)))
        currents = _currents(begun, rows)
        return [self._counted(reading, currents.get(reading.instrument)) for reading in found]

    def _counted(self, reading: Reading, current: float | None) -> Reading:
        """Return a reading with whether its limit counts at the newest current of its instrument."""
        limit = self._limits.get(reading.recording, {}) if reading.watched else {}
        flow = text(limit, "while")
        if not flow:
            return reading
        if current is None:
            return replace(reading, flow=flow, counts=None)
        along = {"discharging": -current, "flowing": abs(current)}.get(flow, current)
        return replace(reading, flow=flow, counts=along >= (_bound(limit.get("threshold")) or 0.0))

    def _last(self, name: str, begun: Recording) -> tuple[float, ...] | None:
        return _last_row(self._folder / RECORDINGS / f"{name}.rows", len(begun.channels) + 1)

    def _fed(self, begun: Recording, feeding: str, stream: Recording, row: tuple[float, ...]) -> Reading:
        """Return what a limit is judged on while rows come: the envelope takes no readings of its own then."""
        alike = [(channel.name, channel.unit) for channel in stream.channels]
        wanted = begun.channels[0]
        plain = self._limits.get(begun.name, {}).keys() <= _PLAIN
        known = plain and (wanted.name, wanted.unit) in alike
        value = row[1 + alike.index((wanted.name, wanted.unit))] if known else None
        return replace(self._reading(begun, 1, (row[0], math.nan)), value=value, fed=feeding)

    def _reading(self, begun: Recording, place: int, row: tuple[float, ...]) -> Reading:
        channel, watched = begun.channels[place - 1], begun.case is None
        limit = self._limits.get(begun.name, {}) if watched else {}
        return Reading(
            recording=begun.name,
            channel=channel.name,
            value=row[place],
            unit=channel.unit,
            instrument=channel.instrument,
            t=row[0],
            watched=watched,
            minimum=_bound(limit.get("min")),
            maximum=_bound(limit.get("max")),
        )

    @cached_property
    def _limits(self) -> dict[str, Mapping[str, Any]]:
        """The limits of the frozen bench file by id; a run can be shown without them."""
        try:
            bench = parse((self._folder / _BENCH).read_text(encoding="utf-8"), _BENCH)
            return {text(limit, "id"): limit for limit in inners(bench, "envelope")}
        except (OSError, ValueError, HilError, JsonError):
            return {}


def _currents(begun: Mapping[str, Recording], rows: Mapping[str, tuple[float, ...]]) -> dict[str, float]:
    """Return the newest current in A of every instrument of which one is recorded."""
    found: dict[str, tuple[float, float]] = {}
    for name, row in rows.items():
        for channel, value in zip(begun[name].channels, row[1:], strict=False):
            earlier = found.get(channel.instrument, (-math.inf, 0.0))
            if (channel.name, channel.unit) == ("current", "A") and math.isfinite(value) and row[0] > earlier[0]:
                found[channel.instrument] = (row[0], value)
    return {instrument: value for instrument, (_, value) in found.items()}


def _last_row(path: Path, width: int) -> tuple[float, ...] | None:
    """Return the last whole row of a file that grows, None if there is none or the file is gone."""
    try:
        with open_plain(path) as stream:
            start = len(stream.readline(_LONGEST_HEADER))
            size = os.fstat(stream.fileno()).st_size
            rows = (size - start) // (width * _NUMBER)
            if rows < 1:
                return None
            stream.seek(start + (rows - 1) * width * _NUMBER)
            row = stream.read(width * _NUMBER)
    except OSError:
        return None
    numbers = struct.unpack(f"<{width}d", row) if len(row) == width * _NUMBER else None
    return numbers if numbers and math.isfinite(numbers[0]) else None


def _bound(value: object) -> float | None:
    try:
        return float(value) if isinstance(value, int | float | str) else None
    except ValueError:
        return None
