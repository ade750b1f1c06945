"""The driver `iim42652`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments.driver import Connection, Outlet
from hil.instruments.iim42652.mode import Mode
from hil.instruments.iim42652.registers import ITS_NAME, Register, Registers
from hil.instruments.iim42652.sensor import Iim42652Gyroscope
from hil.instruments.roles import Gyroscope
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.identity import Identity

__all__ = ["Iim42652"]


class Iim42652:
    """Driver `iim42652`: role `gyroscope`, over a bus of the host or of an OBC.

    A wire may set `range`, `rate`, `bandwidth` and `line`, see `Mode`.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"gyroscope"})

    def __init__(self, connection: Connection) -> None:
        if connection.bus is None:
            raise Refused(f"{connection.device}: an iim42652 is reached by an I2C bus", "give it `bus:` and `address:`")
        self._registers = Registers(connection.device, connection.bus, connection.address)
        self._clock = connection.clock

    def identify(self) -> Identity:
        """Read WHO_AM_I; it names the type, and nothing names the article."""
        name = self._registers.read(Register.WHO_AM_I)
        return Identity(model="IIM-42652" if name == ITS_NAME else f"WHO_AM_I {name:#04x}")

    def outlets(self) -> Sequence[Outlet]:
        """Return nothing: a sensor has no outputs."""
        return ()

    def role(self, wire: Wire) -> Gyroscope:
        """Return the sensor in the wire's mode."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: an iim42652 is no {wire.role}", "it fills the role gyroscope")
        if wire.channel:
            raise Refused(f"wiring {wire.name}: an iim42652 has no channels", "leave `channel` out")
        return Iim42652Gyroscope(self._registers, self._clock, Mode.read(wire))
