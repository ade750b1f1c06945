"""Driver of the board that stands in for the on-board computer; protocol: the page on the OBC link."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, ClassVar

from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Connection, Outlet
from hil.instruments.marks import reads
from hil.instruments.obc_link.bus import ObcBus
from hil.instruments.obc_link.messages import Command, Conversions, conversions
from hil.instruments.obc_link.session import ObcSession
from hil.instruments.roles import Obc
from hil.instruments.sampled import Channel
from hil.model.bench import Wire
from hil.model.errors import Garbled, Refused
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.notation import AnyText, whole

__all__ = ["ObcBoard", "ObcLink", "ObcWire"]

_CONVERSIONS = 64
_MILLIVOLTS = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ObcWire:
    """Wire settings of the analogue inputs: names of those to record, and conversions per sample."""

    a0: AnyText = ""
    a1: AnyText = ""
    a2: AnyText = ""
    a3: AnyText = ""
    a4: AnyText = ""
    a5: AnyText = ""
    conversions: Annotated[int, whole(2, 1024)] = 16


class ObcBoard:
    """The board itself; fills the role `obc`. A sample is the mean count of each named input.

    Args:
        session: the board's session.
        wire: the named inputs.
    """

    def __init__(self, session: ObcSession, wire: ObcWire) -> None:
        self._session = session
        self._conversions = wire.conversions
        names = (getattr(wire, each.name) for each in fields(wire) if each.name != "conversions")
        self._inputs = {number: name for number, name in enumerate(names) if name}

    def channels(self) -> tuple[Channel, ...]:
        """Return the named inputs."""
        return tuple(Channel(name, "LSB") for name in self._inputs.values())

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return the mean raw conversion of each named input, read one after the other.

        Raises:
            Refused: the wire names none.
        """
        if not self._inputs:
            raise Refused(f"{self._session.device}: no analogue input is named", "name one, such as `a0: photodiode`")
        found = [self._converted(channel, self._conversions) for channel in self._inputs]
        return tuple([each.total / each.taken for each in found])

    @reads
    def full_scale(self) -> Figure:
        """Return the full-scale count in LSB."""
        return Figure(value=float(self._converted(0, 1).full_scale), unit="LSB", uncertainty=0.0)

    @reads
    def reference(self) -> Figure:
        """Return the converter's reference in V as measured by the board itself; its uncertainty is unknown."""
        return Figure(value=self._converted(0, 1).reference_mv / _MILLIVOLTS, unit="V")

    @reads
    def identify(self) -> str:
        """Return protocol version, firmware and build hash."""
        board = self._session.identify()
        return f"protocol {board.major}.{board.minor}, {board.name} {board.firmware}, build {board.build}"

    @reads
    def analog(self, channel: int) -> Figure:
        """Return the voltage of one analogue input in V, the mean of 64 conversions; NaN at full scale.

        The standard uncertainty covers the scatter of the mean and the converter's resolution, not the reference.

        Raises:
            Refused: the board reports no such input; it was not queried.
        """
        found = self._converted(channel, _CONVERSIONS)
        mean = found.total / found.taken
        variance = max(0.0, found.squares - found.total * mean) / (found.taken - 1)
        step = found.reference_mv / _MILLIVOLTS / found.full_scale
        return Figure(
            value=mean * step if mean < found.full_scale else math.nan,
            unit="V",
            uncertainty=step * math.sqrt(variance / found.taken + 1.0 / 12.0),
            dof=found.taken - 1,
        )

    def _converted(self, channel: int, count: int) -> Conversions:
        channels = self._session.board().channels
        if not 0 <= channel < channels:
            has = f"its inputs are 0 to {channels - 1}" if channels else "it has none"
            raise Refused(f"{self._session.device}: no analogue input has the number {channel}", has)
        reply = self._session.request(Command.ADC, struct.pack("<BH", channel, count))
        found = self._session.read("ADC", conversions, reply.fields)
        if (found.channel, found.taken) != (channel, count) or not found.full_scale:
            raise Garbled(
                self._session.device,
                f"asked for {count} conversions of channel {channel}, got {found.taken} of {found.channel}",
                "compare the firmware with the protocol",
            )
        return found


_SIMULATED = b"SIMULATE".hex()
"""A simulated board reports this instead of its firmware's commit."""


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
        """The session with the board, with its counters of retries and damaged frames."""
        return self._session

    def identify(self) -> Identity:
        """Query the board's identity: the firmware's name is the model, the chip's unique ID the serial number."""
        board = self._session.identify()
        build = "SIMULATED" if board.build == _SIMULATED else board.build
        return Identity(model=board.name, serial=board.unique_id, firmware=f"{board.firmware}+{build}")

    def outlets(self) -> Sequence[Outlet]:
        """Return an empty list: the board has no outputs."""
        return ()

    def bus(self, frequency_hz: float = 100_000.0) -> ObcBus:
        """Return the board's I2C bus; nothing is sent before its first transfer, which sets the bus clock."""
        return ObcBus(self._session, self._connection.clock, frequency_hz=round(frequency_hz))

    def role(self, wire: Wire) -> Obc:
        """Return the board."""
        if wire.role not in self.roles:
            raise Refused(
                f"wiring {wire.name}: an obc-link does not fill the role {wire.role}", "it fills the role obc"
            )
        asked = settings.read(wire, ObcWire)
        board = ObcBoard(self._session, asked)
        names = [channel.name for channel in board.channels()]
        if len(set(names)) < len(names):
            raise Refused(f"wiring {wire.name}: two inputs have one name", "give each a name of its own")
        return board
