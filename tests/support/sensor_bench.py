"""A sensor behind its driver: on the host's own bus, or on one that streams; and what is known of each chip."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from board_bus import BoardBus

from hil.clock.virtual import VirtualClock
from hil.instruments.bme680 import Bme680
from hil.instruments.bmi088 import Bmi088
from hil.instruments.bno055 import Bno055
from hil.instruments.driver import Clamps, Connection
from hil.instruments.icm20948 import Icm20948
from hil.instruments.iim42652 import Iim42652
from hil.instruments.lis3mdl import Lis3mdl
from hil.instruments.lsm9ds1 import Lsm9ds1
from hil.instruments.sensors.sensor import SensorDriver
from hil.instruments.sensors.timed import TimedSensor
from hil.model.bench import InstrumentSpec, Wire
from hil.simulation.faults import read_faults
from hil.simulation.peers import bme680, bmi088, bno055, icm20948, iim42652, lis3mdl, lsm9ds1
from hil.simulation.peers.faulty import FaultyBusPeer, FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerModel, PeerSetup
from hil.simulation.plants.plant import Plant
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.simulated_bus import SimulatedBus

__all__ = ["BME680", "BOARD_CHIPS", "CHIPS", "FIFO_CHIPS", "IIM42652", "LIS3MDL", "TIMED_CHIPS", "Bench", "SensorChip"]

_SECOND = 1_000_000_000
_NOTHING_NEW, _STANDS_STILL = "no new sample within", "consecutive samples are equal"


@dataclass(frozen=True, kw_only=True)
class SensorChip:
    """One chip: its two sides, and numbers of its data sheet that neither of them is asked for.

    Attributes:
        role, unit: what it fills, and the unit of its axes.
        named: what it is identified as.
        address, strapped: its usual address, and the other one.
        die: the address at which that role is, where its chip has a second die; `address` else.
        power_on: a register, as it is sent, and what is read from there on after power-on.
        ranges, rates: as a wire names them; `narrow` is the first of them in the axes' unit.
        truth, expected: a truth section, and the axes and temperature that come of it.
        close: how near to that a sample is.
        noisy: a truth section with noise that no two samples share.
        sleep: a register, as it is sent, and what is read there of a sensor that was stopped.
        boot: seconds from power-on until it certainly answers.
        nap: what a sample says of one that fell asleep, empty where its axes are marked invalid; and what a start says
            while it cannot be woken.
        warm_first: whether a start waits for a temperature that can be.
        capacity: packets that its FIFO holds, 0 for a chip without one; `fifo_off` is as `sleep`.
        by_host: whether the host reads its FIFO itself, also over an OBC.
        counts_losses: whether a stream goes on after its FIFO has overflowed.
        stream: the rate at which it streams unless its wire says otherwise [Hz].
    """

    driver: type[SensorDriver]
    model: PeerModel
    role: str
    unit: str
    named: str
    address: int
    strapped: int
    die: int = 0
    power_on: tuple[int, bytes]
    ranges: tuple[str, ...]
    rates: tuple[str, ...]
    narrow: float
    truth: dict[str, object]
    expected: tuple[float, ...]
    close: float
    noisy: dict[str, object] = field(default_factory=dict)
    sleep: tuple[int, int]
    boot: float = 0.01
    nap: tuple[str, str] = ("", "reads back")
    warm_first: bool = False
    capacity: int = 0
    fifo_off: tuple[int, int] = (0, 0)
    by_host: bool = False
    counts_losses: bool = True
    stream: float = 100.0


def _accelerometer(chip, **its):
    """Return the accelerometer of a chip: off along x, with gravity along z."""
    warm = {name: chip.truth[name] for name in ("temperature", "temperature_offset")}
    shared = {
        "role": "accelerometer",
        "unit": "m/s2",
        "truth": {"accelerometer": {"bias_x": ["-9.5", "0", "0"]}, **warm},
        "expected": (-9.5, 0.0, 9.80665, chip.expected[3]),
        "close": 0.1,
        "noisy": {"accelerometer": {"white": ["0.1", "0.1", "0.1"]}},
        "capacity": 0,
    }
    return replace(chip, **shared | its)


def _magnetometer(chip, **its):
    """Return the magnetometer of a chip, in the field of the LIS3MDL."""
    shared = {"truth": LIS3MDL.truth, "expected": LIS3MDL.expected, "noisy": {}, "capacity": 0, "warm_first": False}
    return replace(chip, role="magnetometer", unit="uT", **shared | its)


LIS3MDL = SensorChip(
    driver=Lis3mdl,
    model=lis3mdl.MODEL,
    role="magnetometer",
    unit="uT",
    named="LIS3MDL",
    address=0x1C,
    strapped=0x1E,
    power_on=(0xA0, bytes.fromhex("1000030000")),
    ranges=("4 gauss", "8 gauss", "12 gauss", "16 gauss"),
    rates=("0.625 Hz", "5 Hz", "80 Hz", "155 Hz"),
    narrow=400.0,
    truth={"offset": ["48.0", "-22.5", "150.0"], "noise": ["0.02"] * 3, "temperature": "40.0"},
    expected=(48.0, -22.5, 150.0, 40.0),
    close=0.2,
    sleep=(0x22, 0x03),
    nap=(_NOTHING_NEW, "were set to fc 00 00 0c 40 and read back fc 00 03 0c 40"),
)

IIM42652 = SensorChip(
    driver=Iim42652,
    model=iim42652.MODEL,
    role="gyroscope",
    unit="deg/s",
    named="IIM-42652",
    address=0x68,
    strapped=0x69,
    power_on=(0x4C, bytes.fromhex("30910006061611")),
    ranges=("31.25", "62.5", "125", "250", "500", "1000", "2000"),
    rates=("12.5", "25", "50", "100", "200", "500", "1000"),
    narrow=31.25,
    truth={
        "bias_x": ["1.5", "0", "0"],
        "bias_y": ["-20", "0", "0"],
        "bias_z": ["0.25", "0", "0"],
        "temperature": "-16",
        "temperature_offset": "0.5",
    },
    expected=(1.5, -20, 0.25, -15.5),
    close=0.3,
    noisy={"white": ["1", "1", "1"]},
    sleep=(0x4E, 0x00),
    nap=("", "PWR_MGMT0 was set to 0x0c and reads back 0x00"),
    warm_first=True,
    capacity=256,
    fifo_off=(0x16, 0x00),
)

BMI088 = SensorChip(
    driver=Bmi088,
    model=bmi088.MODEL,
    role="gyroscope",
    unit="deg/s",
    named="BMI088",
    address=0x18,
    strapped=0x19,
    die=0x68,
    power_on=(0x0F, bytes.fromhex("008000")),
    ranges=("125", "250", "500", "1000", "2000"),
    rates=("100", "200", "400", "1000", "2000"),
    narrow=125.0,
    truth=IIM42652.truth,
    expected=IIM42652.expected,
    close=1.7,
    noisy={"white": ["1", "1", "1"]},
    sleep=(0x11, 0x80),
    nap=(_STANDS_STILL, "register 0x11 was set to 0x00 and reads back 0x80"),
    warm_first=True,
    capacity=100,
    fifo_off=(0x3E, 0x00),
    by_host=True,
    counts_losses=False,
)

BMI088_ACCELEROMETER = _accelerometer(
    BMI088,
    die=0x18,
    power_on=(0x40, bytes.fromhex("a801")),
    ranges=("3", "6", "12", "24"),
    rates=("12.5", "25", "50", "100", "200", "400"),
    narrow=3 * 9.80665,
    sleep=(0x7C, 0x03),
    nap=(_STANDS_STILL, "register 0x7d was set to 0x04 and reads back 0x00"),
)

ICM20948 = SensorChip(
    driver=Icm20948,
    model=icm20948.MODEL,
    role="gyroscope",
    unit="deg/s",
    named="ICM-20948",
    address=0x68,
    strapped=0x69,
    power_on=(0x05, bytes.fromhex("404100")),
    ranges=("250", "500", "1000", "2000"),
    rates=("12.5", "45", "112.5", "225"),
    narrow=250.0,
    truth=IIM42652.truth,
    expected=IIM42652.expected,
    close=0.3,
    noisy={"white": ["1", "1", "1"]},
    sleep=(0x06, 0x41),
    nap=(_NOTHING_NEW, "PWR_MGMT_1 was set to 0x01 and reads back 0x41"),
    boot=0.012,
    capacity=64,
    fifo_off=(0x67, 0x00),
    by_host=True,
    stream=112.5,
)

ICM20948_ACCELEROMETER = _accelerometer(ICM20948, ranges=("2", "4", "8", "16"), narrow=2 * 9.80665)

ICM20948_MAGNETOMETER = _magnetometer(
    ICM20948,
    ranges=(),
    rates=("10", "20", "50", "100"),
    narrow=4912.0,
    close=0.3,
    nap=("cannot be reached: PWR_MGMT_1 is 0x41", "cannot be reached: PWR_MGMT_1 is 0x41"),
)

BNO055 = SensorChip(
    driver=Bno055,
    model=bno055.MODEL,
    role="gyroscope",
    unit="deg/s",
    named="BNO055",
    address=0x28,
    strapped=0x29,
    power_on=(0x3B, bytes.fromhex("80000000")),
    ranges=("125", "250", "500", "1000", "2000"),
    rates=(),
    narrow=125.0,
    truth=IIM42652.truth | {"temperature_offset": "1"},
    expected=(1.5, -20, 0.25, -15),
    close=0.4,
    noisy={"white": ["1", "1", "1"]},
    sleep=(0x3E, 0x02),
    nap=("it is in CONFIGMODE: it has lost its settings", "OPR_MODE was set to 0x0[67] and reads back 0x00"),
    boot=0.66,
)

BNO055_ACCELEROMETER = _accelerometer(BNO055, ranges=("2", "4", "8", "16"), narrow=2 * 9.80665)

BNO055_MAGNETOMETER = _magnetometer(
    BNO055,
    ranges=(),
    rates=("2", "10", "20", "30"),
    narrow=1300.0,
    truth=LIS3MDL.truth | {"noise": ["0.1"] * 3},
    close=0.5,
)

LSM9DS1 = SensorChip(
    driver=Lsm9ds1,
    model=lsm9ds1.MODEL,
    role="gyroscope",
    unit="deg/s",
    named="LSM9DS1",
    address=0x6A,
    strapped=0x6B,
    power_on=(0x1E, bytes.fromhex("383800000400")),
    ranges=("245", "500", "2000"),
    rates=("119", "238", "476", "952"),
    narrow=245.0,
    truth=IIM42652.truth,
    expected=IIM42652.expected,
    close=0.3,
    noisy={"white": ["1", "1", "1"]},
    sleep=(0x10, 0x00),
    nap=(_NOTHING_NEW, "register 0x10 was set to 0x60 and reads back 0x00"),
    warm_first=True,
    capacity=32,
    fifo_off=(0x23, 0x00),
    by_host=True,
    stream=119.0,
)

LSM9DS1_ACCELEROMETER = _accelerometer(
    LSM9DS1,
    ranges=("2", "4", "8", "16"),
    narrow=2 * 9.80665,
    close=0.2,
    sleep=(0x20, 0x00),
    nap=(_NOTHING_NEW, "register 0x20 was set to 0x60 and reads back 0x00"),
)

LSM9DS1_MAGNETOMETER = _magnetometer(
    LSM9DS1,
    die=0x1C,
    power_on=LIS3MDL.power_on,
    ranges=LIS3MDL.ranges,
    rates=LIS3MDL.rates,
    narrow=LIS3MDL.narrow,
    close=LIS3MDL.close,
    sleep=LIS3MDL.sleep,
    nap=(_NOTHING_NEW, "register 0x20 was set to 0x20 and reads back 0x00"),
)

BME680 = SensorChip(
    driver=Bme680,
    model=bme680.MODEL,
    role="thermometer",
    unit="degC",
    named="BME680",
    address=0x76,
    strapped=0x77,
    power_on=(0x74, b"\x00"),
    ranges=(),
    rates=(),
    narrow=0.0,
    truth={"temperature": "-12.5"},
    expected=(-12.5,),
    close=0.05,
    sleep=(0x74, 0x00),
    nap=(_NOTHING_NEW, _NOTHING_NEW),
)
"""The only one that has no axes."""

CHIPS = (
    IIM42652,
    LIS3MDL,
    BMI088,
    BMI088_ACCELEROMETER,
    BNO055,
    BNO055_ACCELEROMETER,
    BNO055_MAGNETOMETER,
    ICM20948,
    ICM20948_ACCELEROMETER,
    ICM20948_MAGNETOMETER,
    LSM9DS1,
    LSM9DS1_ACCELEROMETER,
    LSM9DS1_MAGNETOMETER,
)
"""Every chip; a new one is added here, and has all tests of the family."""

FIFO_CHIPS = tuple(chip for chip in CHIPS if chip.capacity)
"""Those that can stream."""

BOARD_CHIPS = tuple(chip for chip in FIFO_CHIPS if not chip.by_host)
"""Those whose FIFO an OBC can read at their interrupts."""

TIMED_CHIPS = tuple(chip for chip in CHIPS if issubclass(chip.driver.sensor, TimedSensor))
"""Those that have no FIFO, and that the timer of an OBC can read."""


class Table(Plant):
    """A supply that can be cut."""

    def __init__(self) -> None:
        super().__init__("table", _SECOND // 10, (0.0,), {"volts": 3.3}, frozenset({"supply"}))

    def step(self, state, inputs, dt):
        """Do nothing."""
        return state

    def signal(self, name, state, inputs, at):
        """Return the supply voltage."""
        return inputs["volts"]


class Bench:
    """A sensor, its bus, clock and supply; `sensor` is the role."""

    def __init__(self, chip, *, board=False, truth=None, faults=(), settings=None, sparing=True) -> None:
        self.chip = chip
        self.clock = VirtualClock()
        self.supply = Table()
        self.supply.follow(self.clock.now_ns)
        self.seeds = Seeds(5)
        self.peer = self.build("sensor", chip.model, truth, faults)
        self.peer.attach(self.clock)
        self.bus = self.make_bus(board)
        connection = Connection(
            device="sensor", clock=self.clock, clamps=Clamps(), bus=self.bus, address=chip.address, sparing=sparing
        )
        self.driver = chip.driver(connection)
        self.sensor = self.driver.role(Wire(role=chip.role, instance="", instrument="sensor", settings=settings or {}))
        self.clock.sleep(chip.boot)

    def build(self, name, model, truth, faults):
        """Return a peer, with its faults around it."""
        bus = model.link == "bus"
        wrong = read_faults(faults, ("faults",), fault_kinds(model))
        plugs = {"power": "table.supply"} if bus else {}
        setup = PeerSetup(
            instrument=InstrumentSpec(name=name, driver="any", address=self.chip.address if bus else 0),
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections(plugs, {"table": self.supply}, set(), ("connects",)),
            faults=wrong,
            seeds=self.seeds,
        )
        faulty = FaultyBusPeer if bus else FaultySerialPeer
        return faulty(model.build(setup), wrong, self.seeds.stream(name, "faults"))

    def make_bus(self, board):
        """Return the bus of the sensor."""
        return BoardBus(self.clock, self.peer) if board else SimulatedBus(self.clock, 400_000, [self.peer])

    def streaming(self, rate=None):
        """Return the bench with its sensor streaming."""
        self.sensor.start()
        self.sensor.begin(rate or self.chip.stream)
        return self

    def read(self, register, count=1):
        """Return registers; the number is as it is sent."""
        return bytes(self.bus.read_i2c_block_data(self.chip.die or self.chip.address, register, count))

    def rows(self, seconds, pause=1.0):
        """Drain for some time; a FIFO that the host reads is read before it overflows."""
        pause = min(pause, self.sensor.longest_pause) if self.chip.by_host else pause
        blocks = []
        for _ in range(round(seconds / pause)):
            self.clock.sleep(pause)
            blocks.append(self.sensor.drain())
        return np.concatenate(blocks)
