"""Roles: what a case asks for, whichever instrument fills it."""

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
    """The output or the input of an instrument, which is on or off."""

    @drives
    def enable(self) -> None:
        """Switch it on; it is read back."""
        ...

    @drives
    def disable(self) -> None:
        """Switch it off; it is read back."""
        ...

    @reads
    def enabled(self) -> bool:
        """Return whether the instrument says that it is on."""
        ...


class Supply(Switched, Protocol):
    """One output of a power supply. Volts and amperes."""

    @drives
    def configure(self, voltage: Annotated[float, "V"], current: Annotated[float, "A"]) -> None:
        """Set the voltage [V] and the current limit [A]; both are read back."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the measured voltage in V; NaN where the instrument has no number."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
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

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the temperature of the sensor's next sample in degC."""
        ...

    @reads
    def bandwidth(self) -> Annotated[Figure, "Hz"]:
        """Return the noise bandwidth of its measurements in Hz; half their rate where nothing filters them."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "uT"]:
        """Return the smallest step of the chosen range in uT."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "uT"]:
        """Return the largest field of the chosen range in uT."""
        ...


class Thermal(Protocol):
    """A temperature controller. Degrees Celsius."""

    @drives
    def hold(self, temperature: Annotated[float, "degC"]) -> None:
        """Regulate to a setpoint [degC]; the setpoint is read back."""
        ...

    @drives
    def standby(self) -> None:
        """Stop regulating: no power into the thermoelectric cooler; it is read back."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the process value in degC; NaN where the controller reports a broken sensor."""
        ...

    @reads
    def setpoint(self) -> Annotated[Figure, "degC"]:
        """Return the working setpoint in degC."""
        ...

    @reads
    def output(self) -> Annotated[Figure, "%"]:
        """Return the working output power in %, negative while it cools."""
        ...


class RotationTable(Protocol):
    """A rotation table. Degrees and degrees per second, positive counter-clockwise seen from above."""

    @drives
    def set_rate(self, rate: Annotated[float, "deg/s"]) -> None:
        """Turn steadily at a rate [deg/s] and wait until the encoder shows it."""
        ...

    @drives
    def stop(self) -> None:
        """Stop, and wait until the encoder stands still."""
        ...

    @reads
    def angle(self) -> Annotated[Figure, "deg"]:
        """Return the encoder's angle in deg; full turns are counted."""
        ...

    @reads
    def rate(self) -> Annotated[Figure, "deg/s"]:
        """Return the rate in deg/s from the encoder's angle over time, never from the command's echo."""
        ...

    @reads
    def at_rest(self) -> bool:
        """Return whether the encoder's angle does not change."""
        ...

    @reads
    def reading(self) -> tuple[Annotated[Figure, "deg"], Annotated[Figure, "s"]]:
        """Return the encoder's angle in deg, and the bench's time in s at which it was taken."""
        ...

    @reads
    def turns(self) -> Annotated[Figure, "turn"]:
        """Return the turns since the bench was armed."""
        ...

    @reads
    def longest(self, rate: Annotated[float, "deg/s"]) -> Annotated[Figure, "s"]:
        """Return how long the table may turn at a rate [deg/s] before its harness ends, in s."""
        ...


class Obc(Sampled, Protocol):
    """A board that plays the on-board computer; its channels are the analogue inputs that the wiring names, in LSB."""

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
        """Return the largest raw number of the analogue inputs in LSB."""
        ...

    @reads
    def reference(self) -> Annotated[Figure, "V"]:
        """Return the voltage at full scale in V as the board measures it by itself; how well is not known."""
        ...


class Inertial(Sampled, Protocol):
    """What gyroscopes and accelerometers share: they are woken as the wiring says, and know temperature and filter."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the range, rate and bandwidth of the wiring, and wait for its first valid sample."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the sensor's own temperature in degC; NoReply where it is marked invalid."""
        ...

    @reads
    def bandwidth(self) -> Annotated[Figure, "Hz"]:
        """Return the noise bandwidth of the chosen filter in Hz."""
        ...


class Gyroscope(Inertial, Streamed, Protocol):
    """A three-axis gyroscope: channels x, y, z in deg/s and temperature in degC."""

    @drives
    def stop(self) -> None:
        """Switch the sensor's gyroscope off."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "deg/s"]:
        """Return the smallest step of the chosen range in deg/s."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "deg/s"]:
        """Return the largest rate of the chosen range in deg/s."""
        ...


class Accelerometer(Inertial, Protocol):
    """A three-axis accelerometer: channels x, y, z in m/s2, 9.8 upwards at rest, and temperature in degC."""

    @drives
    def stop(self) -> None:
        """Switch the sensor's accelerometer off."""
        ...

    @reads
    def resolution(self) -> Annotated[Figure, "m/s2"]:
        """Return the smallest step of the chosen range in m/s2."""
        ...

    @reads
    def full_scale(self) -> Annotated[Figure, "m/s2"]:
        """Return the largest acceleration of the chosen range in m/s2."""
        ...


@runtime_checkable
class SafeByBytes(Protocol):
    """An output that can be made safe with nothing but bytes, by a process that has no driver.

    Every role with states has one where its instrument has a byte stream of its own. A sensor on an I2C bus has none,
    also where the bus is served by an instrument that has: what feeds it is what makes it safe.
    """

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return how to bring the output to a state, from what the driver knows; nothing is sent.

        Args:
            state: one of its role's states.
            proof: how the bench file proves that state. Where it reads a quantity of this very output that the
                instrument reports in text, the bytes ask for it too, and hold it to these bounds.

        Raises:
            Refused: there is no such state, or bytes do not lead there.
        """
        ...


@runtime_checkable
class Watched(Protocol):
    """An output whose instrument makes it safe by itself once no heartbeat has come for a while."""

    @property
    def watchdog_s(self) -> float:
        """After how many seconds; 0 where it has no such watchdog, or the wire does not ask for it."""
        ...


@runtime_checkable
class Beaten(Watched, Protocol):
    """One whose heartbeat the executive sends; the others beat wherever they are read."""

    def beat(self) -> None:
        """Send a heartbeat, if anything is on.

        Raises:
            Rejected: the instrument has made the output safe since the last one.
            DeviceFault: it does not answer, or nonsense.
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
