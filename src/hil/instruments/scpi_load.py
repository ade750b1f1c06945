"""Role `electronic_load` over SCPI, by a dialect: the table of one family's commands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.driver import Clamps, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.power_roles import ELECTRONIC_LOAD
from hil.instruments.role import Role
from hil.instruments.scpi_instrument import ScpiInstrument, ScpiTerminals, SwitchedSpeech
from hil.instruments.scpi_session import ScpiSession
from hil.model.bench import Proof, Wire
from hil.model.errors import Refused, Rejected
from hil.model.figure import Figure
from hil.model.safing import SafeBytes

__all__ = ["LoadDialect", "LoadMode", "ScpiLoad", "ScpiLoadInput"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadMode:
    """One mode of a load; `{value}` is filled in.

    Attributes:
        quantity: what it keeps constant.
        choose: selects the mode.
        set_level: sets its level.
        get_level: queries the level.
        set_range: selects the range; empty where there is none.
        ranges: upper ends of the ranges, ascending.
    """

    quantity: str
    choose: str
    set_level: str
    get_level: str
    set_range: str = ""
    ranges: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadDialect(SwitchedSpeech):
    """Commands of one family of loads.

    Attributes:
        modes: modes by name: `CC`, `CR`, `CP`, `CV`.
        which: queries the mode.
        said: the possible replies to that, in capitals, and the mode that each means.
        measure: the query of each quantity.
    """

    modes: Mapping[str, LoadMode]
    which: str
    said: Mapping[str, str]
    measure: Mapping[str, str]


class ScpiLoadInput(ScpiTerminals):
    """The input of an electronic load; fills the role `electronic_load`.

    A mode is selected after its level is set, so that an input that is on never jumps to an old level. Switching on
    checks the present settings, possibly made at the front panel, against the clamps too.

    Args:
        name, device, session, clamps, channel: see `ScpiTerminals`.
        dialect: its commands.
    """

    fills: ClassVar[Role] = ELECTRONIC_LOAD

    def __init__(
        self, *, name: str, device: str, session: ScpiSession, dialect: LoadDialect, clamps: Clamps, channel: int
    ) -> None:
        super().__init__(name=name, device=device, session=session, speech=dialect, clamps=clamps, channel=channel)
        self._dialect = dialect

    @drives
    def constant_current(self, current: float) -> None:
        """Sink a constant current [A].

        Raises:
            Refused: the bench file has no clamp on the current; nothing was sent.
            ClampExceeded: the level exceeds the clamp; nothing was sent.
            Rejected: the instrument refused it, or reads back differently.
        """
        self._select("CC", current)

    @drives
    def constant_resistance(self, resistance: float) -> None:
        """Act as a constant resistance [ohm]; see `constant_current`."""
        self._select("CR", resistance)

    @drives
    def constant_power(self, power: float) -> None:
        """Sink a constant power [W]; see `constant_current`."""
        self._select("CP", power)

    @drives
    def constant_voltage(self, voltage: float) -> None:
        """Hold the voltage down at this level [V]; see `constant_current`."""
        self._select("CV", voltage)

    @drives
    def enable(self) -> None:
        """Switch the input on, if the clamps permit its settings."""
        mode = self._mode(self.mode())
        self._clamps.permit(self._channel, mode.quantity, self._number(mode.quantity, mode.get_level))
        if not self._switch_on():
            raise Rejected(self._device, f"{self._name} was switched on and is off", "check the instrument's display")

    @reads
    def mode(self) -> str:
        """Return `CC`, `CR`, `CP` or `CV`."""
        return self._session.query(self._filled(self._dialect.which), self._as_mode)

    @reads
    def voltage(self) -> Figure:
        """Return the measured voltage in V."""
        return self._measured("voltage")

    @reads
    def current(self) -> Figure:
        """Return the measured current in A."""
        return self._measured("current")

    @reads
    def power(self) -> Figure:
        """Return the measured power in W."""
        return self._measured("power")

    @reads
    def resistance(self) -> Figure:
        """Return measured voltage over measured current in ohm."""
        return self._measured("resistance")

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes that switch off; see `hil.instruments.roles.SafeByBytes`. Every quantity can be queried."""
        return self._safe_bytes(state, proof, dict(self._dialect.measure))

    def _select(self, name: str, level: float) -> None:
        mode = self._mode(name)
        level = self._sendable(mode.quantity, level)
        self._clamps.permit(self._channel, mode.quantity, level)
        if mode.set_range:
            self._session.setting(self._filled(mode.set_range, value=f"{self._range(mode, level):g}"))
        self._set(mode.quantity, mode.set_level, mode.get_level, level)
        self._session.setting(self._filled(mode.choose))
        if (found := self.mode()) != name:
            raise Rejected(
                self._device,
                f"{self._name} was set to {name} and is in {found}",
                "check the instrument's display: a sequence or a test may be running",
            )

    def _mode(self, name: str) -> LoadMode:
        """Return a mode whose quantity the bench file clamps."""
        mode = self._dialect.modes[name]
        if not math.isfinite(self._clamps.bounds(self._channel, mode.quantity)[1]):
            raise Refused(
                f"{self._name}: {name} needs a clamp on its {mode.quantity}",
                f"add one to `clamps` in the bench file: {{output: {self._name}, quantity: {mode.quantity}, ...}}",
            )
        return mode

    def _range(self, mode: LoadMode, level: float) -> float:
        """Return the upper end of the smallest range that covers the level and the whole clamp."""
        highest = max(level, self._clamps.bounds(self._channel, mode.quantity)[1])
        return next((end for end in mode.ranges if end >= highest), mode.ranges[-1])

    def _measured(self, quantity: str) -> Figure:
        number = self._number(quantity, self._dialect.measure[quantity])
        return Figure(value=number, unit=self.fills.quantities[quantity])

    def _as_mode(self, reply: str) -> str:
        found = self._dialect.said.get(reply.upper())
        if found is None:
            raise ValueError(" or ".join(self._dialect.said))
        return found


class ScpiLoad(ScpiInstrument):
    """Base driver for single-input electronic loads of one dialect: role `electronic_load`."""

    roles: ClassVar[frozenset[str]] = frozenset({"electronic_load"})
    dialect: ClassVar[LoadDialect]

    def __init_subclass__(cls) -> None:
        """Adopt the dialect's SCPI conventions."""
        cls.speech = cls.dialect

    def outlets(self) -> Sequence[Outlet]:
        """Query whether the input is on."""
        on = self._session.query(self.dialect.is_on, lambda reply: self.dialect.as_state(reply, 0))
        return (Outlet(0, on),)

    def role(self, wire: Wire) -> ScpiLoadInput:
        """Return the input."""
        settings.fits(wire, self.dialect.driver, self.roles)
        settings.read(wire, settings.NoSettings)
        return ScpiLoadInput(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            dialect=self.dialect,
            clamps=self._connection.clamps,
            channel=wire.channel,
        )
