"""Execution of SCPI program messages according to the programming guide.

An error ends a message, what was executed before it stands. Assumed: a channel that has tripped refuses to switch on
with -221 until it is cleared.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import cast

from hil.simulation.faults import Faults, Identity
from hil.simulation.peers.manner import Manner
from hil.simulation.peers.scpi import ErrorQueue, ScpiError, keyword, number, one, switch, units, word
from hil.simulation.peers.scpi_manual import (
    Act,
    By,
    Channel,
    Clear,
    Manual,
    Numbers,
    Reading,
    Row,
    Setting,
    Switch,
    Word,
)
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Commands"]

_MOST_PARSED = 256

_Action = Callable[[int, Sequence[str]], str | bytes | None]


class Commands(Stateful):
    """Executes program messages on the channels of an instrument.

    Args:
        manual: what the instrument knows.
        identity: what `*IDN?` answers.
        channels: the channels by number.
        faults: what goes wrong.
        manner: how its firmware writes answers.
    """

    errors: Kept[ErrorQueue]
    _selected: Kept[int]

    def __init__(
        self, manual: Manual, identity: str, channels: Mapping[int, Channel], faults: Faults, manner: Manner
    ) -> None:
        self._manual = manual
        self._manner = manner
        self._identity = identity
        self._channels = channels
        self._faults = faults
        self.errors = ErrorQueue()
        self._selected = 1
        self._now_ns = 0
        self._targeted: dict[tuple[str, ...], tuple[list[str], list[int] | None]] = {}
        self._parsed: dict[str, list[tuple[_Action, int, Sequence[str]]]] = {}
        self._commands: list[tuple[re.Pattern[str], bool, _Action]] = []
        self._common()
        for row in manual.rows:
            self._add(row)

    def execute(self, message: str, now_ns: int) -> bytes:
        """Return the answer, empty for none."""
        replies: list[bytes] = []
        self._now_ns = now_ns
        try:
            for action, suffix, parameters in self._units(message):
                reply = action(suffix, parameters)
                if reply is not None:
                    replies.append(reply if isinstance(reply, bytes) else reply.encode("latin-1", "replace"))
        except ScpiError as error:
            self.errors.push(error.code)
        return b";".join(replies)

    def _units(self, message: str) -> Sequence[tuple[_Action, int, Sequence[str]]]:
        """Return what a message asks for; a header that is not known raises when its turn comes."""
        found = self._parsed.get(message)
        if found is None:
            found = [(*self._found(name, query), parameters) for name, query, parameters in units(message)]
            if len(self._parsed) < _MOST_PARSED:
                self._parsed[message] = found
        return found

    def _found(self, name: str, query: bool) -> tuple[_Action, int]:
        """Return what a header does, and its numeric suffix, 1 where it has none."""
        for pattern, asks, action in self._commands:
            match = pattern.fullmatch(name) if asks == query else None
            if match:
                return action, next((int(digits) for digits in match.groups() if digits), 1)
        return _unknown, 1

    def _common(self) -> None:
        manual = self._manual
        for header, text in manual.answers.items():
            self._know(header, True, _alone(partial(str, text)))
        for header in manual.ignored:
            self._know(header, False, _alone(lambda: None))
        self._know("*IDN", True, _alone(self._identify))
        self._know("SYSTem:ERRor[:NEXT]", True, _alone(lambda: self.errors.pop(manual.error_form)))
        self._know("*RST", False, _alone(self._reset))
        self._know("*CLS", False, _alone(self.errors.codes.clear))
        for header, form in manual.selects.items():
            self._know(header, False, self._select)
            if form:
                self._know(header, True, _alone(partial(self._selection, form)))

    def _add(self, row: Row) -> None:
        if isinstance(row, Reading):
            self._know(row.header, True, self._reads(row))
        elif isinstance(row, Setting):
            self._know(row.header, True, self._asks(row))
            self._know(row.header, False, self._sets(row))
        elif isinstance(row, Switch):
            off, on = self._manual.on_off
            read = Reading(row.header, lambda its, _: on if getattr(its, row.name) else off, by=row.by)
            if row.asked:
                self._know(row.header, True, self._reads(read))
            self._know(row.header, False, self._switches(row))
        elif isinstance(row, Clear):
            self._know(row.header, False, self._clears(row))
        elif isinstance(row, Numbers):
            self._know(row.header, False, self._sets_several(row))
        elif isinstance(row, Word):
            told = row.told
            read = Reading(row.header, lambda its, _: getattr(its, row.name), lambda its: told.get(its, its), row.by)
            self._know(row.header, True, self._reads(read))
            self._know(row.header, False, self._chooses(row))
        elif isinstance(row, Act):
            self._know(row.header, row.asked, self._acts(row))
        else:
            self._know(row.header, True, _alone(lambda: row.tell(self._channels, self._now_ns)))

    def _know(self, header: str, query: bool, action: _Action) -> None:
        told = self._manner.told(header) if query else None
        self._commands.append((keyword(header), query, _spelled(action, told) if told else action))

    def _reads(self, row: Reading) -> _Action:
        def action(suffix: int, parameters: Sequence[str]) -> str:
            values, channels = self._targets(row.by, suffix, parameters)
            if values:
                raise ScpiError(-108)
            return ",".join([row.form(row.read(channel, self._now_ns)) for channel in channels])

        return action

    def _asks(self, row: Setting) -> _Action:
        """Answer a setting, or with MIN, MAX or DEF its bounds."""

        def action(suffix: int, parameters: Sequence[str]) -> str:
            values, channels = self._targets(row.by, suffix, parameters)
            if values and row.usual is None:
                raise ScpiError(-108)
            bound = word(values[0]) if values else ""
            if bound is None:
                raise ScpiError(-224)
            return ",".join(row.form(_bound(row, channel, bound)) for channel in channels)

        return action

    def _sets(self, row: Setting) -> _Action:
        """Take a number, or MIN, MAX, DEF. All channels are set, or none."""

        def action(suffix: int, parameters: Sequence[str]) -> None:
            values, channels = self._targets(row.by, suffix, parameters)
            text = one(values)
            numbers = [_number_for(row, channel, text) for channel in channels]
            for channel, value in zip(channels, numbers, strict=True):
                _write(row, channel, value)

        return action

    def _sets_several(self, row: Numbers) -> _Action:
        def action(suffix: int, parameters: Sequence[str]) -> None:
            values, (channel, *_) = self._targets("parameter", suffix, parameters)
            if len(values) != len(row.settings):
                raise ScpiError(-108 if len(values) > len(row.settings) else -109)
            numbers = [_number_for(its, channel, text) for its, text in zip(row.settings, values, strict=True)]
            for its, value in zip(row.settings, numbers, strict=True):
                _write(its, channel, value)

        return action

    def _switches(self, row: Switch) -> _Action:
        def action(suffix: int, parameters: Sequence[str]) -> None:
            by: By = "selected" if row.all else row.by
            values, channels = self._targets(by, suffix, parameters)
            on = switch(one(values))
            for channel in self._channels.values() if row.all else channels:
                if row.name != "on":
                    setattr(channel, row.name, on)
                elif on and channel.tripped:
                    raise ScpiError(-221)
                else:
                    channel.switch(on, self._now_ns)
                channel.follow(self._now_ns)

        return action

    def _chooses(self, row: Word) -> _Action:
        words = [(keyword(text), meant) for text, meant in row.words.items()]

        def action(suffix: int, parameters: Sequence[str]) -> None:
            values, channels = self._targets(row.by, suffix, parameters)
            text = one(values).upper()
            meant = next((meant for pattern, meant in words if pattern.fullmatch(text)), None)
            if meant is None:
                raise ScpiError(-224)
            for channel in channels:
                setattr(channel, row.name, meant)

        return action

    def _acts(self, row: Act) -> _Action:
        def action(suffix: int, parameters: Sequence[str]) -> str | bytes | None:
            values, (channel, *_) = self._targets(row.by, suffix, parameters)
            return row.do(channel, values, self._now_ns)

        return action

    def _clears(self, row: Clear) -> _Action:
        def action(suffix: int, parameters: Sequence[str]) -> None:
            values, channels = self._targets("parameter", suffix, parameters)
            if values:
                raise ScpiError(-108)
            for channel in channels:
                for name in row.names:
                    setattr(channel, name, False)

        return action

    def _targets(self, by: By, suffix: int, parameters: Sequence[str]) -> tuple[list[str], list[Channel]]:
        """Split parameters into values and the channels that are meant."""
        values, chosen = self._split_off(tuple(parameters)) if by == "parameter" else (list(parameters), None)
        if by == "instrument":
            chosen = [0]
        elif by == "number":
            if suffix not in self._channels:
                raise ScpiError(-113)
            chosen = [suffix]
        try:
            return values, [self._channels[number] for number in ([self._selected] if chosen is None else chosen)]
        except KeyError:
            raise ScpiError(self._manual.no_channel) from None

    def _split_off(self, parameters: tuple[str, ...]) -> tuple[list[str], list[int] | None]:
        """Return values and channels; what was split before is remembered."""
        found = self._targeted.get(parameters)
        if found is None:
            found = self._manual.targets(parameters)
            if len(self._targeted) < _MOST_PARSED:
                self._targeted[parameters] = found
        return found

    def _select(self, _: int, parameters: Sequence[str]) -> None:
        match = re.fullmatch(r"(?:CH|OUT(?:P(?:UT)?)?)?(\d)", one(parameters).upper())
        if match is None or int(match[1]) not in self._channels:
            raise ScpiError(-224)
        self._selected = int(match[1])

    def _selection(self, form: str) -> str:
        return form.format(self._selected)

    def _identify(self) -> str:
        fault = self._faults.now(Identity, self._now_ns) if self._faults.faults else None  # asked before every reading
        return _marked(fault.value) if fault else self._identity

    def _reset(self) -> None:
        self._selected = 1
        for channel in self._channels.values():
            channel.reset(self._now_ns)


def _marked(identification: str) -> str:
    """Return an identification that says that the instrument is simulated, whatever a bench file has it say."""
    fields = identification.split(",")
    if len(fields) < 4:  # IEEE 488.2-1992, 10.14.3
        return f"{identification} SIMULATED"
    return ",".join((*fields[:2], f"SIM-{fields[2].strip()}", *fields[3:]))


def _unknown(_: int, parameters: Sequence[str]) -> None:
    del parameters
    raise ScpiError(-113)


def _spelled(action: _Action, told: Callable[[str], str]) -> _Action:
    def spelled(suffix: int, parameters: Sequence[str]) -> str | bytes | None:
        reply = action(suffix, parameters)
        return told(reply) if isinstance(reply, str) else reply

    return spelled


def _alone(act: Callable[[], str | None]) -> _Action:
    def action(_: int, parameters: Sequence[str]) -> str | None:
        if parameters:
            raise ScpiError(-108)
        return act()

    return action


def _write(row: Setting, channel: Channel, value: float) -> None:
    if row.write is None:
        setattr(channel, row.name, value)
    else:
        row.write(channel, value)


def _bound(row: Setting, channel: Channel, bound: str) -> float:
    """Return a setting, or what MIN, MAX or DEF stand for."""
    if not bound:
        return cast("float", getattr(channel, row.name))
    if bound == "MIN":
        return row.least
    return row.most(channel.rating) if bound == "MAX" or row.usual is None else row.usual(channel.rating)


def _number_for(row: Setting, channel: Channel, text: str) -> float:
    """Read the number of a setting for one channel."""
    bound = word(text)
    if bound and (bound != "DEF" or row.usual is not None):
        return _bound(row, channel, bound)
    value = number(text, row.units)
    if not row.least <= value <= row.most(channel.rating):
        raise ScpiError(-222)
    return value
