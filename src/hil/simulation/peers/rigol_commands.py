"""The commands of the simulated DP832: what each header reads, sets and refuses.

As in the DP800 programming guide: a channel is a parameter (`CH1`), a number in the header (`:SOUR1`), or the one that
`:INST` has selected; switches are ON and OFF, trips YES and NO. Assumed: an output whose protection has tripped
refuses to go on with -221 until the trip is cleared, and several answers of one line come joined by `;`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import cast

from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.rigol_channel import RigolOutput
from hil.simulation.peers.scpi import Command, ErrorQueue, ScpiError, find, keyword, split

__all__ = ["RigolCommands"]

_LEVEL = "[:LEVel][:IMMediate][:AMPLitude]"
_SWITCH = {"ON": True, "1": True, "OFF": False, "0": False}
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d{1,3})?")

_Action = Callable[[int, Sequence[str]], str | None]
_Write = Callable[[RigolOutput, float], None]
_Most = Callable[[RigolOutput], float]
_Read = Callable[[RigolOutput], str]


class RigolCommands:
    """Executes lines on three outputs.

    Args:
        identity: what `*IDN?` answers.
        outputs: the outputs by number.
        faults: what goes wrong.
    """

    def __init__(self, identity: str, outputs: Mapping[int, RigolOutput], faults: Faults) -> None:
        self._identity = identity
        self._outputs = outputs
        self._faults = faults
        self._errors = ErrorQueue()
        self._selected = 1
        self._now_ns = 0
        self._commands = (*self._common(), *self._sources(), *self._switching(), *self._protections())

    def execute(self, message: str, now_ns: int) -> str:
        """Return the answer, empty for none; an error ends a line, what was executed before it stands."""
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
            self._errors.push(error.code)
        return ";".join(replies)

    def state(self) -> Mapping[str, object]:
        """Return error queue and selection."""
        return {"errors": list(self._errors.codes), "selected": self._selected}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        self._errors.codes = list(cast("list[int]", state["errors"]))
        self._selected = cast("int", state["selected"])

    def _common(self) -> tuple[Command, ...]:
        asks: dict[str, Callable[[], str]] = {
            "*IDN": self._identify,
            "*OPC": lambda: "1",
            "SYSTem:ERRor[:NEXT]": lambda: self._errors.pop().removeprefix("+"),
            "INSTrument:NSELect": lambda: f"{self._selected}",
        }
        does: dict[str, Callable[[], None]] = {
            "*CLS": self._errors.codes.clear,
            "*RST": self._reset,
            "SYSTem:REMote": lambda: None,
            "SYSTem:LOCal": lambda: None,
        }
        return (
            *(Command(keyword(header), True, _alone(action)) for header, action in asks.items()),
            *(Command(keyword(header), False, _alone(action)) for header, action in does.items()),
            Command(keyword("INSTrument:NSELect"), False, self._select),
            Command(keyword("INSTrument[:SELect]"), False, self._select),
        )

    def _sources(self) -> tuple[Command, ...]:
        rows: tuple[tuple[str, _Write, _Most, _Read], ...] = (
            (f"VOLTage{_LEVEL}", RigolOutput.set_volts, lambda o: o.rating.most_volts, lambda o: f"{o.volts:.3f}"),
            (f"CURRent{_LEVEL}", RigolOutput.set_limit, lambda o: o.rating.most_amperes, lambda o: f"{o.limit:.4f}"),
        )
        commands: list[Command] = []
        for header, write, most, read in rows:
            numbered = re.compile(rf"SOUR(?:CE)?([1-3]):{keyword(header).pattern}")
            selected = keyword(f"[SOURce:]{header}")
            for pattern, by_number in ((numbered, True), (selected, False)):
                commands.append(Command(pattern, True, self._asks_source(by_number, read)))
                commands.append(Command(pattern, False, self._sets_source(by_number, write, most)))
        return (*commands, Command(keyword("APPLy"), False, self._apply))

    def _switching(self) -> tuple[Command, ...]:
        asks: dict[str, _Read] = {
            "OUTPut[:STATe]": lambda o: "ON" if o.on else "OFF",
            "OUTPut:MODE": lambda o: {"CV": "CV", "CC": "CC", "off": "UR"}[o.mode()],
            "OUTPut:CVCC": lambda o: {"CV": "CV", "CC": "CC", "off": "UR"}[o.mode()],
            "MEASure[:VOLTage][:DC]": lambda o: f"{o.read_volts(self._now_ns):.4f}",
            "MEASure:CURRent[:DC]": lambda o: f"{o.read_amperes(self._now_ns):.4f}",
            "MEASure:POWEr[:DC]": lambda o: f"{self._power(o):.3f}",
            "MEASure:ALL[:DC]": lambda o: (
                f"{o.read_volts(self._now_ns):.4f},{o.read_amperes(self._now_ns):.4f},{self._power(o):.3f}"
            ),
        }
        return (
            *(Command(keyword(header), True, self._asks(read)) for header, read in asks.items()),
            Command(keyword("OUTPut[:STATe]"), False, self._switches(self._switch)),
        )

    def _protections(self) -> tuple[Command, ...]:
        return (
            *self._protection(
                "OVP",
                state=("over_voltage_on", "over_voltage"),
                level="protection",
                most=lambda o: o.rating.most_protection,
                digits=3,
            ),
            *self._protection(
                "OCP",
                state=("current_protection", "over_current"),
                level="over_current_level",
                most=lambda o: o.most_over_current,
                digits=4,
            ),
        )

    def _protection(
        self, name: str, *, state: tuple[str, str], level: str, most: _Most, digits: int
    ) -> tuple[Command, ...]:
        """Make the commands of one protection; `state` names its switch and its trip, `level` its level."""
        armed, tripped = state
        header = f"OUTPut:{name}"
        trip = self._asks(lambda o: "YES" if getattr(o, tripped) else "NO")
        return (
            Command(keyword(f"{header}[:STATe]"), True, self._asks(lambda o: "ON" if getattr(o, armed) else "OFF")),
            Command(keyword(f"{header}[:STATe]"), False, self._switches(lambda o, on: setattr(o, armed, on))),
            Command(keyword(f"{header}:VALue"), True, self._asks(lambda o: f"{getattr(o, level):.{digits}f}")),
            Command(keyword(f"{header}:VALue"), False, self._sets(lambda o, value: setattr(o, level, value), most)),
            Command(keyword(f"{header}:QUES"), True, trip),
            Command(keyword(f"{header}:ALAR"), True, trip),
            Command(keyword(f"{header}:CLEAR"), False, self._clears(tripped)),
        )

    def _asks(self, read: _Read) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> str:
            values, output = self._target(parameters)
            if values:
                raise ScpiError(-108)
            return read(output)

        return action

    def _asks_source(self, by_number: bool, read: _Read) -> _Action:
        def action(number: int, parameters: Sequence[str]) -> str:
            if parameters:
                raise ScpiError(-108)
            return read(self._outputs[number if by_number else self._selected])

        return action

    def _sets_source(self, by_number: bool, write: _Write, most: _Most) -> _Action:
        def action(number: int, parameters: Sequence[str]) -> None:
            output = self._outputs[number if by_number else self._selected]
            write(output, _number(parameters, most(output)))

        return action

    def _sets(self, write: _Write, most: _Most) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> None:
            values, output = self._target(parameters)
            write(output, _number(values, most(output)))

        return action

    def _switches(self, write: Callable[[RigolOutput, bool], None]) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> None:
            values, output = self._target(parameters)
            if len(values) != 1:
                raise ScpiError(-108 if values else -109)
            if values[0].upper() not in _SWITCH:
                raise ScpiError(-224)
            write(output, _SWITCH[values[0].upper()])

        return action

    def _clears(self, tripped: str) -> _Action:
        def action(_: int, parameters: Sequence[str]) -> None:
            values, output = self._target(parameters)
            if values:
                raise ScpiError(-108)
            setattr(output, tripped, False)

        return action

    def _apply(self, _: int, parameters: Sequence[str]) -> None:
        values, output = self._target(parameters)
        if len(values) != 2:
            raise ScpiError(-108 if len(values) > 2 else -109)
        volts = _number(values[:1], output.rating.most_volts)
        amperes = _number(values[1:], output.rating.most_amperes)
        output.set_volts(volts)
        output.set_limit(amperes)

    def _target(self, parameters: Sequence[str]) -> tuple[list[str], RigolOutput]:
        """Split off a leading channel; without one it is the channel that was selected."""
        match = re.fullmatch(r"CH(\d)", parameters[0].upper()) if parameters else None
        number = int(match[1]) if match else self._selected
        if number not in self._outputs:
            raise ScpiError(-224)
        return list(parameters[1:] if match else parameters), self._outputs[number]

    def _switch(self, output: RigolOutput, on: bool) -> None:
        if on and (output.over_voltage or output.over_current):
            raise ScpiError(-221)
        output.switch(on, self._now_ns)

    def _select(self, _: int, parameters: Sequence[str]) -> None:
        match = re.fullmatch(r"(?:CH)?([1-3])", parameters[0].upper()) if len(parameters) == 1 else None
        if match is None:
            raise ScpiError(-224 if parameters else -109)
        self._selected = int(match[1])

    def _power(self, output: RigolOutput) -> float:
        return output.read_volts(self._now_ns) * output.read_amperes(self._now_ns)

    def _identify(self) -> str:
        fault = self._faults.now(Identity, self._now_ns)
        return fault.value if fault else self._identity

    def _reset(self) -> None:
        self._selected = 1
        for output in self._outputs.values():
            output.reset(self._now_ns)


def _alone(act: Callable[[], str | None]) -> _Action:
    def action(_: int, parameters: Sequence[str]) -> str | None:
        if parameters:
            raise ScpiError(-108)
        return act()

    return action


def _number(values: Sequence[str], most: float) -> float:
    """Read the one number of a setting, or MIN or MAX.

    Raises:
        ScpiError: if there is none or more than one, or if it is out of range.
    """
    if len(values) != 1:
        raise ScpiError(-108 if values else -109)
    text = values[0].upper()
    if re.fullmatch(r"MIN(?:IMUM)?|MAX(?:IMUM)?", text):
        return 0.0 if text.startswith("MIN") else most
    if not _NUMBER.fullmatch(text):
        raise ScpiError(-104)
    if not 0 <= float(text) <= most:
        raise ScpiError(-222)
    return float(text)
