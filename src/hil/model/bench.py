"""A bench as data: instruments, wiring, clamps, envelope, safe-off, and the simulated twin.

These are the models of `bench.yaml`: the type of a field says how its value is written there, see `hil.model.notation`,
and `alias` is its key where that differs from its name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from hil.model.cutting import CutPath, WatchAfter
from hil.model.envelope import EnvelopeLimit
from hil.model.identity import DATE, Day, Identity
from hil.model.notation import (
    NAMED,
    UNWRITTEN,
    AnyText,
    ByName,
    Flag,
    Hertz,
    Number,
    Plain,
    Seconds,
    Text,
    matching,
    number,
    one_of,
    seconds,
    slug,
    whole,
)
from hil.model.serial_line import SerialLine

__all__ = [
    "TERMINATORS",
    "BenchHead",
    "BenchSpec",
    "Bounds",
    "Bus",
    "CalibratedRange",
    "Calibration",
    "Clamp",
    "InstrumentSpec",
    "OnboardPort",
    "PeerSpec",
    "PlantSpec",
    "Position",
    "Proof",
    "Rating",
    "ReducedLevel",
    "Registered",
    "SafeStep",
    "SimulatedBench",
    "UsbPort",
    "Wire",
]


_EPOCH = rf"{DATE}T([01]\d|2[0-3]):[0-5]\d:[0-5]\dZ"
_Count = Annotated[int, whole(0)]

TERMINATORS = {"LF": b"\n", "CR": b"\r", "CR LF": b"\r\n"}
"""Line terminators by their names in bench files."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus:
    """An I2C bus with its clock frequency.

    Either `port` (of the hardware) or `instrument` (which serves the bus) is set.
    """

    name: str = field(default="", metadata=NAMED)
    port: AnyText = ""
    instrument: AnyText = ""
    frequency_hz: Hertz = field(default=100_000.0, metadata={"alias": "frequency"})


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedRange:
    """One line of a certificate: expanded uncertainty = absolute + relative * |reading|, at coverage k."""

    quantity: Text
    unit: Text
    low: Number = field(metadata={"alias": "from"})
    high: Number = field(metadata={"alias": "to"})
    absolute: Annotated[float, number(0.0)]
    relative: Annotated[float, number(0.0)] = 0.0
    k: Annotated[float, number(above=0.0)] = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Registered:
    """Register data of an instrument and its newest certificate, besides the uncertainty.

    Attributes:
        id: the instrument's name in the register.
        serial: its serial number.
        number: the certificate's number.
        laboratory: calibration laboratory.
        date: the day of calibration, ISO 8601.
        sha256: SHA-256 of the certificate's file.
        as_left: how the laboratory returned the instrument.
    """

    id: str
    serial: str
    number: str
    laboratory: str
    date: str
    sha256: str
    as_left: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """An instrument's calibration record, from the bench file or the register of instruments.

    Attributes:
        certificate: the file of the certificate, below the bench's folder; one of the register below the fixtures.
        due: last day of validity, ISO 8601.
        ranges: uncertainty by quantity and range.
        registered: data only in the register, None for a record of the bench file.
    """

    certificate: Text
    due: Day
    ranges: tuple[CalibratedRange, ...]
    registered: Registered | None = field(default=None, metadata=UNWRITTEN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rating:
    """Rating of an instrument's channel; channel 0 means the whole instrument."""

    channel: _Count = 0
    quantity: Text
    unit: Text
    maximum: Number = field(metadata={"alias": "max"})


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbPort:
    """Required USB device of a serial port: by serial number, or by where it is plugged in.

    Attributes:
        serial: serial number of the device, empty if it has none of its own.
        path: name of the port in `/dev/serial/by-path`, for devices without unique serial numbers.
    """

    serial: AnyText = ""
    path: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnboardPort:
    """Required onboard UART of a serial port, by its sysfs data.

    Attributes:
        device: its hardware, a folder on the path to which `/sys/class/tty/NAME/device` leads: `fe201000.serial`.
        driver: its kernel driver, such as `uart-pl011`; compared only if given.
        at: its base address, such as `0x2f8`; for cards with several ports.
    """

    device: Text
    driver: AnyText = ""
    at: Annotated[str, matching("0x[0-9a-fA-F]{1,16}", "an address such as 0x2f8, in quotes")] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentSpec:
    """One instrument: driver, port, expected identity, ratings.

    Either `port` (a URL for pyserial) or `bus` and `address` (I2C) is set. `powered_by` names the
    output that feeds it, empty if it has its own supply. `usb`, or `onboard` if it is not a USB device, identifies the
    required device of a serial port. `serial_line` is its settings.

    Attributes:
        second_address: address of a chip's second die; 0 for its usual address.
        register: its name in the register of instruments, the source of its calibration; empty for none.
        terminator: line terminator in both directions; empty for the driver's default.
        timeout_s: reply timeout [s]; 0 for the driver's default.
        stands_for_hardware: why a port on this computer's own network is hardware; stated in every report of a run.
        bytes_unseen: why unrecorded bytes of a wrapped instrument are acceptable; stated in every report.
    """

    name: str = field(default="", metadata=NAMED)
    driver: Text
    port: AnyText = ""
    baud: _Count = 0
    bus: AnyText = ""
    address: _Count = 0
    second_address: _Count = 0
    powered_by: AnyText = ""
    identity: Identity = field(default_factory=Identity)
    ratings: tuple[Rating, ...] = ()
    calibration: Calibration | None = None
    register: AnyText = ""
    dut: Flag = False
    usb: UsbPort | None = None
    onboard: OnboardPort | None = None
    serial_line: SerialLine | None = None
    terminator: Annotated[str, one_of(*TERMINATORS)] = ""
    timeout_s: Annotated[float, seconds(above=0.0)] = field(default=0.0, metadata={"alias": "timeout"})
    stands_for_hardware: AnyText = ""
    bytes_unseen: AnyText = ""

    @property
    def line_end(self) -> bytes:
        """The bytes of `terminator`, empty for the driver's default."""
        return TERMINATORS.get(self.terminator, b"")


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """A relay position: the closed contacts, and whether the output then feeds its load."""

    relays: Text
    closed: tuple[Text, ...]
    conducts: Flag


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedLevel:
    """Reduced level at which arm tests a supply output before it is used.

    The output is set to this voltage [V] and current limit [A] and switched on; its measured voltage
    must come up with the right sign and its current [A] must stay between the two bounds. With relays
    between output and load this is repeated in each position; in one that does not conduct, the
    current must stay below the lower bound. This reveals a contact that is welded or does not close.
    """

    voltage: Annotated[float, number(above=0.0)]
    current: Number
    lowest_current: Number
    highest_current: Number
    positions: tuple[Position, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """A named role instance: `supply.coil` is channel 2 of `psu1`.

    Attributes:
        role: the role used by cases (`supply`, `relays`, `magnetometer`).
        instance: its name within the role, empty if the role has only one instance.
        instrument: the instrument that fills it.
        channel: the instrument's channel, 0 where it has none.
        contacts: for relays, the board's contact numbers by contact name.
        settings: further settings of the role (measurement range, output rate), as strings.
        reduced: for supplies, the level at which arm tests the output.
        charges: for supplies, the cycler through which the output charges a battery; empty if none.
        hazardous: whether its output can do harm while unreachable; only for roles that drive something.
        note: polarity, fuse, cable; printed in the report's wiring table.
    """

    role: Text
    instance: Annotated[str, slug("_")] = ""
    instrument: Text
    channel: _Count = 0
    contacts: Mapping[str, Annotated[int, whole()]] = field(default_factory=dict)
    settings: Mapping[str, Text] = field(default_factory=dict)
    reduced: ReducedLevel | None = None
    charges: AnyText = ""
    hazardous: Flag = True
    note: AnyText = ""

    @property
    def name(self) -> str:
        """The dotted name used by clamps, envelope and safe-off."""
        return f"{self.role}.{self.instance}" if self.instance else self.role


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """The range of one quantity of one output."""

    output: Text
    quantity: Text
    unit: Text
    minimum: Number = field(metadata={"alias": "min"})
    maximum: Number = field(metadata={"alias": "max"})


class Clamp(Bounds):
    """The permitted range of one output's settings; anything beyond is not sent."""

    __slots__ = ()


class Proof(Bounds):
    """Proof of a safe state: this reading must be within these bounds."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeStep:
    """One line of the ordered safe-off: output, safe state, proof and time limit."""

    output: Text
    state: Text
    within_s: Annotated[float, seconds(above=0.0)] = field(metadata={"alias": "within"})
    proof: Proof | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSpec:
    """A plant of the simulated twin: model, time grid and truth."""

    name: str = field(default="", metadata=NAMED)
    model: Text
    grid_s: Seconds = field(metadata={"alias": "grid"})
    truth: Mapping[str, Plain] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerSpec:
    """The simulated end of one instrument.

    Attributes:
        device: the instrument's name.
        model: peer model; the driver's usual counterpart if empty.
        truth: true properties of the simulated instrument or DUT (serial number, offsets, noise).
        connects: the peer's terminals to plant signals (`{"2": "coil.supply"}`).
        faults: its injected faults, with their times.
    """

    device: str = field(default="", metadata=NAMED)
    model: AnyText = ""
    truth: Mapping[str, Plain] = field(default_factory=dict)
    connects: Mapping[str, Text] = field(default_factory=dict)
    faults: tuple[Mapping[str, Plain], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedBench:
    """The simulated twin: epoch, seed, plants and peers."""

    epoch: Annotated[str, matching(_EPOCH, "an instant in UTC such as 2026-01-01T08:00:00Z")]
    seed: Annotated[int, whole()]
    plants: Annotated[tuple[PlantSpec, ...], ByName()]
    peers: Annotated[tuple[PeerSpec, ...], ByName()]
    person: Mapping[str, Text] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchHead:
    """Name, location and global settings of a bench.

    Attributes:
        dew_point: dew point of the ambient air [degC], None if unknown.
        acknowledge: `anyone`, or `owner`: only the user of the run, and root.
        longest_computation_s: longest time without a scheduling point in a case's own code with outputs on [s].
    """

    name: Annotated[str, slug("-")]
    title: Text
    place: AnyText = ""
    dew_point: Number | None = None
    acknowledge: Annotated[str, one_of("anyone", "owner", blank="anyone")] = "anyone"
    longest_computation_s: Annotated[float, seconds(0.5)] = field(
        default=10.0, metadata={"alias": "longest_computation"}
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchSpec:
    """One validated bench file."""

    head: BenchHead = field(metadata={"alias": "bench"})
    buses: Annotated[tuple[Bus, ...], ByName()] = ()
    instruments: Annotated[tuple[InstrumentSpec, ...], ByName()]
    wiring: tuple[Wire, ...]
    clamps: tuple[Clamp, ...] = ()
    envelope: tuple[EnvelopeLimit, ...] = ()
    safe_off: tuple[SafeStep, ...]
    rest: tuple[SafeStep, ...]
    hold: tuple[SafeStep, ...] = ()
    cut_paths: tuple[CutPath, ...] = ()
    watch_after: tuple[WatchAfter, ...] = ()
    simulated: SimulatedBench | None = None

    @property
    def name(self) -> str:
        """Name of the bench, and of its folder."""
        return self.head.name

    def instrument(self, name: str) -> InstrumentSpec:
        """Return the instrument of that name; the bench file was checked, so it exists."""
        return next(item for item in self.instruments if item.name == name)

    def wire(self, name: str) -> Wire:
        """Return the role instance of that dotted name; the bench file was checked, so it exists."""
        return next(item for item in self.wiring if item.name == name)
