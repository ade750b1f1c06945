"""A bench as data: instruments, wiring, clamps, envelope, safe-off, and the simulated twin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hil.model.cutting import CutPath, WatchAfter
from hil.model.envelope import EnvelopeLimit
from hil.model.identity import Identity

__all__ = [
    "BenchSpec",
    "Bus",
    "CalibratedRange",
    "Calibration",
    "Clamp",
    "InstrumentSpec",
    "PeerSpec",
    "PlantSpec",
    "Position",
    "Proof",
    "Rating",
    "ReducedLevel",
    "SafeStep",
    "SimulatedBench",
    "UsbPort",
    "Wire",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus:
    """An I2C bus and how fast it runs.

    Either `port` (where it is on hardware) or `instrument` (who runs its transfers) is set.
    """

    name: str
    port: str = ""
    instrument: str = ""
    frequency_hz: float = 100_000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibratedRange:
    """One line of a certificate: expanded uncertainty = absolute + relative * |reading|, at coverage k."""

    quantity: str
    unit: str
    low: float
    high: float
    absolute: float
    relative: float = 0.0
    k: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """An instrument's calibration record; `due` is the last day on which it counts, ISO 8601."""

    certificate: str
    due: str
    ranges: tuple[CalibratedRange, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Rating:
    """What an instrument's channel can stand or give; channel 0 means the whole instrument."""

    channel: int
    quantity: str
    unit: str
    maximum: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UsbPort:
    """Which USB device a serial port must be: its serial number, or the place in which it is plugged in.

    Attributes:
        serial: serial number of the device, empty where it has none of its own.
        path: name of the port in `/dev/serial/by-path`, for devices whose serial numbers are all alike.
    """

    serial: str = ""
    path: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentSpec:
    """One instrument: its driver, where it is, who it must be, what it may do.

    Either `port` (a URL for pyserial) or `bus` and `address` (I2C) is set. `powered_by` names the
    output that feeds it, empty where it has power of its own. `usb` says which device a serial port must be.
    """

    name: str
    driver: str
    port: str = ""
    baud: int = 0
    bus: str = ""
    address: int = 0
    powered_by: str = ""
    identity: Identity = field(default_factory=Identity)
    ratings: tuple[Rating, ...] = ()
    calibration: Calibration | None = None
    dut: bool = False
    usb: UsbPort | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """Which contacts of which relays are closed, and whether the output then feeds its load."""

    relays: str
    closed: tuple[str, ...]
    conducts: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedLevel:
    """What arm does with a supply output before anybody relies on it.

    The output is set to this voltage [V] and current limit [A] and switched on; its measured voltage
    must come up with the right sign and its current [A] must stay between the two bounds. Where relays
    stand between output and load, that is done in each of the positions; in one that does not conduct
    the current must stay below the lower bound. So a contact that is welded, or does not close, shows.
    """

    voltage: float
    current: float
    lowest_current: float
    highest_current: float
    positions: tuple[Position, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Wire:
    """A named role instance: `supply.coil` is channel 2 of `psu1`.

    Attributes:
        role: what a case asks for (`supply`, `relays`, `magnetometer`).
        instance: its name within the role, empty where the role has one instance only.
        instrument: the instrument that fills it.
        channel: the instrument's channel, 0 where it has none.
        contacts: for relays, name of a contact to its number on the board.
        settings: what the role needs besides (measurement range, output rate), as strings.
        reduced: for supplies, the level at which arm tries the output.
        charges: for supplies, the cycler through which the output charges a battery; empty where it charges none.
        hazardous: whether its output can do harm when nobody can reach it; only roles that drive anything are asked.
        note: polarity, fuse, cable: printed in the report's wiring table.
    """

    role: str
    instance: str
    instrument: str
    channel: int = 0
    contacts: Mapping[str, int] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    reduced: ReducedLevel | None = None
    charges: str = ""
    hazardous: bool = True
    note: str = ""

    @property
    def name(self) -> str:
        """The dotted name that clamps, envelope and safe-off use."""
        return f"{self.role}.{self.instance}" if self.instance else self.role


@dataclass(frozen=True, slots=True, kw_only=True)
class Clamp:
    """The range that settings of one output may have; anything beyond is not sent."""

    output: str
    quantity: str
    unit: str
    minimum: float
    maximum: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Proof:
    """How a safe state is proven: this read must be within these bounds."""

    output: str
    quantity: str
    unit: str
    minimum: float
    maximum: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeStep:
    """One line of the ordered safe-off: bring this output to this state, prove it, within this time."""

    output: str
    state: str
    within_s: float
    proof: Proof | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantSpec:
    """Physics of the simulated twin: which model, on which grid, with which truth."""

    name: str
    model: str
    grid_s: float
    truth: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerSpec:
    """The simulated end of one instrument.

    Attributes:
        device: the instrument's name.
        model: which peer; the driver's usual counterpart where empty.
        truth: what this article really is (serial number, offsets, noise).
        connects: the peer's terminals to plant signals (`{"2": "coil.supply"}`).
        faults: what goes wrong with it, and when.
    """

    device: str
    model: str
    truth: Mapping[str, object] = field(default_factory=dict)
    connects: Mapping[str, str] = field(default_factory=dict)
    faults: tuple[Mapping[str, object], ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedBench:
    """The simulated twin: epoch, seed, plants and peers."""

    epoch: str
    seed: int
    plants: tuple[PlantSpec, ...]
    peers: tuple[PeerSpec, ...]
    person: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchSpec:
    """One bench file, read and checked; `dew_point` is that of its air in degC, None where nobody knows it."""

    name: str
    title: str
    place: str
    buses: tuple[Bus, ...]
    instruments: tuple[InstrumentSpec, ...]
    wiring: tuple[Wire, ...]
    clamps: tuple[Clamp, ...]
    envelope: tuple[EnvelopeLimit, ...]
    safe_off: tuple[SafeStep, ...]
    rest: tuple[SafeStep, ...]
    hold: tuple[SafeStep, ...] = ()
    cut_paths: tuple[CutPath, ...] = ()
    watch_after: tuple[WatchAfter, ...] = ()
    dew_point: float | None = None
    simulated: SimulatedBench | None

    def instrument(self, name: str) -> InstrumentSpec:
        """Return the instrument of that name; the bench file was checked, so it exists."""
        return next(item for item in self.instruments if item.name == name)

    def wire(self, name: str) -> Wire:
        """Return the role instance of that dotted name; the bench file was checked, so it exists."""
        return next(item for item in self.wiring if item.name == name)
