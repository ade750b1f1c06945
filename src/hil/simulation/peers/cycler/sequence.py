"""The test that the simulated cycler runs: its settings, half-cycles and their ends, and the limits of level 2."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass

from hil.simulation.peers.cycler.lines import crc
from hil.simulation.peers.cycler.make import LINE_S, Reading
from hil.simulation.peers.cycler.relays import CHARGE, DISCHARGE, Relays
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["RUNNING", "TABLE", "Sequence", "Settings", "text_of"]


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
    """The values that hold; the page's defaults unless a device has others for the four that level 1 has too."""

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


RUNNING = frozenset({"CHARGE", "DISCHARGE", "REST"})
"""The states in which a test runs."""

_S_PER_H = 3600
_COLDEST, _HOTTEST = -400, 1250
_WITHOUT_CURRENT, _WITHOUT_REST = 12, 3
_UW_PER_DIGIT = 72_000  # 0.1 mWh is 100 uWh; a line of 1 uW is 5 / 3600 uWh
_NEVER = (1, 0) * 4


class Sequence(Stateful):
    """States and sums of a test; marks are returned, relays are driven.

    Attributes:
        phase: the state as the reply to STATE has it.
        reason: what tripped it.
        run: the last run, empty if there was none.
        cycle: the present one, or the last.

    Args:
        extended: whether the limits of level 2 hold.
        settings: ends and limits.
        relays: what a half-cycle closes.
    """

    phase: Kept[str]
    reason: Kept[str]
    run: Kept[str]
    cycle: Kept[int]
    _after_rest: Kept[str]
    _lines: Kept[int]
    _power: Kept[int]
    _flow: Kept[int]
    _row: Kept[int]

    def __init__(self, *, extended: bool, settings: Settings, relays: Relays) -> None:
        self._extended = extended
        self._settings = settings
        self._relays = relays
        self.reset()

    def reset(self) -> None:
        """Be as after a reset; the relays are the caller's."""
        self.phase, self.reason, self.run, self.cycle = "IDLE", "", "", 0
        self._after_rest = CHARGE
        self._calm: tuple[int, ...] = _NEVER
        self._lines = self._power = self._flow = self._row = 0

    @property
    def energy(self) -> int:
        """What the last data line of this half-cycle showed, in units of 0.1 mWh."""
        return (self._power + _UW_PER_DIGIT // 2) // _UW_PER_DIGIT

    def start(self, run: str) -> str:
        """Begin a test; return its first mark."""
        self.run, self.cycle = run, 0
        return self._charge()

    def stop(self) -> None:
        """End a test because the host wants it."""
        self._finish("STOPPED")

    def trip(self, reason: str) -> str:
        """End a test because a limit was passed; return the mark."""
        self.reason = reason
        self._finish("TRIPPED")
        return f"TEST TRIPPED {reason}"

    def clear(self) -> None:
        """Be ready for another test."""
        self.phase, self.reason = "IDLE", ""

    def take(self, readings: list[Reading]) -> list[int]:
        """Add data lines to the sums up to the first from which something may follow; return the energy of each.

        Nearly all of them are calm: nothing follows. `add` and `judge` tell what follows from the others.
        """
        low_volts, high_volts, low_amperes, high_amperes, low_degrees, high_degrees, most_lines, most_flow = self._calm
        rests, power, flow = self.phase == "REST", self._power, self._flow
        energies: list[int] = []
        for volts, amperes, degrees in readings[: max(0, most_lines - self._lines)]:
            flows = abs(amperes)
            if not (
                low_volts <= volts <= high_volts
                and low_amperes <= amperes <= high_amperes
                and low_degrees <= degrees <= high_degrees
                and flow + flows <= most_flow
            ):
                break
            if not rests:
                flow += flows
                power += abs(volts * amperes)
            energies.append((power + _UW_PER_DIGIT // 2) // _UW_PER_DIGIT)
        if energies:
            self._lines += len(energies)
            self._power, self._flow, self._row = power, flow, 0
        return energies

    def add(self, reading: Reading) -> int:
        """Add a data line to the sums, and return the energy that it shows."""
        volts, amperes, _ = reading
        self._lines += 1
        if self.phase != "REST":
            self._power += abs(volts * amperes)
            self._flow += abs(amperes)
        return self.energy

    def judge(self, reading: Reading) -> list[str]:
        """Return the marks that a data line causes that was added, after the relays were driven."""
        ended = self._half_ended(reading)
        reason = self._limit(reading, ended=ended) if self._extended else ""
        if reason:
            return [self.trip(reason)]
        return self._next_half() if ended else []

    def outside(self, reading: Reading) -> str:
        """Return the limit that a reading alone passes, or an empty text."""
        volts, amperes, degrees = reading
        limit = self._settings.values
        if not _COLDEST <= degrees <= _HOTTEST:
            return "SENSOR"
        if volts > limit["vmax"]:
            return "VMAX"
        if volts < limit["vmin"]:
            return "VMIN"
        if abs(amperes) > limit["imax"]:
            return "IMAX"
        if degrees > limit["tmax"]:
            return "TMAX"
        return "TMIN" if degrees < limit["tmin"] else ""

    def restored(self) -> None:
        """Know again from which data lines nothing follows."""
        self._calm = self._bounds()

    def _half_ended(self, reading: Reading) -> bool:
        volts, amperes, _ = reading
        limit = self._settings.values
        if self.phase == "CHARGE":
            return amperes <= limit["iend"] and (not self._extended or volts >= limit["vfull"])
        if self.phase == "DISCHARGE":
            return volts <= limit["vend"]
        return self._lines * LINE_S >= limit["rest"]

    def _limit(self, reading: Reading, *, ended: bool) -> str:
        reason = self.outside(reading)
        limit = self._settings.values
        resting = self.phase == "REST"
        if not reason and not resting:
            if not ended and self._lines * LINE_S > limit["time"]:
                return "TIME"
            if self._flow * LINE_S > limit["charge"] * _S_PER_H:
                return "CHARGE"
        return reason or self._wrong_current(reading, resting=resting)

    def _wrong_current(self, reading: Reading, *, resting: bool) -> str:
        volts, amperes, _ = reading
        limit = self._settings.values
        if resting:
            wrong, most, reason = abs(amperes) > limit["iend"], _WITHOUT_REST, "RELAY"
        else:
            full = self.phase == "CHARGE" and volts >= limit["vfull"]
            wrong, most, reason = abs(amperes) < limit["iend"] and not full, _WITHOUT_CURRENT, "CURRENT"
        self._row = self._row + 1 if wrong else 0
        return reason if self._row >= most else ""

    def _next_half(self) -> list[str]:
        """Continue from the end of a charge, a discharge, or a rest."""
        ended, rests = self.phase, self._settings.values["rest"] > 0
        if ended == "REST":
            return [self._charge()] if self._after_rest == CHARGE else self._discharge()
        self._relays.open()
        mark = f"{ended} END"
        if ended == "DISCHARGE" and self.cycle >= self._settings.values["cycles"]:
            self._finish("ENDED")
            return [mark, "TEST END"]
        self._after_rest = DISCHARGE if ended == "CHARGE" else CHARGE
        if rests:
            self._begin_half("REST")
            return [mark]
        return [mark, *(self._discharge() if ended == "CHARGE" else [self._charge()])]

    def _charge(self) -> str:
        self.cycle += 1
        self._begin_half("CHARGE")
        self._relays.close(CHARGE)
        return f"TEST ITERATION {self.cycle}"

    def _discharge(self) -> list[str]:
        self._begin_half("DISCHARGE")
        self._relays.close(DISCHARGE)
        return []

    def _begin_half(self, state: str) -> None:
        self.phase = state
        self._lines = self._power = self._flow = self._row = 0
        self._calm = self._bounds()

    def _bounds(self) -> tuple[int, ...]:
        """Return lowest and highest readings, most lines and most charge from which nothing follows in this half."""
        limit = self._settings.values
        most = limit["time"] // LINE_S, limit["charge"] * _S_PER_H // LINE_S
        if self.phase == "CHARGE":
            volts, amperes = (limit["vmin"], limit["vmax"]), (limit["iend"] + 1, limit["imax"])
        elif self.phase == "DISCHARGE":
            volts = max(limit["vmin"], limit["vend"] + 1), limit["vmax"]
            amperes = -limit["imax"], -limit["iend"]
        elif self.phase == "REST":
            volts, amperes = (limit["vmin"], limit["vmax"]), (-limit["iend"], limit["iend"])
            most = (limit["rest"] - 1) // LINE_S, sys.maxsize
        else:
            return _NEVER
        return (*volts, *amperes, limit["tmin"], limit["tmax"], *most)

    def _finish(self, state: str) -> None:
        self._relays.open()
        self.phase = state
