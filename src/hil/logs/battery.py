"""Common result of the battery log readers, and detection of the reader for a file."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hil.model.errors import Refused

__all__ = ["BatteryLog", "holds_rows_of_cycler", "lines_of", "made_by"]

_LOOKED_AT = 4096  # characters used to detect the format
_ROW = re.compile(r"\s*(?:[-+]?\d+[.,]?\d*\s*;\s*){3}[-+]?\d+[.,]?\d*\s*(?:;.*\*[0-9A-F]{4}\s*)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class BatteryLog:
    """A battery test as logged by its instrument; all arrays have the same length.

    Attributes:
        maker: the reader used: `novonix`, `cycler` or `table`.
        time: time [s].
        voltage: voltage [V]; NaN for a torn row.
        current: current as logged [A].
        temperature: temperature [degC], None if not logged.
        cycle: the instrument's cycle count, None if not logged.
        capacity: nominal capacity declared in the log [Ah], None if not declared.
        own_charge: the instrument's final net charge [Ah], None if not logged.
        own_energy: likewise net energy [Wh].
        charge: the instrument's net charge counter per row [Ah], None if not logged.
        energy: likewise net energy [Wh].
        test: test number of each row, None for a single test.
        stretch: stretch number of each row, None for a single stretch; the time between two stretches is
            unknown.
        remarks: omissions and corrections, in sentences.
        contradicted: indices of rows whose current disagrees with the logged state, or flows in a rest; None if
            no state was logged.
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
    """Return the lines of a text file with their ends, in UTF-8 or an encoding with ASCII digits.

    Raises:
        Refused: the file does not exist, is not text, or is empty.
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
    """Return the reader for a log: `novonix`, `cycler` or, if neither is recognised, `table`."""
    start = "".join(lines[:200])[:_LOOKED_AT]
    if "[Summary]" in start and "Novonix" in start:
        return "novonix"
    if "PuTTY log" in start or "START ARDUINO" in start:
        return "cycler"
    return "table"


def holds_rows_of_cycler(lines: list[str]) -> bool:
    """Return whether most of the first lines are four semicolon-separated numbers, as of a cycler without a banner."""
    written = [line for line in lines[:200] if line.strip()]
    return 2 * sum(_ROW.fullmatch(line) is not None for line in written) > len(written)
