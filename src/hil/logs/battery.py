"""What the readers of battery tests hand over, and which of them reads a file."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.model.errors import Refused

__all__ = ["BatteryLog", "holds_rows_of_cycler", "lines_of", "made_by"]

_LOOKED_AT = 4096  # characters from which the maker is recognised
_ROW = re.compile(r"\s*(?:[-+]?\d+[.,]?\d*\s*;\s*){3}[-+]?\d+[.,]?\d*\s*(?:;.*\*[0-9A-F]{4}\s*)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryLog:
    """A battery test as its instrument logged it; all arrays have one length.

    Attributes:
        maker: which reader read it: `novonix`, `cycler` or `table`.
        time: in s.
        voltage: in V; NaN where a row was torn.
        current: in A, as it was logged.
        temperature: in degC, None where there is none.
        cycle: the instrument's own count, None where there is none.
        capacity: nominal capacity in Ah as the log declares it, None where it does not.
        own_charge: the instrument's own net charge at the end, in Ah, None where it has none.
        own_energy: likewise net energy, in Wh.
        charge: the instrument's own count of net charge at each row, in Ah, None where it is not in the rows.
        energy: likewise of net energy, in Wh.
        test: number of the test that each row belongs to, None where the log holds one.
        stretch: number of the stretch that each row belongs to, None where the log is one; between two stretches the
            time is not known.
        remarks: what was left out or mended, in sentences.
        contradicted: rows, counted from 0, whose current has not the direction that their state says, or flows in a
            rest; None where no state was logged.
    """

    maker: str
    time: NDArray[np.float64]
    voltage: NDArray[np.float64]
    current: NDArray[np.float64]
    temperature: NDArray[np.float64] | None = None
    cycle: NDArray[np.float64] | None = None
    capacity: float | None = None
    own_charge: float | None = None
    own_energy: float | None = None
    charge: NDArray[np.float64] | None = None
    energy: NDArray[np.float64] | None = None
    test: NDArray[np.int64] | None = None
    stretch: NDArray[np.int64] | None = None
    remarks: tuple[str, ...] = ()
    contradicted: NDArray[np.int64] | None = None


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file with their ends, in UTF-8 or a code in which digits are ASCII.

    Raises:
        Refused: no such file, one that holds no text, or nothing at all.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise Refused(f"{path}: {error.strerror}", "name a log that can be read") from None
    if not raw.strip():
        raise Refused(f"{path}: the file is empty", "name a log with rows in it")
    if b"\0" in raw[:_LOOKED_AT]:
        raise Refused(f"{path}: not a text file", "export the log as text in UTF-8 first")
    return list(io.StringIO(raw.decode("utf-8-sig", errors="replace"), newline=None))


def made_by(lines: list[str]) -> str:
    """Return which reader a log needs: `novonix`, `cycler` or, where neither is recognised, `table`."""
    start = "".join(lines[:200])[:_LOOKED_AT]
    if "[Summary]" in start and "Novonix" in start:
        return "novonix"
    if "PuTTY log" in start or "START ARDUINO" in start:
        return "cycler"
    return "table"


def holds_rows_of_cycler(lines: list[str]) -> bool:
    """Tell whether most of the first lines are four numbers between semicolons, as a cycler without a banner writes."""
    written = [line for line in lines[:200] if line.strip()]
    return 2 * sum(_ROW.fullmatch(line) is not None for line in written) > len(written)
