"""A Korad KA3005P power supply as its serial port shows it: no line ends, replies of fixed width, no errors.

Facts: 9600 bits per second; `VSET1:04.20`, `ISET1:0.700`, `OUT1`, `OVP1`, `OCP1` say nothing; replies to `VSET1?` and
`VOUT1?` are five characters `04.20`, to `ISET1?` and `IOUT1?` `0.700`, to `STATUS?` one byte: bit 6 output on,
bit 5 a protection switched on, bit 0 constant voltage. Some firmware sends a sixth byte after `ISET1?`, and some ends
every reply with a line feed, carriage return and line feed, or NUL.

Assumed: a silence of five milliseconds ends a command, the next one is taken when it was executed, and what comes in
between is lost; a setting beyond the range is not taken; a protection acts 20 mV above the voltage that is set, or when
the current is limited; the other bits of the status byte (beeper, lock) stand still.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, one_of
from hil.simulation.faults import Fault, Faults, Identity
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.supply_output import CoarseTruth, Rating, RefuseOff, SupplyOutput
from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "KoradKa3005p", "KoradOutput", "KoradTruth", "StrayByte", "build"]

_SILENCE_NS = 5_000_000
_WATCH_NS = 10_000_000
_LONGEST_COMMAND = 32
_ON, _PROTECTED, _BEEPER, _CONSTANT_VOLTAGE = 0x40, 0x20, 0x10, 0x01
_ENDS = {"none": b"", "lf": b"\n", "crlf": b"\r\n", "nul": b"\0"}
_OVER_VOLTS, _OVER_AMPERES = 0.02, 0.002
_RATING = Rating(30.0, 5.0, 31.0, 5.1, 33.0)  # settings up to 31 V and 5.1 A; its protections have no level


@dataclass(frozen=True, slots=True, kw_only=True)
class StrayByte(Fault):
    """A byte that belongs to nothing follows the current's setting."""

    name = "stray-byte"


@dataclass(frozen=True, slots=True, kw_only=True)
class KoradTruth:
    """One device: what it says of itself, what it ends replies with, and how long a command takes [s]."""

    identity: AnyText = "KORADKA3005PV2.0"
    reply_end: Annotated[str, one_of(*_ENDS)] = "none"
    command_time: NotNegative = 0.02


class KoradOutput(SupplyOutput):
    """The output; its protections have no level of their own, they trip at what is set."""

    trips_on_voltage: Kept[bool] = False
    trips_on_current: Kept[bool] = False

    def protect(self, now_ns: int) -> None:
        """Switch off where a protection is on and its setting is exceeded."""
        over = self.trips_on_voltage and self._terminal.volts() > self.volts + _OVER_VOLTS
        limiting = self.trips_on_current and (
            self.mode() == "CC" or self._terminal.amperes() > self.limit + _OVER_AMPERES
        )
        if self.on and (over or limiting):
            self.switch(on=False, now_ns=now_ns)

    @property
    def watched(self) -> bool:
        """Whether a protection could trip without another command."""
        return self.on and (self.trips_on_voltage or self.trips_on_current)


class KoradKa3005p(Stateful):
    """The supply: bytes until a silence are a command.

    Args:
        identity: what `*IDN?` answers.
        output: its only output.
        faults: what goes wrong.
        end: what it ends replies with.
        command_ns: how long a command takes after its last byte and the silence.
    """

    _output: Kept[KoradOutput]
    _inbox: Kept[bytes]
    _working: Kept[bytes]
    _quiet: Kept[Alarm]
    _due: Kept[Alarm]
    _watching: Kept[Alarm]

    def __init__(self, identity: bytes, output: KoradOutput, faults: Faults, *, end: bytes, command_ns: int) -> None:
        self._identity = identity
        self._end = end
        self._output = output
        self._faults = faults
        self._command_ns = command_ns
        self._inbox = b""
        self._working = b""
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; the output starts off."""
        self._line = line
        self._clock = clock
        self._quiet, self._due = Alarm(clock, self._ended), Alarm(clock, self._work)
        self._watching = Alarm(clock, self._protect)
        self._output.apply()

    def receive(self, data: bytes) -> None:
        """Take bytes of a command; while one is executed they are lost."""
        if self._working:
            return
        self._inbox = (self._inbox + data)[:_LONGEST_COMMAND]
        if data:
            self._quiet.set(self._clock.now_ns() + _SILENCE_NS)

    def _ended(self) -> None:
        """Take what came as a command."""
        self._working, self._inbox = self._inbox, b""
        self._due.set(self._clock.now_ns() + self._command_ns)

    def _work(self) -> None:
        command, self._working = self._working.decode("latin-1").strip(), b""
        reply = self._answer(command)
        if reply:
            self._line.send(reply + self._end)
        else:
            self._set(command)
        self._protect()

    def _answer(self, command: str) -> bytes:
        now_ns, output = self._clock.now_ns(), self._output
        if command == "*IDN?":
            fault = self._faults.now(Identity, now_ns)
            return _marked(fault.value).encode("latin-1", "replace") if fault else self._identity
        if command == "STATUS?":
            return bytes((self._status(),))
        if command == "ISET1?":
            return f"{output.limit:5.3f}".encode() + (b"K" if self._faults.now(StrayByte, now_ns) else b"")
        texts = {
            "VSET1?": lambda: f"{output.volts:05.2f}",
            "VOUT1?": lambda: f"{max(0.0, output.read_volts(now_ns)):05.2f}",
            "IOUT1?": lambda: f"{max(0.0, output.read_amperes(now_ns)):5.3f}",
        }
        return texts[command]().encode() if command in texts else b""

    def _set(self, command: str) -> None:
        """Do what a setting says; nonsense is passed over in silence."""
        if match := re.fullmatch(r"(VSET|ISET)1:(\d{1,2}(?:\.\d{0,3})?)", command):
            value, rating = float(match[2]), self._output.rating
            if match[1] == "VSET" and value <= rating.most_volts:
                self._output.set_volts(value)
            if match[1] == "ISET" and value <= rating.most_amperes:
                self._output.set_limit(value)
        elif match := re.fullmatch(r"(OUT|OVP|OCP)([01])", command):
            on = match[2] == "1"
            if match[1] == "OUT":
                self._output.switch(on, self._clock.now_ns())
            elif match[1] == "OVP":
                self._output.trips_on_voltage = on
            else:
                self._output.trips_on_current = on

    def _status(self) -> int:
        output = self._output
        protected = output.trips_on_voltage or output.trips_on_current
        regulating = 0 if output.mode() == "CC" else _CONSTANT_VOLTAGE
        return _BEEPER | (_ON if output.on else 0) | (_PROTECTED if protected else 0) | regulating

    def _protect(self) -> None:
        now_ns = self._clock.now_ns()
        self._output.protect(now_ns)
        if self._watching.due_ns is None and self._output.watched:
            self._watching.set((now_ns // _WATCH_NS + 1) * _WATCH_NS)


def _marked(identification: str) -> str:
    """Return an identification that says that the supply is simulated: version 0.0, which no real one has."""
    marked, count = re.subn(r"V\d+\.\d+", "V0.0", identification)
    return marked if count else f"{identification} SIMULATED"


def build(setup: PeerSetup) -> KoradKa3005p:
    """Build the supply; terminal `1` goes to a supply port of a plant.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    own, article = truth.part(CoarseTruth), truth.part(KoradTruth)
    output = KoradOutput(
        1,
        _RATING,
        truth=own,
        terminal=setup.connections.port("1", own.load),
        faults=setup.faults,
        noise=(setup.stream("voltage"), setup.stream("current")),
    )
    setup.finish()
    return KoradKa3005p(
        _marked(article.identity).encode("latin-1", "replace"),
        output,
        setup.faults,
        end=_ENDS[article.reply_end],
        command_ns=round(article.command_time * NANOSECONDS),
    )


MODEL = PeerModel(link="serial", fault_kinds=(Identity, RefuseOff, StrayByte), build=build)
"""The model for the driver `korad-ka3005p`."""
