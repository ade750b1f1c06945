"""The driver `cycler`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments.cycler.lines import BANNER
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.session import Session
from hil.instruments.cycler.status import Status
from hil.instruments.cycler.tester import BatteryTester
from hil.instruments.cycler.wiring import Wiring
from hil.instruments.driver import Connection, Outlet
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.identity import Identity

__all__ = ["BatteryCycler"]


class BatteryCycler:
    """Driver `cycler`: role `cycler`. A wire may set `level`, `beat` and `cycles`, see `Wiring`.

    Opening the port resets most devices; the driver waits for the banner, or for another line that tells the level.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"cycler"})
    resets_on_open: ClassVar[bool] = True

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a cycler is reached by a serial port", "give it `port:`")
        self._session = Session(connection.device, connection.port, connection.clock)

    def opened_anew(self) -> None:
        """Forget what the line has told: the opening resets most devices, and a test that ran is over."""
        self._session.opened_anew()

    def identify(self) -> Identity:
        """Wait until a line tells the level; ask a device of level 2 who it is, a level 1 device has its banner only.

        Raises:
            NoReply: no line did.
            DeviceFault: it does not answer, or nonsense.
        """
        if not isinstance(self._session.meet(), NumberedLines):
            return Identity(model=BANNER.decode("ascii"))
        found = self._session.identify()
        return Identity(model=found.name, serial=found.serial, firmware=found.firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Return one outlet for both relays: on while one is closed, in level 1 while a test runs.

        Raises:
            DeviceFault: as `identify`.
        """
        told = self._session.meet()
        on = Status.ask(self._session).relays != "-" if isinstance(told, NumberedLines) else told.running
        return (Outlet(0, on=on),)

    def role(self, wire: Wire) -> BatteryTester:
        """Return the device in the wire's settings."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: a cycler is no {wire.role}", "it fills the role cycler")
        if wire.channel:
            raise Refused(f"wiring {wire.name}: a cycler has no channels", "leave `channel` out")
        return BatteryTester(wire.name, self._session, Wiring.read(wire))
