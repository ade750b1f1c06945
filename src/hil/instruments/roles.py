"""Roles: the interfaces that cases use, whichever instrument fills them."""

from __future__ import annotations

from typing import Annotated, Protocol, runtime_checkable

from hil.instruments.cycler_role import Cycler
from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.sampled import Sampled, Streamed
from hil.model.bench import Proof
from hil.model.figure import Figure
from hil.model.safing import SafeBytes

__all__ = [
    "ACCELEROMETER",
    "CYCLER",
    "GYROSCOPE",
    "MAGNETOMETER",
    "OBC",
    "RELAYS",
    "ROTATION_TABLE",
    "SUPPLY",
    "THERMAL",
    "Accelerometer",
    "Beaten",
    "Gyroscope",
    "Magnetometer",
    "Obc",
    "Relays",
    "RotationTable",
    "SafeByBytes",
    "Supply",
    "Switched",
    "Thermal",
    "Watched",
]


class Switched(Protocol):
    """An instrument's output or input that can be switched on and off."""

    @drives
    def enable(self) -> None:
        """Switch on; the state is read back."""
        ...

    @drives
    def disable(self) -> None:
        """Switch off; the state is read back."""
        ...

    @reads
    def enabled(self) -> bool:
        """Return whether the instrument reports it as on."""
        ...


class Supply(Switched, Protocol):
    """One output of a power supply, in V and A."""

    @drives
    def configure(self, voltage: Annotated[float, "V"], current: Annotated[float, "A"]) -> None:
        """Set the voltage [V] and the current limit [A]; both are read back."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the measured voltage in V; NaN where the instrument has no reading."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the measured current in A; NaN where the instrument has no reading."""
        ...

    @reads
    def mode(self) -> str:
        """Return `CV`, `CC`, `off` or `unregulated`."""
        ...


class Relays(Protocol):
    """A set of named relay contacts."""

    @drives
    def close(self, contact: str) -> None:
        """Energise one contact; the state is read back."""
        ...

    @drives
    def open(self, contact: str) -> None:
        """Release one contact; the state is read back."""
        ...

    @drives
    def release_all(self) -> None:
        """Release every contact of the board; the states are read back."""
        ...

    @reads
    def closed(self) -> tuple[str, ...]:
        """Return the names of the energised contacts, sorted."""
        ...


class Magnetometer(Sampled, Protocol):
    """A three-axis magnetometer: channels x, y, z in uT and temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the wiring's range and rate, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the sensor into power-down."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the temperature of the sensor's next sample in degC."""
        ...

    @reads
    def bandwidth(self) -> Annotated[Figure, "Hz"]:
        """Return the noise bandwidth of the samples in Hz; half the sampling rate where there is no filter."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "uT"]:
        """Return the resolution of the selected range in uT."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "uT"]:
        """Return the full scale of the selected range in uT."""
        ...


class Thermal(Protocol):
    """A temperature controller, in degC."""

    @drives
    def hold(self, temperature: Annotated[float, "degC"]) -> None:
        """Regulate to a setpoint [degC]; the setpoint is read back."""
        ...

    @drives
    def standby(self) -> None:
        """Stop regulating, with no power into the thermoelectric cooler; the state is read back."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the process value in degC; NaN where the controller reports a sensor break."""
        ...

    @reads
    def setpoint(self) -> Annotated[Figure, "degC"]:
        """Return the working setpoint in degC."""
        ...

    @reads
    def output(self) -> Annotated[Figure, "%"]:
        """Return the working output power in %, negative while cooling."""
        ...


class RotationTable(Protocol):
    """A rotation table, in deg and deg/s, positive counter-clockwise seen from above."""

    @drives
    def set_rate(self, rate: Annotated[float, "deg/s"]) -> None:
        """Turn at a constant rate [deg/s], and wait until the encoder confirms it."""
        ...

    @drives
    def stop(self) -> None:
        """Stop, and wait until the encoder is at rest."""
        ...

    @reads
    def angle(self) -> Annotated[Figure, "deg"]:
        """Return the encoder's angle in deg, not wrapped at full turns."""
        ...

    @reads
    def rate(self) -> Annotated[Figure, "deg/s"]:
        """Return the rate in deg/s from the encoder's angle over time, never the commanded rate."""
        ...

    @reads
    def at_rest(self) -> bool:
        """Return whether the encoder's angle is constant."""
        ...

    @reads
    def reading(self) -> tuple[Annotated[Figure, "deg"], Annotated[Figure, "s"]]:
        """Return the encoder's angle in deg, and the bench time in s at which it was read."""
        ...

    @reads
    def turns(self) -> Annotated[Figure, "turn"]:
        """Return the number of turns since arm."""
        ...

    @reads
    def longest(self, rate: Annotated[float, "deg/s"]) -> Annotated[Figure, "s"]:
        """Return how long the table may turn at a rate [deg/s] within the limits of its harness, in s."""
        ...


class Obc(Sampled, Protocol):
    """A board that stands in for the on-board computer; its channels are the wired analogue inputs, in LSB."""

    @reads
    def identify(self) -> str:
        """Return protocol version, firmware and build hash."""
        ...

    @reads
    def analog(self, channel: int) -> Annotated[Figure, "V"]:
        """Return the voltage of one analogue input in V."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "LSB"]:
        """Return the full-scale count of the analogue inputs in LSB."""
        ...

    @reads
    def reference(self) -> Annotated[Figure, "V"]:
        """Return the full-scale voltage in V as measured by the board itself; its uncertainty is unknown."""
        ...


class Inertial(Sampled, Protocol):
    """Common interface of gyroscopes and accelerometers: start, temperature and filter bandwidth."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the wiring's range, rate and bandwidth, and wait for its first valid sample."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the sensor's own temperature in degC; NoReply where it is marked invalid."""
        ...

    @reads
    def bandwidth(self) -> Annotated[Figure, "Hz"]:
        """Return the noise bandwidth of the selected filter in Hz."""
        ...


class Gyroscope(Inertial, Streamed, Protocol):
    """A three-axis gyroscope: channels x, y, z in deg/s and temperature in degC."""

    @drives
    def stop(self) -> None:
        """Switch the sensor's gyroscope off."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "deg/s"]:
        """Return the resolution of the selected range in deg/s."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "deg/s"]:
        """Return the full scale of the selected range in deg/s."""
        ...


class Accelerometer(Inertial, Protocol):
    """A three-axis accelerometer: channels x, y, z in m/s2, +9.8 on an upward axis at rest, and temperature in degC."""

    @drives
    def stop(self) -> None:
        """Switch the sensor's accelerometer off."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "m/s2"]:
        """Return the resolution of the selected range in m/s2."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "m/s2"]:
        """Return the full scale of the selected range in m/s2."""
        ...


@runtime_checkable
class SafeByBytes(Protocol):
    """An output that a process without a driver can make safe by sending bytes.

    Every role with states is one if its instrument has a byte stream of its own. A sensor on an I2C bus is not, even if
    the bus is served by an instrument that has one: its power supply is what makes it safe.
    """

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes that bring the output to a state; nothing is sent.

        Args:
            state: one of its role's states.
            proof: the bench file's proof of that state. Where it reads a quantity of this same output that the
                instrument reports as text, the bytes query it too, and check it against the proof's bounds.

        Raises:
            Refused: there is no such state, or bytes alone cannot reach it.
        """
        ...


@runtime_checkable
class Watched(Protocol):
    """An output with a watchdog: its instrument makes it safe when heartbeats stop."""

    @property
    def watchdog_s(self) -> float:
        """Watchdog timeout in s; 0 where there is no watchdog, or the wire does not enable it."""
        ...


@runtime_checkable
class Beaten(Watched, Protocol):
    """A watched output whose heartbeat the executive sends; for the others every read counts as a heartbeat."""

    def beat(self) -> None:
        """Send a heartbeat if anything is on.

        Raises:
            Rejected: the instrument has made the output safe since the last heartbeat.
            DeviceFault: it does not answer, or answers nonsense.
        """
        ...


ACCELEROMETER = Role(
    name="accelerometer", protocol=Accelerometer, quantities={"temperature": "degC"}, states={"asleep": "stop"}
)

CYCLER = Role(
    name="cycler",
    protocol=Cycler,
    quantities={"voltage": "V", "current": "A", "temperature": "degC"},
    states={"stopped": "stop"},
    hazardous=True,
)

GYROSCOPE = Role(name="gyroscope", protocol=Gyroscope, quantities={"temperature": "degC"}, states={"asleep": "stop"})

MAGNETOMETER = Role(
    name="magnetometer", protocol=Magnetometer, quantities={"temperature": "degC"}, states={"asleep": "stop"}
)

OBC = Role(name="obc", protocol=Obc)

RELAYS = Role(name="relays", protocol=Relays, states={"released": "release_all"}, hazardous=True, part="contact")

ROTATION_TABLE = Role(
    name="rotation_table",
    protocol=RotationTable,
    quantities={"angle": "deg", "rate": "deg/s", "turns": "turn"},
    states={"stopped": "stop"},
    hazardous=True,
    clamped=("rate", "turns"),
)

SUPPLY = Role(
    name="supply",
    protocol=Supply,
    quantities={"voltage": "V", "current": "A"},
    states={"off": "disable"},
    hazardous=True,
    clamped=("voltage", "current"),
    proven=True,
)

THERMAL = Role(
    name="thermal",
    protocol=Thermal,
    quantities={"temperature": "degC", "output": "%"},
    states={"standby": "standby"},
    hazardous=True,
    clamped=("temperature",),
)
