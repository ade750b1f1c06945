"""Roles: what a case asks for, whichever instrument fills it."""

from __future__ import annotations

from typing import Protocol

from hil.instruments.marks import drives, reads
from hil.instruments.sampled import Sampled, Streamed
from hil.model.figure import Figure

__all__ = [
    "ROLES",
    "STATES",
    "Cycler",
    "Gyroscope",
    "Magnetometer",
    "Obc",
    "Relays",
    "RotationTable",
    "Supply",
    "Thermal",
]


class Supply(Protocol):
    """One output of a power supply. Volts and amperes."""

    @drives
    def configure(self, voltage: float, current: float) -> None:
        """Set the voltage [V] and the current limit [A]; both are read back."""
        ...

    @drives
    def enable(self) -> None:
        """Switch the output on; it is read back."""
        ...

    @drives
    def disable(self) -> None:
        """Switch the output off; it is read back."""
        ...

    @reads
    def enabled(self) -> bool:
        """Return whether the instrument says that the output is on."""
        ...

    @reads
    def voltage(self) -> Figure:
        """Return the measured voltage in V; NaN where the instrument has no number."""
        ...

    @reads
    def current(self) -> Figure:
        """Return the measured current in A; NaN where the instrument has no number."""
        ...

    @reads
    def mode(self) -> str:
        """Return `CV`, `CC`, `off` or `unregulated`."""
        ...


class Relays(Protocol):
    """A set of named relay contacts."""

    @drives
    def close(self, contact: str) -> None:
        """Energise one contact; it is read back."""
        ...

    @drives
    def open(self, contact: str) -> None:
        """Release one contact; it is read back."""
        ...

    @drives
    def release_all(self) -> None:
        """Release every contact of the board; they are read back."""
        ...

    @reads
    def closed(self) -> tuple[str, ...]:
        """Return the names of the energised contacts, sorted."""
        ...


class Magnetometer(Sampled, Protocol):
    """A three-axis magnetometer: channels x, y, z in uT and temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the range and rate of the wiring, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the sensor into power-down."""
        ...


class Thermal(Protocol):
    """A temperature controller. Degrees Celsius."""

    @drives
    def hold(self, temperature: float) -> None:
        """Regulate to a setpoint [degC]; the setpoint is read back."""
        ...

    @drives
    def standby(self) -> None:
        """Stop regulating: no power into the thermoelectric cooler; it is read back."""
        ...

    @reads
    def temperature(self) -> Figure:
        """Return the process value in degC; NaN where the controller reports a broken sensor."""
        ...

    @reads
    def setpoint(self) -> Figure:
        """Return the working setpoint in degC."""
        ...

    @reads
    def output(self) -> Figure:
        """Return the working output power in %, negative while it cools."""
        ...


class RotationTable(Protocol):
    """A rotation table. Degrees and degrees per second, positive counter-clockwise seen from above."""

    @drives
    def set_rate(self, rate: float) -> None:
        """Turn steadily at a rate [deg/s] and wait until the encoder shows it."""
        ...

    @drives
    def stop(self) -> None:
        """Stop, and wait until the encoder stands still."""
        ...

    @reads
    def angle(self) -> Figure:
        """Return the encoder's angle in deg; full turns are counted."""
        ...

    @reads
    def rate(self) -> Figure:
        """Return the rate in deg/s from the encoder's angle over time, never from the command's echo."""
        ...

    @reads
    def at_rest(self) -> bool:
        """Return whether the encoder's angle does not change."""
        ...

    @reads
    def reading(self) -> tuple[Figure, Figure]:
        """Return the encoder's angle in deg, and the bench's time in s at which it was taken."""
        ...

    @reads
    def turns(self) -> Figure:
        """Return the turns since the bench was armed."""
        ...

    @reads
    def longest(self, rate: float) -> Figure:
        """Return how long the table may turn at a rate [deg/s] before its harness ends, in s."""
        ...


class Obc(Protocol):
    """A board that plays the on-board computer."""

    @reads
    def identify(self) -> str:
        """Return protocol version, firmware and build hash."""
        ...

    @reads
    def analog(self, channel: int) -> Figure:
        """Return the voltage of one analogue input in V."""
        ...


class Gyroscope(Streamed, Protocol):
    """A three-axis gyroscope: channels x, y, z in deg/s and temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the range, rate and bandwidth of the wiring, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Switch the sensor's gyroscope off."""
        ...

    @reads
    def temperature(self) -> Figure:
        """Return the sensor's own temperature in degC; NoReply where it is marked invalid."""
        ...

    @reads
    def bandwidth(self) -> Figure:
        """Return the noise bandwidth of the chosen filter in Hz."""
        ...

    @reads
    def resolution(self) -> Figure:
        """Return the smallest step of the chosen range in deg/s."""
        ...

    @reads
    def full_scale(self) -> Figure:
        """Return the largest rate of the chosen range in deg/s."""
        ...


class Cycler(Streamed, Protocol):
    """A device that runs charge and discharge half-cycles of a battery by itself, and measures while it does.

    Channels: voltage in V, current in A (positive into the battery), energy in W.h since the half-cycle began,
    temperature in degC, phase (1 charge, -1 discharge, 0 neither) and cycle (counted from 1, 0 before the first).
    """

    @drives
    def prepare(  # noqa: PLR0913 - one argument per setting of the device, each by its name there
        self,
        cycles: int,
        rest: float = 0.0,
        *,
        vfull: float | None = None,
        iend: float | None = None,
        vend: float | None = None,
        vmax: float | None = None,
        vmin: float | None = None,
        imax: float | None = None,
        tmax: float | None = None,
        tmin: float | None = None,
        time: float | None = None,
        charge: float | None = None,
    ) -> None:
        """Acknowledge what ended the last test, and set what the next one is to be.

        What is not given has the device's default. A device that cannot honour a setting refuses it, and says what it
        does instead.

        Args:
            cycles: a charge and a discharge each.
            rest: behind each half-cycle but the last [s].
            vfull: voltage from which on a small current ends a charge [V].
            iend: the current that ends a charge [A].
            vend: the voltage that ends a discharge [V].
            vmax: limit of the device's own [V].
            vmin: limit of the device's own [V].
            imax: limit of the device's own, both directions [A].
            tmax: limit of the device's own [degC].
            tmin: limit of the device's own [degC].
            time: limit of a half-cycle [s].
            charge: limit of a half-cycle [A.h].
        """
        ...

    @drives
    def start(self) -> None:
        """Begin the test that was prepared."""
        ...

    @drives
    def stop(self) -> None:
        """Open both relays, whatever runs; it is read back."""
        ...

    @reads
    def state(self) -> str:
        """Return `idle`, `charge`, `rest`, `discharge`, `ended`, `stopped`, or `tripped` and the reason."""
        ...

    @reads
    def level(self) -> str:
        """Return the level of the device's protocol: `1` or `2.0`."""
        ...

    @reads
    def voltage(self) -> Figure:
        """Return the newest voltage of the battery in V; NoReply where there is none that is new."""
        ...

    @reads
    def current(self) -> Figure:
        """Return the newest current into the battery in A; NoReply where there is none that is new."""
        ...

    @reads
    def temperature(self) -> Figure:
        """Return the newest temperature of the battery in degC; NoReply where there is none that is new."""
        ...

    @reads
    def time_uncertainty(self) -> Figure:
        """Return how well the times of the rows are known against the bench's clock at their beginning, in s."""
        ...


ROLES: dict[str, type] = {
    "cycler": Cycler,
    "gyroscope": Gyroscope,
    "magnetometer": Magnetometer,
    "obc": Obc,
    "relays": Relays,
    "rotation_table": RotationTable,
    "supply": Supply,
    "thermal": Thermal,
}
"""Every role by the name that bench files and cases use."""

STATES: dict[str, dict[str, str]] = {
    "cycler": {"stopped": "stop"},
    "gyroscope": {"asleep": "stop"},
    "magnetometer": {"asleep": "stop"},
    "relays": {"released": "release_all"},
    "rotation_table": {"stopped": "stop"},
    "supply": {"off": "disable"},
    "thermal": {"standby": "standby"},
}
"""Per role the states that safe-off and rest may name, and the operation that leads there."""
