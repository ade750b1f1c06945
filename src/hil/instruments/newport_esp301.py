"""Newport ESP301 motion controller with a rotation stage.

Commands: ESP301 Integrated 3-Axis Motion Controller/Driver, User's Manual (EDH0235En1030), as far as public drivers and
excerpts show them; the list of what is assumed is in docs/reference/bench-file.md. The controller is never reset, and
no axis is homed: angles count from where the controller was switched on.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from hil.clock.port import Clock
from hil.instruments import settings
from hil.instruments.driver import Clamps, Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.newport_esp301_encoder import Encoder, Reading, stopped
from hil.instruments.newport_esp301_session import EspRefused, EspSession, as_code, as_decimal, as_flag, as_words
from hil.instruments.roles import ROTATION_TABLE, RotationTable
from hil.instruments.safing import must_be_state, own_bounds
from hil.model.bench import Proof, Wire
from hil.model.errors import ClampExceeded, DeviceFault, Refused, Rejected
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.notation import measured
from hil.model.safing import SafeBytes

__all__ = ["Motion", "NewportEsp301", "Table", "TableSettings"]

_AXES = (1, 2, 3)
_STAGE_AXIS = 1
_VERSION = re.compile(r"(ESP\d+[-\w]*)\s+Version\s+(.+)", re.ASCII | re.IGNORECASE)
_NO_SUCH_AXIS, _NOT_CONNECTED = 9, 8  # the latter is preceded by the axis number
_TURN = 360.0
_DEGREE = 7
_DECIMALS = 4
_LONGEST_RAMP_S = 5.0
_SETTLED_WITHIN_S = 1.5
_LEAST_AT_RATE_S = 1.0
"""Shortest time at rate: a movement too short to be proven and stopped is not started."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableSettings:
    """Wire settings.

    Attributes:
        acceleration: acceleration of the table [deg/s2].
        tolerance: tolerance on its rate [deg/s].
        accuracy: accuracy of its encoder [deg].
    """

    acceleration: Annotated[float, measured("deg/s2", above=0)] = 20.0
    tolerance: Annotated[float, measured("deg/s", above=0)] = 0.1
    accuracy: Annotated[float, measured("deg")] = 0.0


class NewportEsp301:
    """Driver `newport-esp301`: role `rotation_table` on axes 1 to 3.

    A wire may set `acceleration` (deg/s2), `tolerance` (deg/s) of the rate, and `accuracy` (deg) of the encoder.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"rotation_table"})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a newport-esp301 is reached by a port", "give it `port:`")
        self._connection = connection
        self._wired: set[int] = set()
        self._session = EspSession(connection.device, connection.port, connection.clock, timeout=connection.timeout)

    def identify(self) -> Identity:
        """Query the controller's version and the first axis's stage, whose serial number identifies the table.

        A stage without identification data reports nothing, or `Unknown`; then there is no serial number.
        """
        model, firmware = self._session.query("VE?", _as_version)
        try:
            serial = self._session.query(f"{_STAGE_AXIS}ID?", _as_serial)
        except EspRefused as refused:
            if refused.codes != (100 * _STAGE_AXIS + _NOT_CONNECTED,):
                raise
            serial = ""
        return Identity(model=model, serial=serial, firmware=firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Query, for every axis of the controller, whether its motor is on or it is moving."""
        return tuple(Outlet(axis, on) for axis in _AXES if (on := self._on(axis)) is not None)

    def role(self, wire: Wire) -> RotationTable:
        """Return the table on the axis that the wire names."""
        settings.fits(wire, "newport-esp301", self.roles, _AXES)
        own = settings.read(wire, TableSettings)
        connection = self._connection
        self._wired.add(wire.channel)
        return Table(
            name=wire.name,
            device=connection.device,
            session=self._session,
            clock=connection.clock,
            clamps=connection.clamps,
            axis=wire.channel,
            encoder=Encoder(self._session, connection.clock, wire.channel, abs(own.accuracy)),
            motion=Motion(own.acceleration, own.tolerance),
        )

    def _on(self, axis: int) -> bool | None:
        """Return whether an axis is on, None where it does not exist: it is not wired, and was refused twice."""
        for _ in range(2):
            try:
                powered = self._session.query(f"{axis}MO?", as_flag)
                return powered or not self._session.query(f"{axis}MD?", as_flag)
            except EspRefused as refused:
                if axis in self._wired or refused.codes != (_NO_SUCH_AXIS,):
                    raise
        return None


def _as_version(reply: str) -> tuple[str, str]:
    match = _VERSION.fullmatch(as_words(reply))
    if match is None:
        raise ValueError("a version like 'ESP301 Version 3.0.1 6/1/99'")
    return match[1], match[2].strip()


def _as_serial(reply: str) -> str:
    model, separator, serial = (as_words(reply) if reply else "Unknown").partition(",")
    if model.strip().lower() == "unknown" and not separator:
        return ""
    if not separator or not model.strip() or not serial.strip():
        raise ValueError("a stage's model and serial number, or Unknown")
    return serial.strip()


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion parameters: acceleration [deg/s2] and rate tolerance [deg/s]."""

    acceleration: float
    tolerance: float


class Table:
    """One rotation table; fills the role `rotation_table`.

    Rates are measured by the encoder. Motor power is on only from a permitted rate until the proven stop. The clamp
    `turns` limits the travel from the position at arm: a movement that would exceed it is refused, and one about to
    exceed it is stopped by the next read of the encoder, the envelope's monitors included.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: the controller's session.
        clock: the bench's clock.
        clamps: the clamps on the table.
        axis: axis number.
        encoder: the axis's encoder.
        motion: motion parameters.
    """

    def __init__(
        self,
        *,
        name: str,
        device: str,
        session: EspSession,
        clock: Clock,
        clamps: Clamps,
        axis: int,
        encoder: Encoder,
        motion: Motion,
    ) -> None:
        self._name = name
        self._device = device
        self._session = session
        self._clock = clock
        self._clamps = clamps
        self._axis = axis
        self._encoder = encoder
        self._motion = motion
        self._armed_at: float | None = None
        self._fastest: float | None = None
        self._commanded = 0.0

    @drives
    def set_rate(self, rate: float) -> None:
        """Turn at a constant rate [deg/s], and wait until the encoder confirms it; 0 stops.

        A turning table is stopped first.

        Raises:
            ClampExceeded: the rate, or the turns that it would take, exceed a clamp; nothing was set.
            Refused: the stage or the acceleration does not allow it.
            Rejected: the controller refused, or the encoder does not confirm the rate; the table was stopped.
        """
        if not math.isfinite(rate):
            raise Refused(f"{self._name}: {rate} is not a rate", "give a finite number")
        rate = round(rate, _DECIMALS)
        self._clamps.permit(self._axis, "rate", rate)
        if not rate:
            self.stop()
            return
        self._must_be_possible(rate)
        if self._commanded or not self._encoder.at_rest():
            self.stop()
        self._must_have_room(rate)
        self._start(rate)
        self._wait_for(rate)

    @drives
    def stop(self) -> None:
        """Stop, wait until the encoder is at rest, and switch the motor off; the bytes leave at once.

        Raises:
            Rejected: the table keeps turning, its motor stays on, or the error buffer was not empty.
        """
        slowing = abs(self._commanded) / self._motion.acceleration
        queued = self._session.urgent(f"{self._axis}ST")
        stands = self._comes_to_rest(slowing)
        self._session.setting(f"{self._axis}MF")
        if not stands:
            cut = "its motor power was cut" + ("" if self._comes_to_rest(slowing) else ", and it still turns")
            raise Rejected(
                self._device, f"{self._name} was stopped and went on; {cut}", "cut its mains, then check the drive"
            )
        self._commanded = 0.0
        if self._session.query(f"{self._axis}MO?", as_flag):
            raise Rejected(self._device, f"the motor of {self._name} stays on", "cut its mains, then check it")
        if queued:
            raise Rejected(
                self._device,
                f"{self._name} stands still, but the error buffer held {'; '.join(queued)}",
                "check the stage, its load and its harness",
            )

    @reads
    def angle(self) -> Figure:
        """Return the encoder's angle in deg, not wrapped at full turns."""
        return self._encoder.angle(self._read_encoder())

    @reads
    def reading(self) -> tuple[Figure, Figure]:
        """Return the encoder's angle in deg, and the bench time in s at which it was read."""
        seen = self._read_encoder()
        return self._encoder.angle(seen), self._encoder.instant(seen)

    @reads
    def turns(self) -> Figure:
        """Return the number of turns since arm."""
        seen = self._read_encoder()
        uncertainty = (self._encoder.angle(seen).uncertainty or 0.0) / _TURN
        return Figure(value=self._turns(seen), unit="turn", uncertainty=uncertainty)

    @reads
    def rate(self) -> Figure:
        """Return the rate in deg/s from the encoder's angle over time, never the commanded rate."""
        self._read_encoder()
        return self._encoder.rate()

    @reads
    def at_rest(self) -> bool:
        """Return whether the encoder's angle is constant."""
        return self._encoder.at_rest()

    @reads
    def longest(self, rate: float) -> Figure:
        """Return how long the table may turn at a rate from its present position [s], less ramps; 0 if not at all."""
        bounds = self._clamps.bounds(self._axis, "turns")
        if not rate:
            return Figure(value=math.inf, unit="s")
        end = bounds[1] if rate > 0 else bounds[0]
        left = abs(end - self._turns(self._read_encoder())) * _TURN - 2 * self._ramp(rate)
        return Figure(value=max(0.0, left / abs(rate)), unit="s")

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes that stop and switch the motor off; see `hil.instruments.roles.SafeByBytes`.

        The encoder always proves standstill; a rate is also queried from the controller, which may report its command.
        """
        must_be_state(ROTATION_TABLE, self._name, state)
        return stopped(self._axis, own_bounds(self._name, proof, "rate"), self._session.timeout)

    def _read_encoder(self) -> Reading:
        """Read the encoder; stop a table that is about to exceed its turns."""
        seen = self._encoder.look()
        if self._armed_at is None:
            self._armed_at = seen.angle
        if self._commanded:
            ends = self._turns(seen) + math.copysign(self._ramp(self._commanded), self._commanded) / _TURN
            try:
                self._clamps.permit(self._axis, "turns", ends)
            except ClampExceeded:
                self.stop()
                raise
        return seen

    def _turns(self, seen: Reading) -> float:
        armed_at = seen.angle if self._armed_at is None else self._armed_at
        return (seen.angle - armed_at) / _TURN

    def _ramp(self, rate: float) -> float:
        """Return the travel during one ramp [deg]."""
        return rate * rate / (2 * self._motion.acceleration)

    def _must_be_possible(self, rate: float) -> None:
        if self._fastest is None:
            unit = self._session.query(f"{self._axis}SN?", as_code)
            if unit != _DEGREE:
                raise Rejected(
                    self._device,
                    f"axis {self._axis} counts in unit {unit}, and degrees are unit {_DEGREE}",
                    "look which stage is connected, and how the controller was set up",
                )
            self._fastest = self._session.query(f"{self._axis}VU?", as_decimal)
        if abs(rate) > self._fastest:
            raise Refused(f"{self._name}: {rate:g} deg/s is above the stage's {self._fastest:g} deg/s", "turn slower")
        if abs(rate) > _LONGEST_RAMP_S * self._motion.acceleration:
            raise Refused(
                f"{self._name}: at {self._motion.acceleration:g} deg/s2 it takes more than"
                f" {_LONGEST_RAMP_S:g} s to reach {rate:g} deg/s",
                "raise `acceleration` in the wiring, or turn slower",
            )

    def _must_have_room(self, rate: float) -> None:
        """Refuse a movement that would exceed the harness's turns or the controller's limits before it can stop."""
        seen = self._read_encoder()
        way = math.copysign(2 * self._ramp(rate) + abs(rate) * _LEAST_AT_RATE_S, rate)
        self._clamps.permit(self._axis, "turns", self._turns(seen) + way / _TURN)
        low, high = (self._session.query(f"{self._axis}{side}?", as_decimal) for side in ("SL", "SR"))
        if not low <= seen.angle + way <= high:
            raise Refused(
                f"{self._name}: from {seen.angle:g} deg at {rate:g} deg/s it would leave the controller's travel"
                f" limits {low:g} to {high:g} deg",
                "turn the other way, or set the limits at the controller",
            )

    def _start(self, rate: float) -> None:
        self._set("VA", abs(rate))
        self._set("AC", self._motion.acceleration)
        self._set("AG", self._motion.acceleration)
        self._session.setting(f"{self._axis}MO")
        self._commanded = rate
        if not self._session.query(f"{self._axis}MO?", as_flag):
            raise Rejected(self._device, f"the motor of {self._name} does not switch on", "check the interlock")
        self._session.setting(f"{self._axis}MV{'+' if rate > 0 else '-'}")

    def _set(self, mnemonic: str, value: float) -> None:
        self._session.setting(f"{self._axis}{mnemonic}{value:.{_DECIMALS}f}")
        taken = self._session.query(f"{self._axis}{mnemonic}?", as_decimal)
        if abs(taken - value) > 10**-_DECIMALS:
            raise Rejected(
                self._device,
                f"{self._name}: {mnemonic} was set to {value:g} and reads back {taken:g}",
                "check what else sets it, and the stage's ratings",
            )

    def _wait_for(self, rate: float) -> None:
        """Wait for the ramp, then for the rate; a table that does not reach it is stopped and reported."""
        self._clock.sleep(abs(rate) / self._motion.acceleration)
        deadline = self._clock.now() + _SETTLED_WITHIN_S
        while True:
            self._read_encoder()
            shown = self._encoder.rate().value
            if abs(shown - rate) <= self._motion.tolerance:
                return
            if self._clock.now() >= deadline:
                break
        ended = "it was stopped"
        try:
            self.stop()
        except DeviceFault as fault:
            ended = f"and it cannot be stopped: {fault.message}"
        raise Rejected(
            self._device,
            f"{self._name} was set to {rate:g} deg/s and its encoder shows {shown:.4g} deg/s; {ended}",
            "check whether the table slips or is held, and its load",
        )

    def _comes_to_rest(self, slowing: float) -> bool:
        """Wait until the encoder is at rest, for the duration of the ramp and a margin."""
        deadline = self._clock.now() + slowing + _SETTLED_WITHIN_S
        while not self._encoder.at_rest():
            if self._clock.now() >= deadline:
                return False
        return True
