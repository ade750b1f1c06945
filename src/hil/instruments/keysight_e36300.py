"""Keysight E36311A, E36312A and E36313A triple-output power supplies.

Commands: E36300 Series Programming Guide (E36311-90008). The instrument is never reset: `*RST`
would switch outputs off in an order that nobody chose, and forget what a person had set.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.capabilities import OVER_VOLTAGE_LEVEL
from hil.instruments.driver import Connection, Outlet
from hil.instruments.roles import Supply
from hil.instruments.scpi.session import ScpiSession, as_switch
from hil.instruments.scpi.supply import Dialect, Protection, ScpiOutput
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.identity import Identity

__all__ = ["E36300", "KeysightE36300"]

E36300 = Dialect(
    channels=(1, 2, 3),
    decimals=4,
    tolerance=0.002,
    set_voltage="VOLT {value},(@{channel})",
    get_voltage="VOLT? (@{channel})",
    set_current="CURR {value},(@{channel})",
    get_current="CURR? (@{channel})",
    switch_on="OUTP ON,(@{channel})",
    switch_off="OUTP OFF,(@{channel})",
    is_on="OUTP? (@{channel})",
    measure_voltage="MEAS:VOLT? (@{channel})",
    measure_current="MEAS:CURR? (@{channel})",
    mode="STAT:QUES:INST:ISUM{channel}:COND?",
    over_voltage=Protection(
        set_level="VOLT:PROT {value},(@{channel})",
        get_level="VOLT:PROT? (@{channel})",
        tripped="VOLT:PROT:TRIP? (@{channel})",
    ),
    framed=True,
)
"""The commands of the E36300 series."""


class KeysightE36300:
    """Driver `keysight-e36300`: role `supply` on channels 1 to 3.

    A wire may set `over_voltage` (volts): the level of the over-voltage protection.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"supply"})
    capabilities: ClassVar[frozenset[str]] = frozenset({OVER_VOLTAGE_LEVEL})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a keysight-e36300 is reached by a port", "give it `port:`")
        self._connection = connection
        self._session = ScpiSession(connection.device, connection.port, framed=E36300.framed)

    def identify(self) -> Identity:
        """Ask `*IDN?`."""
        manufacturer, model, serial, firmware = self._session.identification()
        return Identity(manufacturer=manufacturer, model=model, serial=serial, firmware=firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Ask every channel whether it is on."""
        return tuple(
            Outlet(channel, self._session.query(E36300.is_on.format(channel=channel), as_switch))
            for channel in E36300.channels
        )

    def role(self, wire: Wire) -> Supply:
        """Return the output that the wire names."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: a keysight-e36300 is no {wire.role}", "it fills the role supply")
        if wire.channel not in E36300.channels:
            raise Refused(f"wiring {wire.name}: a keysight-e36300 has no channel {wire.channel}", "it has 1 to 3")
        settings.only(wire, "over_voltage")
        return ScpiOutput(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            dialect=E36300,
            clamps=self._connection.clamps,
            channel=wire.channel,
            over_voltage=settings.quantity(wire, "over_voltage", "V"),
        )
