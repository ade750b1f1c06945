"""The commands of the simulated controller: what each mnemonic asks, sets and refuses."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.esp301.axis import Axis, ErrorBuffer, EspError
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["CommandSet"]

_COMMAND = re.compile(r"(\d*)([A-Z]{2})(\?|[^?]*)", re.ASCII)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d{1,2})?", re.ASCII)
_TICK_NS = 400_000
_LONGEST_LINE = 80
_UNITS = 12
_DOES_NOT_EXIST, _OUT_OF_RANGE, _NO_SUCH_AXIS, _AXIS_MISSING, _PARAMETER_MISSING = 6, 7, 9, 37, 38
_NOT_CONNECTED = 8

_Ask = Callable[[Axis], str]
_Set = Callable[[Axis, str], None]


class CommandSet(Stateful):
    """Executes command lines on the axis that has a stage; others have none.

    Args:
        version: what `VE?` answers.
        axis: the first axis.
        axes: how many axes the controller has.
        faults: what goes wrong.
    """

    errors: Kept[ErrorBuffer]

    def __init__(self, version: str, axis: Axis, axes: int, faults: Faults) -> None:
        self.errors = ErrorBuffer()
        self._version = version
        self._axis = axis
        self._axes = axes
        self._faults = faults
        self._now_ns = 0
        self._asks = self._questions()
        self._sets = self._settings()

    def execute(self, line: str, now_ns: int) -> list[str]:
        """Return the answers; the commands after an error are still executed."""
        self._now_ns = now_ns
        if len(line) > _LONGEST_LINE:
            self._refuse(_DOES_NOT_EXIST)
            return []
        answers = (self._one("".join(text.split()).upper()) for text in line.split(";"))
        return [answer for answer in answers if answer is not None]

    def _one(self, text: str) -> str | None:
        if not text:
            return None
        try:
            return self._obey(*_parts(text))
        except EspError as error:
            self._refuse(error.code)
            return None

    def _obey(self, number: str, mnemonic: str, parameter: str) -> str | None:
        if mnemonic in {"VE", "TB", "TE"}:
            return self._of_controller(mnemonic, parameter)
        if parameter == "?" and mnemonic in self._asks:
            axis = self._addressed(number)
            if axis is None and mnemonic in _ABSENT:
                return _ABSENT[mnemonic]
            return self._asks[mnemonic](self._connected(axis, number))
        if parameter != "?" and mnemonic in self._sets:
            # A stop without an axis stops all of them.
            everything = mnemonic == "ST" and not number
            axis = self._axis if everything else self._addressed(number)
            self._sets[mnemonic](self._connected(axis, number), parameter)
            return None
        raise EspError(_DOES_NOT_EXIST)

    def _of_controller(self, mnemonic: str, parameter: str) -> str:
        if parameter not in {"", "?"}:
            raise EspError(_DOES_NOT_EXIST)
        if mnemonic == "VE":
            fault = self._faults.now(Identity, self._now_ns)
            return _marked(fault.value if fault else self._version)
        code, ticks, text = self.errors.take(self._ticks())
        return f"{code}, {ticks}, {text}" if mnemonic == "TB" else f"{code}"

    def _addressed(self, number: str) -> Axis | None:
        """Return the axis, None for one without a stage."""
        if not number:
            raise EspError(_AXIS_MISSING)
        if not 1 <= int(number) <= self._axes:
            raise EspError(_NO_SUCH_AXIS)
        return self._axis if int(number) == self._axis.number else None

    def _connected(self, axis: Axis | None, number: str) -> Axis:
        if axis is None:
            raise EspError(100 * int(number) + _NOT_CONNECTED)
        return axis

    def _questions(self) -> Mapping[str, _Ask]:
        return {
            "AC": lambda axis: _decimal(axis.acceleration),
            "AG": lambda axis: _decimal(axis.deceleration),
            "AU": lambda axis: _decimal(axis.stage.maximum_acceleration),
            "DV": lambda axis: _decimal(axis.commanded_velocity(self._now_ns)),
            "ID": lambda axis: axis.stage.told(axis.number),
            "MD": lambda axis: f"{axis.done(self._now_ns):d}",
            "MO": lambda axis: f"{axis.powered:d}",
            "MV": lambda axis: f"{axis.done(self._now_ns):d}",
            "SL": lambda axis: _decimal(axis.limits[0]),
            "SN": lambda axis: f"{axis.unit:d}",
            "SR": lambda axis: _decimal(axis.limits[1]),
            "SU": lambda axis: _decimal(axis.stage.resolution),
            "TP": lambda axis: _decimal(axis.position()),
            "TV": lambda axis: _decimal(axis.commanded_velocity(self._now_ns)),
            "VA": lambda axis: _decimal(axis.velocity),
            "VU": lambda axis: _decimal(axis.stage.maximum_velocity),
        }

    def _settings(self) -> Mapping[str, _Set]:
        def velocity(axis: Axis, text: str) -> None:
            axis.set_velocity(_positive(text), self._now_ns)

        def acceleration(axis: Axis, text: str) -> None:
            axis.acceleration = axis.permitted(_positive(text))

        def deceleration(axis: Axis, text: str) -> None:
            axis.deceleration = axis.permitted(_positive(text))

        def unit(axis: Axis, text: str) -> None:
            if _number(text) not in range(_UNITS):
                raise EspError(_OUT_OF_RANGE)
            axis.unit = int(_number(text))

        def left(axis: Axis, text: str) -> None:
            axis.limits = (_number(text), axis.limits[1])

        def right(axis: Axis, text: str) -> None:
            axis.limits = (axis.limits[0], _number(text))

        def move(axis: Axis, text: str) -> None:
            if text not in {"+", "-"}:
                raise EspError(_OUT_OF_RANGE if text else _PARAMETER_MISSING)
            axis.move(1 if text == "+" else -1, self._now_ns)

        return {
            "AC": acceleration,
            "AG": deceleration,
            "MF": lambda axis, _: axis.power(on=False, now_ns=self._now_ns),
            "MO": lambda axis, _: axis.power(on=True, now_ns=self._now_ns),
            "MV": move,
            "SL": left,
            "SN": unit,
            "SR": right,
            "ST": lambda axis, _: axis.stop(self._now_ns),
            "VA": velocity,
        }

    def _refuse(self, code: int) -> None:
        self.errors.push(code, self._ticks())

    def _ticks(self) -> int:
        return self._now_ns // _TICK_NS


_ABSENT = {"MD": "1", "MO": "0"}
"""What an axis without a stage answers: its motor is off, and nothing moves."""


def _marked(version: str) -> str:
    """Return an answer to `VE?` of the same length that says that the controller is simulated."""
    marked, count = re.subn(r"(\sVersion\s+)\S{1,3}", r"\1SIM", version, count=1, flags=re.IGNORECASE)
    return marked if count else f"{version} SIMULATED"


def _parts(text: str) -> tuple[str, str, str]:
    """Return axis number, mnemonic and parameter of a command."""
    match = _COMMAND.fullmatch(text)
    if match is None:
        raise EspError(_DOES_NOT_EXIST)
    return match[1], match[2], match[3]


def _number(text: str) -> float:
    if not text:
        raise EspError(_PARAMETER_MISSING)
    if _NUMBER.fullmatch(text) is None:
        raise EspError(_OUT_OF_RANGE)
    return float(text)


def _positive(text: str) -> float:
    number = _number(text)
    if number < 0:
        raise EspError(_OUT_OF_RANGE)
    return number


def _decimal(value: float) -> str:
    return f"{value:.6f}"
