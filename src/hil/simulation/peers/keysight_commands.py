"""The commands of the simulated E36312A: what each header reads, sets and refuses.

`STAT:QUES:INST:ISUM<n>:COND?` as in this family's guides: bit 0 (1) constant current, bit 1 (2) constant voltage,
both 0 output off; bit 9 (512) and 10 (1024) over-voltage and over-current tripped. Assumed: an output that has
tripped refuses `OUTP ON` with -221 until it is cleared.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import cast

from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.scpi import Command, ErrorQueue, ScpiError, channel_list, find, keyword, split
from hil.simulation.peers.supply_output import SupplyOutput

__all__ = ["CommandSet"]

_VOLTS = {"": 1.0, "V": 1.0, "MV": 1e-3, "UV": 1e-6, "KV": 1e3}
_AMPERES = {"": 1.0, "A": 1.0, "MA": 1e-3, "UA": 1e-6}
_ON_OFF = {"ON": True, "1": True, "OFF": False, "0": False}
_LEVEL = "[:LEVel][:IMMediate][:AMPLitude]"

_Action = Callable[[int, Sequence[str]], str | None]


class CommandSet:
    """Executes program messages on three outputs.

    Args:
        identity: what `*IDN?` answers.
        outputs: the outputs by number.
        faults: what goes wrong.
    """

    def __init__(self, identity: str, outputs: Mapping[int, SupplyOutput], faults: Faults) -> None:
        self.errors = ErrorQueue()
        self._identity = identity
        self._outputs = outputs
        self._faults = faults
        self._selected = 1
        self._now_ns = 0
        self._commands = self._table()

    def execute(self, message: str, now_ns: int) -> str:
        """Return the answer, empty for none; an error ends a message, what was executed before it stands."""
        replies: list[str] = []
        level = ""
        self._now_ns = now_ns
        try:
            for text in split(message):
                command, suffix, parameters, level = find(text, level, self._commands)
                reply = command.action(suffix, parameters)
                if reply is not None:
                    replies.append(reply)
        except ScpiError as error:
            self.errors.push(error.code)
        return ";".join(replies)

    def state(self) -> Mapping[str, object]:
        """Return error queue and selection."""
        return {"errors": list(self.errors.codes), "selected": self._selected}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self.errors.codes = list(cast("list[int]", state["errors"]))
        self._selected = cast("int", state["selected"])

    def _table(self) -> tuple[Command, ...]:
        asks: dict[str, _Action] = {
            "*IDN": self._identify,
            "*OPC": _answers("1"),
            "*TST": _answers("0"),
            "SYSTem:ERRor[:NEXT]": lambda _, parameters: _alone(parameters, self.errors.pop),
            "SYSTem:VERSion": _answers("1999.0"),
            "INSTrument[:SELect]": lambda _, parameters: _alone(parameters, lambda: f"CH{self._selected}"),
            "INSTrument:NSELect": lambda _, parameters: _alone(parameters, lambda: f"{self._selected}"),
            f"[SOURce:]VOLTage{_LEVEL}": self._asks_setting(lambda o: (o.volts, o.rating.most_volts, 0.0)),
            f"[SOURce:]CURRent{_LEVEL}": self._asks_setting(
                lambda o: (o.limit, o.rating.most_amperes, o.rating.amperes)
            ),
            "[SOURce:]VOLTage:PROTection[:LEVel]": self._asks_setting(
                lambda o: (o.protection, o.rating.most_protection, o.rating.most_protection)
            ),
            "[SOURce:]VOLTage:PROTection:TRIPped": self._asks(lambda o: f"{o.over_voltage:d}"),
            "[SOURce:]CURRent:PROTection:STATe": self._asks(lambda o: f"{o.current_protection:d}"),
            "[SOURce:]CURRent:PROTection:TRIPped": self._asks(lambda o: f"{o.over_current:d}"),
            "OUTPut[:STATe]": self._asks(lambda o: f"{o.on:d}"),
            "MEASure[:SCALar][:VOLTage][:DC]": self._asks(lambda o: _nr3(o.read_volts(self._now_ns))),
            "MEASure[:SCALar]:CURRent[:DC]": self._asks(lambda o: _nr3(o.read_amperes(self._now_ns))),
            "STATus:QUEStionable:INSTrument:ISUMmary<n>:CONDition": self._condition,
        }
        sets: dict[str, _Action] = {
            "*RST": lambda _, parameters: _alone(parameters, self._reset),
            "*CLS": lambda _, parameters: _alone(parameters, self.errors.codes.clear),
            "*OPC": _nothing,
            "*WAI": _nothing,
            "SYSTem:LOCal": _nothing,
            "SYSTem:REMote": _nothing,
            "SYSTem:RWLock": _nothing,
            "INSTrument[:SELect]": self._select,
            "INSTrument:NSELect": self._select,
            f"[SOURce:]VOLTage{_LEVEL}": self._sets(_VOLTS, lambda o: (o.rating.most_volts, 0.0), _set_volts),
            f"[SOURce:]CURRent{_LEVEL}": self._sets(
                _AMPERES, lambda o: (o.rating.most_amperes, o.rating.amperes), _set_limit
            ),
            "[SOURce:]VOLTage:PROTection[:LEVel]": self._sets(
                _VOLTS, lambda o: (o.rating.most_protection, o.rating.most_protection), _set_protection
            ),
            "[SOURce:]VOLTage:PROTection:CLEar": self._clears(_clear_voltage),
            "[SOURce:]CURRent:PROTection:STATe": self._switches(_set_current_protection),
            "[SOURce:]CURRent:PROTection:CLEar": self._clears(_clear_current),
            "OUTPut:PROTection:CLEar": self._clears(_clear_both),
            "OUTPut[:STATe]": self._switches(self._switch),
        }
        asking = [Command(keyword(header), True, action) for header, action in asks.items()]
        return (*asking, *(Command(keyword(header), False, action) for header, action in sets.items()))

    def _asks(self, read: Callable[[SupplyOutput], str]) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> str:
            values, outputs = self._targets(parameters)
            if values:
                raise ScpiError(-108)
            return ",".join(read(output) for output in outputs)

        return action

    def _asks_setting(self, read: Callable[[SupplyOutput], tuple[float, float, float]]) -> _Action:
        """Answer a setting, or with MIN, MAX or DEF its bounds; `read` gives setting, maximum and default."""

        def action(_: int, parameters: Sequence[str]) -> str:
            values, outputs = self._targets(parameters)
            bound = _bound(values[0]) if values else ""
            if bound is None:
                raise ScpiError(-224)
            rows = [read(output) for output in outputs]
            return ",".join(_nr3({"": now, "MIN": 0.0, "MAX": most, "DEF": usual}[bound]) for now, most, usual in rows)

        return action

    def _sets(
        self,
        units: Mapping[str, float],
        bounds: Callable[[SupplyOutput], tuple[float, float]],
        write: Callable[[SupplyOutput, float], None],
    ) -> _Action:
        """Take a number, or MIN, MAX, DEF; `bounds` gives maximum and default. All outputs are set, or none."""

        def action(_: int, parameters: Sequence[str]) -> None:
            values, outputs = self._targets(parameters)
            if len(values) != 1:
                raise ScpiError(-108 if values else -109)
            settings = []
            for output in outputs:
                most, usual = bounds(output)
                bound = _bound(values[0])
                number = {"MIN": 0.0, "MAX": most, "DEF": usual}[bound] if bound else _number(values[0], units)
                if not 0 <= number <= most:
                    raise ScpiError(-222)
                settings.append((output, number))
            for output, number in settings:
                write(output, number)

        return action

    def _switches(self, write: Callable[[SupplyOutput, bool], None]) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> None:
            values, outputs = self._targets(parameters)
            if len(values) != 1:
                raise ScpiError(-108 if values else -109)
            if values[0].upper() not in _ON_OFF:
                raise ScpiError(-224)
            for output in outputs:
                write(output, _ON_OFF[values[0].upper()])

        return action

    def _clears(self, clear: Callable[[SupplyOutput], None]) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> None:
            values, outputs = self._targets(parameters)
            if values:
                raise ScpiError(-108)
            for output in outputs:
                clear(output)

        return action

    def _targets(self, parameters: Sequence[str]) -> tuple[list[str], list[SupplyOutput]]:
        """Split parameters into values and the outputs of the channel list, or the selected output."""
        channels = channel_list(parameters[-1]) if parameters else None
        values = list(parameters[:-1] if channels is not None else parameters)
        chosen = [self._selected] if channels is None else channels
        if any(channel not in self._outputs for channel in chosen):
            raise ScpiError(-222)
        return values, [self._outputs[channel] for channel in chosen]

    def _switch(self, output: SupplyOutput, on: bool) -> None:
        if on and (output.over_voltage or output.over_current):
            raise ScpiError(-221)
        output.switch(on, self._now_ns)

    def _select(self, _: int, parameters: Sequence[str]) -> None:
        if len(parameters) != 1:
            raise ScpiError(-108 if parameters else -109)
        match = re.fullmatch(r"(?:CH)?([1-3])", parameters[0].upper())
        if match is None:
            raise ScpiError(-224)
        self._selected = int(match[1])

    def _condition(self, number: int, parameters: Sequence[str]) -> str:
        if parameters:
            raise ScpiError(-108)
        if number not in self._outputs:
            raise ScpiError(-113)
        output = self._outputs[number]
        regulation = {"CC": 1, "CV": 2, "off": 0}[output.mode()]
        return f"{regulation + 512 * output.over_voltage + 1024 * output.over_current:d}"

    def _identify(self, _: int, parameters: Sequence[str]) -> str | None:
        fault = self._faults.now(Identity, self._now_ns)
        return _alone(parameters, lambda: fault.value if fault else self._identity)

    def _reset(self) -> None:
        self._selected = 1
        for output in self._outputs.values():
            output.reset(self._now_ns)


def _alone(parameters: Sequence[str], action: Callable[[], str | None]) -> str | None:
    if parameters:
        raise ScpiError(-108)
    return action()


def _answers(text: str) -> _Action:
    return lambda _, parameters: _alone(parameters, lambda: text)


def _nothing(_: int, parameters: Sequence[str]) -> None:
    if parameters:
        raise ScpiError(-108)


def _bound(text: str) -> str | None:
    match = re.fullmatch(r"(MIN)(?:IMUM)?|(MAX)(?:IMUM)?|(DEF)(?:AULT)?", text.upper())
    return next(word for word in match.groups() if word) if match else None


def _number(text: str, units: Mapping[str, float]) -> float:
    match = re.fullmatch(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d{1,3})?)\s*([A-Z]*)", text.upper())
    if match is None:
        raise ScpiError(-104)
    if match[2] not in units:
        raise ScpiError(-131)
    return float(match[1]) * units[match[2]]


def _nr3(value: float) -> str:
    return f"{value:+.8E}"


def _set_volts(output: SupplyOutput, volts: float) -> None:
    output.set_volts(volts)


def _set_limit(output: SupplyOutput, amperes: float) -> None:
    output.set_limit(amperes)


def _set_protection(output: SupplyOutput, volts: float) -> None:
    output.protection = volts


def _set_current_protection(output: SupplyOutput, on: bool) -> None:
    output.current_protection = on


def _clear_voltage(output: SupplyOutput) -> None:
    output.over_voltage = False


def _clear_current(output: SupplyOutput) -> None:
    output.over_current = False


def _clear_both(output: SupplyOutput) -> None:
    output.over_voltage = output.over_current = False
