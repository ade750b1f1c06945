"""Korad KA3005P power supplies, also sold as Tenma 72-2540, Velleman PS3005D and RND 320-KA3005P.

The over-voltage protection has no level of its own: it trips at the voltage setpoint. It protects against a fault of
the supply, not against a wrong setting, so the driver does not claim `over-voltage-level`. In the status byte only the
bits 0x40, 0x20 and 0x01 mean the same on every firmware.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Connection, Outlet
from hil.instruments.korad_line import KoradLine, Question, switched_off
from hil.instruments.marks import drives, reads
from hil.instruments.roles import SUPPLY, Supply
from hil.instruments.safing import must_be_state, own_bounds
from hil.model.bench import Proof, Wire
from hil.model.errors import Refused, Rejected
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.notation import matching
from hil.model.safing import SafeBytes

__all__ = ["KoradKa3005p", "KoradOutput", "KoradSettings"]

_CHANNEL = 1
_TIMES_OFF = 2
_ON, _PROTECTED, _CONSTANT_VOLTAGE = 0x40, 0x20, 0x01
_DECIMALS = {"voltage": 2, "current": 3}
_COMMANDS = {"voltage": "VSET1:{:05.2f}", "current": "ISET1:{:05.3f}"}
_MOST = {"voltage": 99.99, "current": 9.999}  # the largest that a command can hold; the supply's range is smaller
_SAME = 1e-6
_AtSetting = Annotated[
    str,
    matching("at setting", "'at setting' or left out: the protections of a korad-ka3005p have no level of their own"),
]
_VOLTS, _AMPERES = re.compile(rb"\d\d\.\d\d"), re.compile(rb"\d\.\d\d\d")
_STATUS = Question(command=b"STATUS?", form=re.compile(rb"[^\r\n]"), width=1, proof=True, steady=_ON | _PROTECTED)
_SET = {
    "voltage": Question(command=b"VSET1?", form=_VOLTS, width=5),
    "current": Question(command=b"ISET1?", form=_AMPERES, width=5, spare=1),
}
_MEASURED = {
    "V": Question(command=b"VOUT1?", form=_VOLTS, width=5),
    "A": Question(command=b"IOUT1?", form=_AMPERES, width=5),
}
_SAYS_OFF = rb"[^\x40-\x7f\xc0-\xff\r\n]"  # a status byte without bit 0x40, not the terminator of another reply
_NAMES = {"KORAD": "Korad", "TENMA": "Tenma", "VELLEMAN": "Velleman", "RND": "RND"}
_IDENTIFICATION = re.compile(rf"({'|'.join(_NAMES)}) ?(.+?) ?V(\d+\.\d+)(?: SN:(\w+))?", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class KoradSettings:
    """Wire settings: which protections are switched on."""

    over_voltage: _AtSetting = ""
    over_current: _AtSetting = ""


class KoradOutput:
    """The output; fills the role `supply`.

    Every setting is checked against the clamps right before its bytes leave, sent once, and read back. Switching on
    checks the supply's present settings against the clamps too.

    Args:
        name: the wire's dotted name.
        connection: how the supply is reached.
        line: the supply's serial line.
        protections: commands that switch the wire's protections on.
    """

    def __init__(self, name: str, connection: Connection, line: KoradLine, protections: Sequence[str]) -> None:
        self._name = name
        self._connection = connection
        self._line = line
        self._protections = tuple(protections)

    @drives
    def configure(self, voltage: float, current: float) -> None:
        """Set the current limit [A], the voltage [V] and the protections, in this order.

        Raises:
            Refused: a value cannot be sent; nothing was sent.
            ClampExceeded: a value exceeds a clamp; nothing was sent.
            Rejected: a setting reads back differently.
        """
        values = {"current": self._sendable("current", current), "voltage": self._sendable("voltage", voltage)}
        for quantity, value in values.items():
            self._connection.clamps.permit(_CHANNEL, quantity, value)
        for quantity, value in values.items():
            self._set(quantity, value)
        self._protect()

    @drives
    def enable(self) -> None:
        """Switch the output on, if the clamps permit its settings."""
        for quantity, question in _SET.items():
            self._connection.clamps.permit(_CHANNEL, quantity, float(self._line.ask(question)))
        self._protect()
        self._line.setting("OUT1")
        if not self.enabled():
            raise Rejected(
                self._connection.device,
                f"{self._name} was switched on and is off",
                "check the supply's display: a protection may have tripped at its setting, or a command was lost",
            )

    @drives
    def disable(self) -> None:
        """Switch the output off; the bytes leave at once, whatever state the line is in.

        Nothing acknowledges the command, and one sent too soon after another is lost together with it. So it is
        repeated if the supply reports that it is still on.
        """
        for _ in range(_TIMES_OFF):
            self._line.setting("OUT0", urgent=True)
            if not self.enabled():
                return
        raise Rejected(
            self._connection.device, f"{self._name} was switched off and is on", "cut its mains, then check it"
        )

    @reads
    def enabled(self) -> bool:
        """Return whether the supply reports its output as on."""
        return bool(self._status() & _ON)

    @reads
    def voltage(self) -> Figure:
        """Return the measured voltage in V; its uncertainty comes from the certificate, not from the driver."""
        return Figure(value=float(self._line.ask(_MEASURED["V"])), unit="V")

    @reads
    def current(self) -> Figure:
        """Return the measured current in A; its uncertainty comes from the certificate, not from the driver."""
        return Figure(value=float(self._line.ask(_MEASURED["A"])), unit="A")

    @reads
    def mode(self) -> str:
        """Return `CV`, `CC` or `off`."""
        status = self._status()
        if not status & _ON:
            return "off"
        return "CV" if status & _CONSTANT_VOLTAGE else "CC"

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes of off; see `hil.instruments.roles.SafeByBytes`. Voltage and current can be queried."""
        must_be_state(SUPPLY, self._name, state)
        questions: list[tuple[bytes, bytes, tuple[float, float] | None]] = [(_STATUS.command, _SAYS_OFF, None)] * 2
        for quantity, unit in (("voltage", "V"), ("current", "A")):
            if bounds := own_bounds(self._name, proof, quantity):
                measured = _MEASURED[unit]
                questions.append((measured.command, b"(" + measured.form.pattern + b")", bounds))
        return switched_off(tuple(questions), self._line.timeout)

    def _status(self) -> int:
        return self._line.ask(_STATUS)[0]

    def _protect(self) -> None:
        """Switch the wire's protections on; the status byte only shows whether any of them is on."""
        for command in self._protections:
            self._line.setting(command)
        if self._protections and not self._status() & _PROTECTED:
            raise Rejected(
                self._connection.device,
                f"{self._name}: its protections were switched on and are off",
                "check the supply's display, and whether its firmware has them",
            )

    def _set(self, quantity: str, value: float) -> None:
        """Check against the clamps, send, read back, compare."""
        command = _COMMANDS[quantity].format(value)
        self._connection.clamps.permit(_CHANNEL, quantity, value)
        self._line.setting(command)
        taken = float(self._line.ask(_SET[quantity]))
        if not abs(taken - value) <= _SAME:
            raise Rejected(
                self._connection.device,
                f"{self._name}: {quantity} was set by {command} and reads back {taken:g}",
                "compare the setting with the supply's ratings; it silently ignores what it cannot do",
            )

    def _sendable(self, quantity: str, value: float) -> float:
        """Return the value as it will be sent, so that the clamps check that one."""
        if not (math.isfinite(value) and 0 <= round(value, _DECIMALS[quantity]) <= _MOST[quantity]):
            raise Refused(
                f"{self._name}: {quantity} {value:g} is not a number to set", f"give 0 to {_MOST[quantity]:g}"
            )
        return abs(round(value, _DECIMALS[quantity]))


class KoradKa3005p:
    """Driver `korad-ka3005p`: role `supply` on channel 1.

    A wire may set `over_voltage` and `over_current` to `at setting`, which switches these protections on.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"supply"})
    capabilities: ClassVar[frozenset[str]] = frozenset({ANY_BYTE})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: the driver korad-ka3005p needs a port", "give it `port:` and `baud:`")
        self._connection = connection
        self._line = KoradLine(connection.device, connection.port, connection.clock, timeout=connection.timeout)

    def identify(self) -> Identity:
        """Query `*IDN?`; most firmware reports no serial number."""
        text = self._line.identification()
        match = _IDENTIFICATION.fullmatch(text)
        simulated = "SIMULATED" if "V0.0" in text else ""
        if match is None:
            return Identity(model=text, firmware=simulated)
        return Identity(
            manufacturer=_NAMES[match[1]], model=match[2], serial=match[4] or "", firmware=simulated or match[3]
        )

    def outlets(self) -> Sequence[Outlet]:
        """Query whether the output is on."""
        return (Outlet(_CHANNEL, bool(self._line.ask(_STATUS)[0] & _ON)),)

    def role(self, wire: Wire) -> Supply:
        """Return the output."""
        settings.fits(wire, "korad-ka3005p", self.roles, (_CHANNEL,))
        own = settings.read(wire, KoradSettings)
        switches = ((own.over_voltage, "OVP1"), (own.over_current, "OCP1"))
        protections = [command for setting, command in switches if setting]
        return KoradOutput(wire.name, self._connection, self._line, protections)
