"""Driver of the Newport ESP301 motion controller with a rotation stage.

Commands: ESP301 Integrated 3-Axis Motion Controller/Driver, User's Manual (EDH0235En1030), as far as public drivers and
excerpts show them; the list of what is assumed is in docs/reference/bench-file.md. The controller is never reset, and
no axis is homed: angles count from where the controller was switched on.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.driver import Connection, Outlet
from hil.instruments.newport_esp301.encoder import Encoder
from hil.instruments.newport_esp301.session import EspSession, as_flag, as_words
from hil.instruments.newport_esp301.table import Motion, Table
from hil.instruments.roles import RotationTable
from hil.model.bench import Wire
from hil.model.errors import Refused
from hil.model.identity import Identity

__all__ = ["NewportEsp301"]

_AXES = (1, 2, 3)
_STAGE_AXIS = 1
_VERSION = re.compile(r"(ESP\d+)\s+Version\s+(.+)", re.ASCII)
_ACCELERATION, _TOLERANCE, _ACCURACY = 20.0, 0.1, 0.0


class NewportEsp301:
    """Driver `newport-esp301`: role `rotation_table` on axes 1 to 3.

    A wire may set `acceleration` (deg/s2), `tolerance` (deg/s) of the rate, and `accuracy` (deg) of the encoder.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"rotation_table"})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a newport-esp301 is reached by a port", "give it `port:`")
        self._connection = connection
        self._session = EspSession(connection.device, connection.port, connection.clock)

    def identify(self) -> Identity:
        """Ask the controller for its version, and the first axis for its stage, whose serial number counts."""
        model, firmware = self._session.query("VE?", _as_version)
        _, serial = self._session.query(f"{_STAGE_AXIS}ID?", _as_stage)
        return Identity(model=model, serial=serial, firmware=firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Ask every axis whether its motor is on or it moves."""
        return tuple(Outlet(axis, self._on(axis)) for axis in _AXES)

    def role(self, wire: Wire) -> RotationTable:
        """Return the table on the axis that the wire names."""
        if wire.role not in self.roles:
            raise Refused(f"wiring {wire.name}: a newport-esp301 is no {wire.role}", "it fills the role rotation_table")
        if wire.channel not in _AXES:
            raise Refused(f"wiring {wire.name}: a newport-esp301 has no axis {wire.channel}", "give `channel:` 1 to 3")
        settings.only(wire, "acceleration", "tolerance", "accuracy")
        motion = Motion(
            _above_zero(wire, "acceleration", "deg/s2", _ACCELERATION),
            _above_zero(wire, "tolerance", "deg/s", _TOLERANCE),
        )
        accuracy = settings.quantity(wire, "accuracy", "deg") or _ACCURACY
        connection = self._connection
        return Table(
            name=wire.name,
            device=connection.device,
            session=self._session,
            clock=connection.clock,
            clamps=connection.clamps,
            axis=wire.channel,
            encoder=Encoder(self._session, connection.clock, wire.channel, abs(accuracy)),
            motion=motion,
        )

    def _on(self, axis: int) -> bool:
        powered = self._session.query(f"{axis}MO?", as_flag)
        return powered or not self._session.query(f"{axis}MD?", as_flag)


def _above_zero(wire: Wire, key: str, unit: str, default: float) -> float:
    value = settings.quantity(wire, key, unit)
    if value is None:
        return default
    if value <= 0:
        raise Refused(f"wiring {wire.name}: {key} {value:g} {unit} is not above 0", "give a number above 0")
    return value


def _as_version(reply: str) -> tuple[str, str]:
    match = _VERSION.fullmatch(as_words(reply))
    if match is None:
        raise ValueError("a version like 'ESP301 Version 3.0.1 6/1/99'")
    return match[1], match[2].strip()


def _as_stage(reply: str) -> tuple[str, str]:
    model, separator, serial = as_words(reply).partition(",")
    if not separator or not model.strip() or not serial.strip():
        raise ValueError("a stage's model and serial number")
    return model.strip(), serial.strip()
