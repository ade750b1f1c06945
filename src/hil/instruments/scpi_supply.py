"""Role `supply` over SCPI, by a dialect: the table of one family's commands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.driver import OVER_VOLTAGE_LEVEL, TERMINATED, Clamps, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.roles import SUPPLY
from hil.instruments.scpi_dialect import Dialect, Levels, Protection
from hil.instruments.scpi_instrument import ScpiInstrument, ScpiTerminals
from hil.instruments.scpi_session import ScpiSession
from hil.model.bench import Proof, Wire
from hil.model.errors import Refused, Rejected
from hil.model.figure import Figure
from hil.model.safing import SafeBytes

__all__ = ["ScpiOutput", "ScpiSupply"]


class ScpiOutput(ScpiTerminals):
    """One output of a power supply; fills the role `supply`.

    Switching on checks the present settings, possibly made at the front panel or
    by an earlier run, against the clamps too. A tripped over-voltage protection stays
    tripped: clearing it is a person's decision at the instrument.

    Args:
        name, device, session, clamps, channel: see `ScpiTerminals`.
        dialect: its commands.
        levels: protection levels; one that is None or empty is left unchanged.
    """

    fills: ClassVar[Role] = SUPPLY

    def __init__(
        self,
        *,
        name: str,
        device: str,
        session: ScpiSession,
        dialect: Dialect,
        clamps: Clamps,
        channel: int,
        levels: Levels,
    ) -> None:
        super().__init__(name=name, device=device, session=session, speech=dialect, clamps=clamps, channel=channel)
        self._dialect = dialect
        self._over_voltage = levels.over_voltage
        pairs = (
            ("over_voltage", dialect.over_voltage, levels.over_voltage),
            ("over_current", dialect.over_current, levels.over_current),
        )
        self._levels = tuple((quantity, protection, level) for quantity, protection, level in pairs if protection)

    @drives
    def configure(self, voltage: float, current: float) -> None:
        """Set the protections, the current limit [A] and the voltage [V], in this order.

        Raises:
            Refused: beyond the model's rating; nothing was sent.
            ClampExceeded: a value exceeds a clamp; nothing was sent.
            Rejected: the instrument refused a setting, or reads back differently.
        """
        voltage, current = self._sendable("voltage", voltage), self._sendable("current", current)
        self._must_be_rated(voltage, current)
        if self._over_voltage is not None and voltage > self._over_voltage:
            raise Refused(
                f"{self._name}: {voltage:g} V is above its over-voltage protection of {self._over_voltage:g} V",
                "lower the voltage, or change `over_voltage` in the wiring after a review",
            )
        self._clamps.permit(self._channel, "voltage", voltage)
        self._clamps.permit(self._channel, "current", current)
        self._protect()
        self._set("current", self._dialect.set_current, self._dialect.get_current, current)
        self._set("voltage", self._dialect.set_voltage, self._dialect.get_voltage, voltage)

    @drives
    def enable(self) -> None:
        """Switch the output on, if the clamps permit its settings and no protection has tripped."""
        self._must_not_have_tripped()
        self._clamps.permit(self._channel, "voltage", self._number("voltage", self._dialect.get_voltage))
        self._clamps.permit(self._channel, "current", self._number("current", self._dialect.get_current))
        self._protect()
        if not self._switch_on():
            self._must_not_have_tripped()
            raise Rejected(self._device, f"{self._name} was switched on and is off", "check the instrument's display")

    @reads
    def voltage(self) -> Figure:
        """Return the measured voltage in V; its uncertainty comes from the certificate, not from the driver."""
        return Figure(value=self._number("voltage", self._dialect.measure_voltage), unit="V")

    @reads
    def current(self) -> Figure:
        """Return the measured current in A; its uncertainty comes from the certificate, not from the driver."""
        return Figure(value=self._number("current", self._dialect.measure_current), unit="A")

    @reads
    def mode(self) -> str:
        """Return `CV`, `CC`, `off` or `unregulated`."""
        if not self.enabled():
            return "off"
        dialect = self._dialect
        return self._session.query(self._filled(dialect.mode), lambda reply: dialect.as_mode(reply, self._channel))

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes of off; see `hil.instruments.roles.SafeByBytes`. Voltage and current can be queried."""
        questions = {"voltage": self._dialect.measure_voltage, "current": self._dialect.measure_current}
        return self._safe_bytes(state, proof, questions)

    def _must_be_rated(self, voltage: float, current: float) -> None:
        """Refuse a channel that the identified model lacks, or a setting beyond its rating."""
        model = self._session.model
        ratings = self._dialect.ratings.get(model)
        if ratings is None:
            return
        if self._channel > len(ratings):
            raise Refused(f"{self._name}: {model} has no channel {self._channel}", f"it has 1 to {len(ratings)}")
        volts, amperes = ratings[self._channel - 1]
        if voltage > volts or current > amperes:
            raise Refused(
                f"{self._name}: {voltage:g} V and {current:g} A are more than channel {self._channel} of {model} gives",
                f"it can be set to {volts:g} V and {amperes:g} A",
            )

    def _must_not_have_tripped(self) -> None:
        for quantity, protection, _ in self._levels:
            if self._session.query(self._filled(protection.tripped), self._dialect.as_trip):
                what = quantity.replace("_", "-")
                raise Rejected(
                    self._device,
                    f"the {what} protection of {self._name} has tripped",
                    f"find out what raised the {what[5:]}, then clear the protection at the instrument",
                )

    def _protect(self) -> None:
        for quantity, protection, level in self._levels:
            if isinstance(level, float):
                self._set(quantity, protection.set_level, protection.get_level, self._sendable(quantity, level))
            if level not in {None, ""}:
                self._arm(quantity, protection)

    def _arm(self, quantity: str, protection: Protection) -> None:
        if not protection.arm:
            return
        self._session.setting(self._filled(protection.arm))
        if not self._session.query(self._filled(protection.armed), self._dialect.as_armed):
            raise Rejected(
                self._device,
                f"{self._name}: the {quantity.replace('_', '-')} protection was switched on and is off",
                "check the instrument's display and its programming guide",
            )


class ScpiSupply(ScpiInstrument):
    """Base driver for power supplies of one dialect: role `supply` on each channel.

    A wire may set `over_voltage` (V), the level of the over-voltage protection, and `over_current` (A) where the
    dialect has one; protections with a switch are then switched on.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"supply"})
    capabilities: ClassVar[frozenset[str]] = frozenset({OVER_VOLTAGE_LEVEL, TERMINATED})
    dialect: ClassVar[Dialect]

    def __init_subclass__(cls) -> None:
        """Adopt the dialect's SCPI conventions."""
        cls.speech = cls.dialect

    def outlets(self) -> Sequence[Outlet]:
        """Query whether each of the model's channels is on."""
        dialect, session = self.dialect, self._session
        if dialect.differs and not session.model:
            session.identification()
        return tuple(Outlet(channel, self._on(channel)) for channel in dialect.channels_of(session.model))

    def role(self, wire: Wire) -> ScpiOutput:
        """Return the output on the wire's channel."""
        dialect = self.dialect
        settings.fits(wire, dialect.driver, self.roles, dialect.channels)
        return ScpiOutput(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            dialect=dialect,
            clamps=self._connection.clamps,
            channel=wire.channel,
            levels=settings.read(wire, dialect.levels),
        )

    def _on(self, channel: int) -> bool:
        dialect = self.dialect
        question = dialect.is_on.format(channel=channel)
        return self._session.query(question, lambda reply: dialect.as_state(reply, channel))
