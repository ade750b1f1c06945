"""A bench as data: instruments, wiring, clamps, envelope, safe-off, and the simulated twin.

These are the models of `bench.yaml`: the type of a field says how its value is written there, see `hil.model.notation`,
and `alias` gives its key where that is another than its name.
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
"""What a line of text can end with, as the bench file writes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus:
    """An I2C bus and how fast it runs.

    Either `port` (where it is on hardware) or `instrument` (who runs its transfers) is set.
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
    """What the register says of an instrument and its newest certificate, beyond its uncertainty.

    Attributes:
        id: the instrument's name in the register.
        serial: its serial number.
        number: the certificate's number.
        laboratory: who calibrated.
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
    """An instrument's calibration record, of the bench file or from the register of instruments.

    Attributes:
        certificate: the file of the certificate, below the bench's folder; one of the register below the fixtures.
        due: the last day on which it counts, ISO 8601.
        ranges: its uncertainty by quantity and range.
        registered: what only the register says, None for a record of the bench file.
    """

    certificate: Text
    due: Day
    ranges: tuple[CalibratedRange, ...]
    registered: Registered | None = field(default=None, metadata=UNWRITTEN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rating:
    """What an instrument's channel can withstand or deliver; channel 0 means the whole instrument."""

    channel: _Count = 0
    quantity: Text
    unit: Text
    maximum: Number = field(metadata={"alias": "max"})


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbPort:
    """Which USB device a serial port must be: its serial number, or the place in which it is plugged in.

    Attributes:
        serial: serial number of the device, empty if it has none of its own.
        path: name of the port in `/dev/serial/by-path`, for devices whose serial numbers are all alike.
    """

    serial: AnyText = ""
    path: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OnboardPort:
    """Which UART of this computer's own a serial port must be, by what the kernel says of it in sysfs.

    Attributes:
        device: its hardware, a folder on the path to which `/sys/class/tty/NAME/device` leads: `fe201000.serial`.
        driver: the kernel's driver of it, such as `uart-pl011`; compared only where it is given.
        at: its first address, such as `0x2f8`; for cards with several ports.
    """

    device: Text
    driver: AnyText = ""
    at: Annotated[str, matching("0x[0-9a-fA-F]{1,16}", "an address such as 0x2f8, in quotes")] = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentSpec:
    """One instrument: its driver, where it is, who it must be, what it may do.

    Either `port` (a URL for pyserial) or `bus` and `address` (I2C) is set. `powered_by` names the
    output that feeds it, empty if it has power of its own. `usb`, or `onboard` where it is no USB device, says which
    device a serial port must be. `serial_line` is how that is set.

    Attributes:
        second_address: of the second die of a chip that has two; 0 for that die's usual address.
        register: its name in the register of instruments, which then says how it is calibrated; empty for none.
        terminator: what ends a line of text, both ways; empty for what the driver takes by itself.
        timeout_s: how long a reply may take [s]; 0 for what the driver takes by itself.
        stands_for_hardware: why a port on this computer's own network is hardware; every report of a run tells it.
        bytes_unseen: why it is accepted that nobody saw the bytes of a wrapped instrument; every report tells it.
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
        """The bytes of `terminator`, none where the driver takes its own."""
        return TERMINATORS.get(self.terminator, b"")


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Which contacts of which relays are closed, and whether the output then feeds its load."""

    relays: Text
    closed: tuple[Text, ...]
    conducts: Flag


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedLevel:
    """What arm does with a supply output before anybody relies on it.

    The output is set to this voltage [V] and current limit [A] and switched on; its measured voltage
    must come up with the right sign and its current [A] must stay between the two bounds. Where relays
    stand between output and load, that is done in each of the positions; in one that does not conduct
    the current must stay below the lower bound. So a contact that is welded, or does not close, shows.
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
        role: what a case asks for (`supply`, `relays`, `magnetometer`).
        instance: its name within the role, empty if the role has one instance only.
        instrument: the instrument that fills it.
        channel: the instrument's channel, 0 where it has none.
        contacts: for relays, name of a contact to its number on the board.
        settings: what else the role needs (measurement range, output rate), as strings.
        reduced: for supplies, the level at which arm tries the output.
        charges: for supplies, the cycler through which the output charges a battery; empty if it charges none.
        hazardous: whether its output can do harm when nobody can reach it; only roles that drive anything are asked.
        note: polarity, fuse, cable: printed in the report's wiring table.
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
        """The dotted name that clamps, envelope and safe-off use."""
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
    """The range that settings of one output may have; anything beyond is not sent."""

    __slots__ = ()


class Proof(Bounds):
    """How a safe state is proven: this read must be within these bounds."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeStep:
    """One line of the ordered safe-off: bring this output to this state, prove it, within this time."""

    output: Text
    state: Text
    within_s: Annotated[float, seconds(above=0.0)] = field(metadata={"alias": "within"})
    proof: Proof | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSpec:
    """Physics of the simulated twin: which model, on which grid, with which truth."""

    name: str = field(default="", metadata=NAMED)
    model: Text
    grid_s: Seconds = field(metadata={"alias": "grid"})
    truth: Mapping[str, Plain] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerSpec:
    """The simulated end of one instrument.

    Attributes:
        device: the instrument's name.
        model: which peer; the driver's usual counterpart where empty.
        truth: what the simulated instrument or DUT really is (serial number, offsets, noise).
        connects: the peer's terminals to plant signals (`{"2": "coil.supply"}`).
        faults: what goes wrong with it, and when.
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
    """What a bench is called, where it stands, and what holds of all of it.

    Attributes:
        dew_point: of its air in degC, None if nobody knows it.
        acknowledge: `anyone`, or `owner`: only the user whose run it was, and root.
        longest_computation_s: how long a case's own code may come to no scheduling point with outputs on [s].
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
    """One bench file, read and checked."""

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
        """What the bench is called; its folder is called the same."""
        return self.head.name

    def instrument(self, name: str) -> InstrumentSpec:
        """Return the instrument of that name; the bench file was checked, so it exists."""
        return next(item for item in self.instruments if item.name == name)

    def wire(self, name: str) -> Wire:
        """Return the role instance of that dotted name; the bench file was checked, so it exists."""
        return next(item for item in self.wiring if item.name == name)
