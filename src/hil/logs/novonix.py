"""Reader of Novonix cycler files: `[Summary]`, `[Protocol]`, `[Data]`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hil.documents.suggest import did_you_mean
from hil.logs.battery import BatteryLog, lines_of
from hil.model.errors import Refused

__all__ = ["read"]

_SECONDS_PER_HOUR = 3600.0
_WANTED = (
    "Run Time (h)",
    "Potential (V)",
    "Current (A)",
    "Temperature (",
    "Cycle Number",
    "Capacity (Ah)",
    "Energy (Wh)",
)
_NEEDED = 3  # of the columns above


def read(path: Path) -> BatteryLog:
    """Read a Novonix file, finding columns by name in the header of `[Data]`.

    Args:
        path: the file.

    Raises:
        Refused: no such file, no `[Data]`, no column of time, voltage or current, or no complete row.
    """
    lines = lines_of(path)
    start = _data(path, lines)
    header = [cell.strip() for cell in lines[start].split(",")]
    places = [_place(header, name) for name in _WANTED]
    for name, place in list(zip(_WANTED, places, strict=True))[:_NEEDED]:
        if place is None:
            raise Refused(
                f"{path}:{start + 1}:1: no column '{name}'{did_you_mean(name, header)}",
                "read the file as a table, and name its columns",
            )
    rows, torn = _rows(lines[start + 1 :], len(header), [place for place in places if place is not None])
    if not rows:
        raise Refused(f"{path}: [Data] holds no whole row", "export the test again")
    columns = iter(np.array(rows).T)
    found = {name: next(columns) for name, place in zip(_WANTED, places, strict=True) if place is not None}
    charge, energy = found.get("Capacity (Ah)"), found.get("Energy (Wh)")
    return BatteryLog(
        maker="novonix",
        time=found["Run Time (h)"] * _SECONDS_PER_HOUR,
        voltage=found["Potential (V)"],
        current=found["Current (A)"],
        temperature=found.get("Temperature ("),
        cycle=found.get("Cycle Number"),
        capacity=_declared(lines[:start]),
        own_charge=None if charge is None else float(charge[-1] - charge[0]),
        own_energy=None if energy is None else float(energy[-1] - energy[0]),
        charge=charge,
        energy=energy,
        remarks=(f"{torn} torn {'row is' if torn == 1 else 'rows are'} left out",) if torn else (),
    )


def _data(path: Path, lines: Sequence[str]) -> int:
    for place, line in enumerate(lines[:-1]):
        if line.strip() == "[Data]":
            return place + 1
    raise Refused(f"{path}: no section [Data]", "is this a whole Novonix file? else read it as a table")


def _place(header: Sequence[str], name: str) -> int | None:
    """Return the index of a column; the temperature's name ends in a degree sign of varying encoding."""
    fitting = [
        place for place, cell in enumerate(header) if cell == name or (name[-1] == "(" and cell.startswith(name))
    ]
    return fitting[0] if fitting else None


def _rows(lines: Sequence[str], width: int, places: Sequence[int]) -> tuple[list[list[float]], int]:
    """Return the selected numbers of complete rows, and the number of torn lines."""
    rows, torn = [], 0
    for line in lines:
        text = line.strip()
        if not text or text.startswith("["):
            continue
        cells = text.split(",")
        try:
            numbers = [float(cells[place]) for place in places] if len(cells) == width else None
        except ValueError:
            numbers = None
        if numbers is None:
            torn += 1
        else:
            rows.append(numbers)
    return rows, torn


def _declared(lines: Sequence[str]) -> float | None:
    for line in lines:
        name, _, value = line.partition(":")
        if name.strip() == "Capacity (Ah)":
            try:
                return float(value) or None
            except ValueError:
                return None
    return None
