"""Identity of a simulated SCPI device, and variations of its firmware's notation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Annotated

from hil.model.notation import AnyText, Flag, NotNegative, one_of

__all__ = ["CarriageReturns", "DeviceTruth", "Manner"]

_ENDS = {"lf": "\n", "cr": "\r", "crlf": "\r\n", "blank crlf": " \r\n"}
_SWITCHES = {
    "": (),
    "digits": ("0", "1"),
    "signed digits": ("+0", "+1"),
    "words": ("OFF", "ON"),
    "small words": ("off", "on"),
}
_NUMBERS: Mapping[str, Callable[[float, str], str]] = {
    "": lambda value, unit: f"{value}{unit}",
    "plain": lambda value, _: f"{value:.4f}",
    "signed": lambda value, _: f"{value:+.4f}",
    "exponent": lambda value, _: f"{value:.5E}",
    "zeros": lambda value, _: f"{value:010.4f}",
    "blanks": lambda value, _: f"   {value:.4f}  ",
    "unit": lambda value, unit: f"{value:.4f}{unit}",
    "blank unit": lambda value, unit: f"{value:.4f} {unit}",
}
_SAID = {"0": False, "OFF": False, "1": True, "ON": True}
_NO_NUMBER_FROM = 9.9e37


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceTruth:
    """One device.

    A model adds `measure_time` [s] where a line with a measurement takes another time, and `pause_time` [s] where a
    line is lost that comes so soon after another one; without a pause lines wait for their turn.

    Attributes:
        serial, firmware: what it says of itself.
        command_time: how long a line takes [s].
    """

    serial: AnyText = ""
    firmware: AnyText = ""
    command_time: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Manner:
    """Firmware variations in an instrument's truth; anything left out follows the manual.

    Attributes:
        line_end: terminator sent: `lf`, `crlf`, `blank crlf`, or `cr`, which is then also the one received.
        switches: notation of on and off.
        numbers: notation of volts and amperes.
        no_error: reply for an empty error queue.
        echo: whether it echoes every line.
        banner: text sent when its port is opened.
    """

    line_end: Annotated[str, one_of(*_ENDS)] = "lf"
    switches: Annotated[str, one_of(*_SWITCHES)] = ""
    numbers: Annotated[str, one_of(*_NUMBERS)] = ""
    no_error: AnyText = ""
    echo: Flag = False
    banner: AnyText = ""

    @property
    def end(self) -> str:
        """Line terminator."""
        return _ENDS[self.line_end]

    def told(self, header: str) -> Callable[[str], str] | None:
        """Return the function that rewrites a header's answer, None to keep the manual's form."""
        name = header.upper()
        if "ERR" in name:
            return self._of_queue if self.no_error else None
        if "OUTP" in name or "STATE" in name or "TRIP" in name:
            return self._of_switch if self.switches else None
        unit = "V" if "VOLT" in name else "A" if "CURR" in name else ""
        return partial(self._of_number, unit) if self.numbers and unit else None

    def _of_queue(self, text: str) -> str:
        return self.no_error if text.lstrip("+").startswith("0") else text

    def _of_switch(self, text: str) -> str:
        return _SWITCHES[self.switches][_SAID[text]] if text in _SAID else text

    def _of_number(self, unit: str, text: str) -> str:
        try:
            value = float(text)
        except ValueError:
            return text
        return text if abs(value) >= _NO_NUMBER_FROM else _NUMBERS[self.numbers](value, unit)


@dataclass(frozen=True, slots=True, kw_only=True)
class CarriageReturns(Manner):
    """The manner of an instrument that ends its lines with carriage return and line feed."""

    line_end: Annotated[str, one_of(*_ENDS)] = "crlf"
