"""Rigol DP832 and DP832A triple-output power supplies.

Commands: DP800 Series Programming Guide. The channel that `:INST` selects is the instrument's state, which the front
panel and other programs change; every command here names its channel instead. Nothing says that the instrument takes
several questions in a line, so replies are closed by the identification. It is never reset.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.capabilities import OVER_VOLTAGE_LEVEL
from hil.instruments.driver import Connection, Outlet
from hil.instruments.pacing import PacedPort
from hil.instruments.roles import Supply
from hil.instruments.scpi.closed import ClosedSession
from hil.instruments.scpi.supply import Dialect, Protection, ScpiOutput
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.identity import Identity

__all__ = ["DP800", "RigolDp832"]

_MODES = {"CV": "CV", "CC": "CC", "UR": "unregulated"}


def _as_state(reply: str) -> bool:
    if reply not in {"ON", "OFF"}:
        raise ValueError("ON or OFF")
    return reply == "ON"


def _as_trip(reply: str) -> bool:
    if reply not in {"YES", "NO"}:
        raise ValueError("YES or NO")
    return reply == "YES"


def _as_mode(reply: str) -> str:
    if reply not in _MODES:
        raise ValueError("CV, CC or UR")
    return _MODES[reply]


DP800 = Dialect(
    channels=(1, 2, 3),
    decimals=3,
    tolerance=0.0055,
    set_voltage=":SOUR{channel}:VOLT {value}",
    get_voltage=":SOUR{channel}:VOLT?",
    set_current=":SOUR{channel}:CURR {value}",
    get_current=":SOUR{channel}:CURR?",
    switch_on=":OUTP CH{channel},ON",
    switch_off=":OUTP CH{channel},OFF",
    is_on=":OUTP? CH{channel}",
    measure_voltage=":MEAS:VOLT? CH{channel}",
    measure_current=":MEAS:CURR? CH{channel}",
    mode=":OUTP:MODE? CH{channel}",
    over_voltage=Protection(
        set_level=":OUTP:OVP:VAL CH{channel},{value}",
        get_level=":OUTP:OVP:VAL? CH{channel}",
        tripped=":OUTP:OVP:QUES? CH{channel}",
        arm=":OUTP:OVP CH{channel},ON",
        armed=":OUTP:OVP? CH{channel}",
    ),
    over_current=Protection(
        set_level=":OUTP:OCP:VAL CH{channel},{value}",
        get_level=":OUTP:OCP:VAL? CH{channel}",
        tripped=":OUTP:OCP:QUES? CH{channel}",
        arm=":OUTP:OCP CH{channel},ON",
        armed=":OUTP:OCP? CH{channel}",
    ),
    as_state=_as_state,
    as_trip=_as_trip,
    as_mode=_as_mode,
    says_off=b"OFF",
    pause_s=0.015,  # about 10 ms between commands, and half of it again
)
"""The commands of the DP800 series; settings are rounded to 10 mV at the coarsest."""


class RigolDp832:
    """Driver `rigol-dp832`: role `supply` on channels 1 to 3.

    A wire may set `over_voltage` (volts) and `over_current` (amperes): the levels of the protections, which are then
    switched on.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"supply"})
    capabilities: ClassVar[frozenset[str]] = frozenset({OVER_VOLTAGE_LEVEL})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a rigol-dp832 is reached by a port", "give it `port:`")
        self._connection = connection
        self._session = ClosedSession(
            connection.device, PacedPort(connection.port, connection.clock, DP800.pause_s), error_query=":SYST:ERR?"
        )

    def identify(self) -> Identity:
        """Ask `*IDN?`."""
        manufacturer, model, serial, firmware = self._session.identification()
        return Identity(manufacturer=manufacturer, model=model, serial=serial, firmware=firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Ask every channel whether it is on."""
        return tuple(
            Outlet(channel, self._session.query(DP800.is_on.format(channel=channel), _as_state))
            for channel in DP800.channels
        )

    def role(self, wire: Wire) -> Supply:
        """Return the output that the wire names."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: a rigol-dp832 is no {wire.role}", "it fills the role supply")
        if wire.channel not in DP800.channels:
            raise Refused(f"wiring {wire.name}: a rigol-dp832 has no channel {wire.channel}", "it has 1 to 3")
        settings.only(wire, "over_current", "over_voltage")
        return ScpiOutput(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            dialect=DP800,
            clamps=self._connection.clamps,
            channel=wire.channel,
            over_voltage=settings.quantity(wire, "over_voltage", "V"),
            over_current=settings.quantity(wire, "over_current", "A"),
        )
