"""The commands of level 2."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Protocol

from hil.simulation.peers.cycler.lines import Command, Output
from hil.simulation.peers.cycler.make import Make, Reading
from hil.simulation.peers.cycler.relays import Relays
from hil.simulation.peers.cycler.sequence import RUNNING, TABLE, Sequence, Settings, text_of

__all__ = ["Commands", "Device"]

_RUN = re.compile(r"[0-9A-F]{8}")
_CRC = re.compile(r"[0-9A-F]{4}")
_LONGEST_WORD = 16


class Device(Protocol):
    """What the commands act on."""

    make: Make
    boots: int
    reset_reason: str
    output: Output
    relays: Relays
    sequence: Sequence
    settings: Settings

    def measure(self) -> Reading:
        """Return what is measured now."""
        ...

    def start(self, run: str) -> None:
        """Begin a test."""
        ...

    def stop(self) -> None:
        """Open the relays, and end a test."""
        ...

    def beat(self) -> None:
        """Take a heartbeat."""
        ...


class _Refusal(Exception):
    """The command is answered with an error: its name, and a word that says what is meant."""

    def __init__(self, name: str, word: str) -> None:
        super().__init__(name)
        self.name = name
        self.word = word[:_LONGEST_WORD].replace("*", "?")


class Commands:
    """Executes what the host says.

    Args:
        device: what the commands act on.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._sequence = device.sequence
        self._settings = device.settings
        self._known: Mapping[str, Callable[[tuple[str, ...]], str]] = {
            "BEAT": self._beat,
            "CLEAR": self._clear,
            "GET": self._get,
            "ID": self._id,
            "SET": self._set,
            "START": self._start,
            "STATE": self._state,
            "STOP": self._stop,
        }

    def execute(self, command: Command) -> str:
        """Execute a command; return its reply."""
        try:
            return f":{command.tag} OK {self._action(command.name)(command.fields)}"
        except _Refusal as refusal:
            return f":{command.tag} ERROR {refusal.name} {refusal.word}"

    def _action(self, name: str) -> Callable[[tuple[str, ...]], str]:
        if name not in self._known:
            raise _Refusal("COMMAND", name)
        return self._known[name]

    def _id(self, fields: tuple[str, ...]) -> str:
        _values(fields)
        make, boots, reset = self._device.make, self._device.boots, self._device.reset_reason
        firmware = f"firmware={make.truth.marked_firmware} serial={make.truth.serial}"
        return f"level=2.0 name=hil-cycler {firmware} boots={boots} reset={reset}"

    def _state(self, fields: tuple[str, ...]) -> str:
        _values(fields)
        sequence, output = self._sequence, self._device.output
        volts, amperes, degrees = self._device.measure()
        test = f"state={sequence.phase} run={sequence.run or '-'} cycle={sequence.cycle}"
        device = f"relays={self._device.relays.letter} lines={output.number} ms={output.milliseconds()}"
        battery = (
            f"v={text_of(volts, 3)} i={text_of(amperes, 3)} e={text_of(sequence.energy, 4)} t={text_of(degrees, 1)}"
        )
        return f"{test} {device} {battery}"

    def _get(self, fields: tuple[str, ...]) -> str:
        if not fields:
            raise _Refusal("FIELD", "-")
        name, *surplus = fields
        _known_setting(name)
        _values(tuple(surplus))
        return self._settings.show(name)

    def _set(self, fields: tuple[str, ...]) -> str:
        if not fields:
            raise _Refusal("FIELD", "-")
        name, _, text = fields[0].partition("=")
        _known_setting(name)
        value = self._settings.number(name, text)
        if value is None:
            raise _Refusal("FIELD", name)
        _values(fields[1:])
        if not self._settings.allows(name, value):
            raise _Refusal("RANGE", name)
        self._refuse_running()
        self._settings.values[name] = value
        return self._settings.show(name)

    def _start(self, fields: tuple[str, ...]) -> str:
        run, settings = _values(fields, run=_RUN, settings=_CRC)
        sequence = self._sequence
        if sequence.phase in RUNNING and run == sequence.run:
            self._device.beat()
            return f"run={run}"
        self._refuse_running()
        if sequence.phase != "IDLE":
            raise _Refusal("STATE", sequence.phase)
        if run == sequence.run:
            raise _Refusal("RUN", run)
        if settings != self._settings.check():
            raise _Refusal("SETTINGS", self._settings.check())
        if wrong := self._settings.contradiction() or "":
            raise _Refusal("ORDER", wrong)
        if limit := sequence.outside(self._device.measure()):
            raise _Refusal("LIMIT", limit)
        self._device.start(run)
        return f"run={run}"

    def _beat(self, fields: tuple[str, ...]) -> str:
        (run,) = _values(fields, run=_RUN)
        if self._sequence.phase not in RUNNING:
            raise _Refusal("STATE", self._sequence.phase)
        if run != self._sequence.run:
            raise _Refusal("RUN", self._sequence.run)
        self._device.beat()
        return f"run={run}"

    def _stop(self, fields: tuple[str, ...]) -> str:
        _values(fields)
        self._device.stop()
        return f"state={self._sequence.phase}"

    def _clear(self, fields: tuple[str, ...]) -> str:
        _values(fields)
        self._refuse_running()
        self._sequence.clear()
        return "state=IDLE"

    def _refuse_running(self) -> None:
        if self._sequence.phase in RUNNING:
            raise _Refusal("BUSY", self._sequence.run)


def _known_setting(name: str) -> None:
    if name not in TABLE:
        raise _Refusal("FIELD", name.partition("=")[0])


def _values(fields: tuple[str, ...], **expected: re.Pattern[str]) -> list[str]:
    """Return the values of the fields, which must be these, in this order, and no others."""
    values = []
    for place, (key, pattern) in enumerate(expected.items()):
        if place >= len(fields):
            raise _Refusal("FIELD", "-")
        name, _, value = fields[place].partition("=")
        if name != key or not pattern.fullmatch(value):
            raise _Refusal("FIELD", name)
        values.append(value)
    for surplus in fields[len(expected) :]:
        raise _Refusal("FIELD", surplus.partition("=")[0])
    return values
