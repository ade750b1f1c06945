"""What is shown of a run in progress: one line, or a few."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from hil.report.live.outlook import Outlook
from hil.report.live.readings import Reading
from hil.report.numbers import bench_time, duration

__all__ = ["facts", "one_line", "reading_lines"]

_SEPARATOR = " · "


def one_line(outlook: Outlook, readings: Sequence[Reading] = ()) -> str:
    """Return where the run is, the newest values of what its case records, and how much bench time is left."""
    left = outlook.left()
    number = outlook.ended + bool(outlook.case)
    values = [f"{reading.channel} {reading}" for reading in readings if not reading.watched]
    values = values or [f"{reading.recording} {reading}" for reading in readings]
    parts = [
        "HELD" if outlook.held is not None else "",
        f"[{number}/{outlook.planned}] {bench_time(outlook.t)}",
        str(left) if left else "",
        outlook.step,
        *values,
    ]
    return _SEPARATOR.join(part for part in parts if part)


def reading_lines(readings: Sequence[Reading], now: float) -> list[str]:
    """Return a line per channel: what, newest value, its limits, and how old it is in bench time."""
    names = [f"{reading.recording} {reading.channel}" for reading in readings]
    width = max(map(len, names), default=0)
    return [
        "  ".join(part for part in (f"  {name:<{width}}", f"{reading!s:<14}", _aside(reading, now)) if part).rstrip()
        for name, reading in zip(names, readings, strict=True)
    ]


def facts(outlook: Outlook, readings: Sequence[Reading]) -> dict[str, Any]:
    """Return the same for machines: times in s of bench time, JSON values only."""
    left = outlook.left()
    return {
        "case": outlook.case,
        "step": outlook.step,
        "turns": [{"name": each.name, "turn": each.turn, "turns": each.turns} for each in outlook.turns],
        "t": outlook.t,
        "cases": {"planned": outlook.planned, "ended": outlook.ended},
        "held": outlook.held,
        "left": None
        if left is None
        else {"case": left.case, "run": left.run, "at_most": left.at_most, "pace": left.pace},
        "readings": [
            {
                "recording": each.recording,
                "channel": each.channel,
                "value": each.value if each.value is not None and math.isfinite(each.value) else None,
                "unit": each.unit,
                "t": each.t,
                "envelope": each.watched,
                "fed": each.fed or None,
                "min": each.minimum,
                "max": each.maximum,
                "while": each.flow or None,
                "counts": each.counts,
            }
            for each in readings
        ],
    }


def _aside(reading: Reading, now: float) -> str:
    age = now - reading.t
    fed = f"fed by recording {reading.fed}" if reading.fed else ""
    said = [reading.limits, fed, f"{duration(age)} ago" if age >= 1 else ""]
    return ", ".join(part for part in said if part)
