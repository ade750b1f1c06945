"""The board that plays the on-board computer; its protocol is the page about the OBC link."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Connection, Outlet
from hil.instruments.marks import reads
from hil.instruments.obc_link.bus import ObcBus
from hil.instruments.obc_link.messages import Command, conversions
from hil.instruments.obc_link.session import ObcSession
from hil.instruments.roles import Obc
from hil.model.bench import Wire
from hil.model.errors import Garbled, Refused
from hil.model.figure import Figure
from hil.model.identity import Identity

__all__ = ["ObcBoard", "ObcLink"]

_CONVERSIONS = 64
_MILLIVOLTS = 1000.0


class ObcBoard:
    """The board itself; fills the role `obc`."""

    def __init__(self, session: ObcSession) -> None:
        self._session = session

    @reads
    def identify(self) -> str:
        """Return protocol version, firmware and build hash."""
        board = self._session.identify()
        return f"protocol {board.major}.{board.minor}, {board.name} {board.firmware}, build {board.build}"

    @reads
    def analog(self, channel: int) -> Figure:
        """Return the voltage of one analogue input in V, the mean of 64 conversions; NaN at full scale.

        The standard uncertainty holds the scatter of the mean and the converter's step, not the reference's.

        Raises:
            Refused: the board says that it has no such input; nothing was asked of it.
        """
        channels = self._session.board().channels
        if not 0 <= channel < channels:
            has = f"its inputs are 0 to {channels - 1}" if channels else "it has none"
            raise Refused(f"{self._session.device}: no analogue input has the number {channel}", has)
        fields = self._session.request(Command.ADC, struct.pack("<BH", channel, _CONVERSIONS)).fields
        found = self._session.read("ADC", conversions, fields)
        if (found.channel, found.taken) != (channel, _CONVERSIONS) or not found.full_scale:
            raise Garbled(
                self._session.device,
                f"asked for {_CONVERSIONS} conversions of channel {channel}, got {found.taken} of {found.channel}",
                "compare the firmware with the protocol",
            )
        mean = found.total / found.taken
        variance = max(0.0, found.squares - found.total * mean) / (found.taken - 1)
        step = found.reference_mv / _MILLIVOLTS / found.full_scale
        return Figure(
            value=mean * step if mean < found.full_scale else math.nan,
            unit="V",
            uncertainty=step * math.sqrt(variance / found.taken + 1.0 / 12.0),
            dof=found.taken - 1,
        )


_SIMULATED = b"SIMULATE".hex()
"""What a simulated board says instead of the commit of its firmware."""


class ObcLink:
    """Driver `obc-link`: role `obc`, and the I2C bus of the board."""

    roles: ClassVar[frozenset[str]] = frozenset({"obc"})
    capabilities: ClassVar[frozenset[str]] = frozenset({ANY_BYTE})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: an obc-link is reached by a port", "give it `port:`")
        self._connection = connection
        self._session = ObcSession(connection.device, connection.port, connection.clock)

    @property
    def session(self) -> ObcSession:
        """The session with the board, which counts what did not go smoothly."""
        return self._session

    def identify(self) -> Identity:
        """Ask the board who it is: the firmware's name is the model, the chip's unique id the serial number."""
        board = self._session.identify()
        build = "SIMULATED" if board.build == _SIMULATED else board.build
        return Identity(model=board.name, serial=board.unique_id, firmware=f"{board.firmware}+{build}")

    def outlets(self) -> Sequence[Outlet]:
        """Return nothing: the board has no outputs."""
        return ()

    def bus(self, frequency_hz: float = 100_000.0) -> ObcBus:
        """Return the board's I2C bus; nothing is sent before its first transfer, which sets its speed."""
        return ObcBus(self._session, self._connection.clock, frequency_hz=round(frequency_hz))

    def role(self, wire: Wire) -> Obc:
        """Return the board."""
        if wire.role not in self.roles:
            raise Refused(
                f"wiring {wire.name}: an obc-link does not fill the role {wire.role}", "it fills the role obc"
            )
        settings.read(wire, settings.NoSettings)
        return ObcBoard(self._session)
