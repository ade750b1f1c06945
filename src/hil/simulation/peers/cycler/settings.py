"""The settings of a level 2 cycler: whole numbers in units of their last digit, so that their text is exact."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hil.simulation.peers.cycler.framing import crc
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["TABLE", "Settings", "text_of"]


@dataclass(frozen=True, slots=True)
class _Row:
    """One setting: decimals, default, lowest and highest value, in units of the last digit."""

    decimals: int
    default: int
    lowest: int
    highest: int


TABLE = {
    "cycles": _Row(0, 10, 1, 9999),
    "rest": _Row(0, 0, 0, 86_400),
    "beat": _Row(0, 60, 10, 600),
    "vfull": _Row(3, 4150, 3000, 4250),
    "iend": _Row(3, 50, 5, 1000),
    "vend": _Row(3, 2700, 2500, 3600),
    "vmax": _Row(3, 4250, 3000, 4300),
    "vmin": _Row(3, 2600, 2300, 3600),
    "imax": _Row(3, 1000, 10, 3000),
    "tmax": _Row(1, 450, 0, 600),
    "tmin": _Row(1, 0, -200, 400),
    "time": _Row(0, 28_800, 60, 172_800),
    "charge": _Row(3, 3000, 1, 10_000),
}
"""Every setting in the order of the page."""

_ORDER = (("vmin", "vend"), ("vend", "vfull"), ("vfull", "vmax"), ("iend", "imax"), ("tmin", "tmax"))


def text_of(value: int, decimals: int) -> str:
    """Return a number of units of the last digit as text."""
    return f"{value / 10**decimals:.{decimals}f}"


class Settings(Stateful):
    """The values that hold; the page's defaults unless an article has others for the four that level 1 has too."""

    values: Kept[dict[str, int]]

    def __init__(self, defaults: dict[str, int]) -> None:
        self._defaults = {name: row.default for name, row in TABLE.items()} | defaults
        self.values = dict(self._defaults)

    def reset(self) -> None:
        """Be the defaults again."""
        self.values = dict(self._defaults)

    def show(self, name: str) -> str:
        """Return a setting as `name=value`."""
        return f"{name}={text_of(self.values[name], TABLE[name].decimals)}"

    def check(self) -> str:
        """Return the CRC of all settings."""
        return crc(";".join(map(self.show, TABLE)).encode("ascii"))

    def contradiction(self) -> str | None:
        """Return the first setting that is not below the one that it has to be below."""
        return next((low for low, high in _ORDER if self.values[low] >= self.values[high]), None)

    @staticmethod
    def number(name: str, text: str) -> int | None:
        """Return a value as it is written, or None if it is not written as the page says."""
        decimals = TABLE[name].decimals
        fraction = rf"\.[0-9]{{{decimals}}}" if decimals else ""
        if not re.fullmatch(rf"-?(0|[1-9][0-9]*){fraction}", text):
            return None
        number = int(text.replace(".", ""))
        return None if text.startswith("-") and number == 0 else number

    @staticmethod
    def allows(name: str, value: int) -> bool:
        """Return whether a setting may have a value."""
        return TABLE[name].lowest <= value <= TABLE[name].highest
