"""The simulated IIM-42652 against what is published of it: registers, FIFO, interrupt pin, start-up and faults."""

from __future__ import annotations

import numpy as np
import pytest

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.faulty import FaultyBusPeer
from hil.simulation.peers.iim42652 import MODEL
from hil.simulation.peers.lis3mdl import MODEL as MAGNETOMETER
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.plants.plant import Plant
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth, TruthError
from hil.wire.peer import Nack

ADDRESS = 0x68
MS = 1_000_000
SECOND = 1000 * MS
QUIET = {"white": ["0", "0", "0"], "flicker": ["0", "0", "0"], "random_walk": ["0", "0", "0"]}
WATERMARK, NEW_DATA = 0x04, 0x08
GYRO_ONLY = 0x06


class Table(Plant):
    """A turning table: 10 deg/s per second about z, and a die that warms by 1 K/s from 25 degC."""

    def __init__(self) -> None:
        signals = frozenset({"rate.x", "rate.y", "rate.z", "die", "supply"})
        super().__init__("table", 100 * MS, (0.0,), {"volts": 3.3}, signals)

    def step(self, state, inputs, dt):
        """Speed up."""
        return (state[0] + 10.0 * dt,)

    def signal(self, name, state, inputs, at):
        """Return one of the signals."""
        values = {"rate.x": 0.0, "rate.y": 0.0, "rate.z": state[0], "die": 25.0 + at, "supply": inputs["volts"]}
        return values[name]


class Bench:
    """A sensor on a clock, and short ways to its registers."""

    def __init__(self, *, truth=None, faults=(), connects=None) -> None:
        self.clock = VirtualClock()
        self.table = Table()
        self.table.follow(self.clock.now_ns)
        wrong = read_faults(faults, ("faults",), fault_kinds(MODEL))
        seeds = Seeds(11)
        setup = PeerSetup(
            instrument=InstrumentSpec(name="gyro", driver="any", address=ADDRESS),
            truth=Truth({**QUIET, **(truth or {})}, ("truth",)),
            connections=Connections(connects or {}, {"table": self.table}, set(), ("connects",)),
            faults=wrong,
            seeds=seeds,
        )
        self.peer = FaultyBusPeer(MODEL.build(setup), wrong, seeds.stream("gyro", "faults"))
        self.peer.attach(self.clock)
        self.edges = []
        self.peer.on_interrupt(lambda: self.edges.append(self.clock.now_ns()))

    def read(self, register, count=1):
        """Read registers."""
        self.peer.write(ADDRESS, bytes([register]))
        return self.peer.read(ADDRESS, count)

    def write(self, register, *values):
        """Write registers."""
        self.peer.write(ADDRESS, bytes([register, *values]))

    def wait(self, ns):
        """Let time pass."""
        self.clock.wait_until(self.clock.now_ns() + ns)

    def start(self, *, odr=8, scale=3, bandwidth=0x11, power=0x0C):
        """Start the gyroscope: 100 Hz, 250 deg/s by default."""
        self.write(0x4F, scale << 5 | odr)
        self.write(0x52, bandwidth)
        self.write(0x4E, power)

    def stream(self, *, watermark=0, config=GYRO_ONLY, sources=WATERMARK, mode=0x40):
        """Let samples go into the FIFO; pulses of INT1 are active high."""
        self.write(0x14, 0x03)
        self.write(0x64, 0x00)
        self.write(0x65, sources)
        self.write(0x5F, config)
        self.write(0x60, watermark & 0xFF, watermark >> 8)
        self.write(0x16, mode)

    def gyro(self):
        """Return the data registers of the gyroscope as counts."""
        return np.frombuffer(self.read(0x25, 6), ">i2").tolist()

    def count(self):
        """Return FIFO_COUNT."""
        return int.from_bytes(self.read(0x2E, 2), "big")

    def packets(self, count=None):
        """Take packets of one sensor out of the FIFO."""
        data = self.read(0x30, self.count() if count is None else 8 * count)
        return np.frombuffer(data, [("header", "u1"), ("gyro", ">i2", 3), ("temperature", "i1")])


def test_what_it_says_after_power_on():
    """Identity, reset values, and data that are invalid while both sensors are off."""
    bench = Bench()
    assert bench.read(0x75) == b"\x6f"
    assert bench.read(0x4C, 7) == bytes.fromhex("30 91 00 06 06 16 11")
    assert bench.read(0x54) == b"\x23"
    assert bench.read(0x64, 2) == b"\x10\x10"
    assert bench.read(0x1D, 14) == b"\x80\x00" * 7
    assert bench.read(0x2D) == b"\x10"
    assert bench.read(0x2D) == b"\x00"


def test_registers_stand_in_banks():
    """A bank hides the others; REG_BANK_SEL is in all of them."""
    bench = Bench()
    bench.write(0x76, 4)
    assert bench.read(0x76) == b"\x04"
    assert bench.read(0x75) == b"\x00"
    bench.write(0x77, 0x5A)
    assert bench.read(0x77) == b"\x5a"
    bench.write(0x76, 0)
    assert bench.read(0x77) == b"\x00"
    assert bench.read(0x75) == b"\x6f"


def test_a_soft_reset_brings_everything_back_and_takes_a_millisecond():
    """Nothing is acknowledged until it is over."""
    bench = Bench()
    bench.start()
    bench.write(0x76, 1)
    bench.write(0x76, 0)
    bench.write(0x11, 0x01)
    with pytest.raises(Nack):
        bench.read(0x75)
    bench.wait(MS)
    assert bench.read(0x4E, 2) == b"\x00\x06"
    assert bench.read(0x2D) == b"\x10"


@pytest.mark.parametrize(
    ("scale", "lsb"), list(enumerate((16.4, 32.8, 65.5, 131.0, 262.0, 524.3, 1048.6, 2097.2))), ids=str
)
def test_sensitivity_of_every_range(scale, lsb):
    """10 deg/s on x and -5 deg/s on z, in counts of each range."""
    bench = Bench(truth={"bias_x": ["10", "0", "0"], "bias_z": ["-5", "0", "0"]})
    bench.start(scale=scale)
    bench.wait(100 * MS)
    assert bench.gyro() == [round(10 * lsb), 0, round(-5 * lsb)]


def test_readings_stop_at_the_ends_of_the_range_and_are_never_the_invalid_number():
    """32767 counts either way."""
    bench = Bench(truth={"bias_x": ["3000", "0", "0"], "bias_y": ["-3000", "0", "0"]})
    bench.start()
    bench.wait(100 * MS)
    assert bench.gyro() == [32767, -32767, 0]


def test_the_gyroscope_takes_60_ms_to_start_and_150_ms_to_stop():
    """Until then every number is -32768."""
    bench = Bench()
    bench.start(odr=6)
    bench.wait(59 * MS)
    assert bench.gyro() == [-32768] * 3
    bench.wait(2 * MS)
    assert bench.gyro() == [0, 0, 0]
    bench.write(0x4E, 0x00)
    assert bench.read(0x1D, 14) == b"\x80\x00" * 7
    bench.wait(50 * MS)
    bench.write(0x4E, 0x0C)
    bench.wait(100 * MS + 59 * MS)
    assert bench.gyro() == [-32768] * 3
    bench.wait(2 * MS)
    assert bench.gyro() == [0, 0, 0]


def test_temperature_in_both_resolutions():
    """25 degC + counts/132.48 in the registers, 25 degC + counts/2.07 in the FIFO; a big-endian burst holds it all."""
    bench = Bench(truth={"temperature": "40", "temperature_offset": "0.5", "acceleration": ["0", "-1", "0.5"]})
    bench.start(power=0x0F)
    bench.wait(100 * MS)
    numbers = np.frombuffer(bench.read(0x1D, 14), ">i2").tolist()
    assert numbers == [round(15.5 * 132.48), 0, -2048, 1024, 0, 0, 0]
    bench.write(0x4C, 0x00)
    assert np.frombuffer(bench.read(0x1D, 14), "<i2").tolist() == numbers
    bench.write(0x4C, 0x30)
    bench.write(0x4E, 0x0C)
    bench.stream()
    bench.wait(30 * MS)
    assert bench.packets()["temperature"].tolist() == [round(15.5 * 2.07)] * 3


def test_physics_is_seen_at_the_instant_of_each_sample():
    """A table that speeds up, a warming die, errors of scale and axes: sample by sample."""
    truth = {
        "scale_z": ["0.01", "0.001", "0.0001"],
        "misalignment": ["0", "0.02", "0", "0", "0", "0"],
        "bias_z": ["1", "0.1", "0.01"],
    }
    bench = Bench(truth=truth, connects={"rate": "table.rate", "temperature": "table.die"})
    bench.stream()
    bench.start()
    bench.wait(SECOND)
    bench.packets()
    bench.wait(200 * MS)
    at = 1.0 + 0.01 * np.arange(1, 21)
    rate = 10 * at
    expected = rate * (1.01 + 0.001 * at + 0.0001 * at**2) + 1 + 0.1 * at + 0.01 * at**2
    packets = bench.packets()
    assert packets["gyro"][:, 2].tolist() == pytest.approx(expected * 131.0, abs=0.51)
    assert packets["gyro"][:, 0].tolist() == pytest.approx(0.02 * rate * 131.0, abs=0.51)
    assert bench.gyro() == packets["gyro"][-1].tolist()


def test_packets_of_one_sensor():
    """Eight bytes: header 20h, three axes, temperature; FIFO_COUNT in bytes, then in packets, then little-endian."""
    bench = Bench(truth={"bias_x": ["1", "0", "0"], "bias_y": ["-2", "0", "0"]})
    bench.start()
    bench.wait(100 * MS)
    bench.stream()
    bench.wait(30 * MS)
    assert bench.read(0x2E, 2) == b"\x00\x18"
    bench.write(0x4C, 0x70)
    assert bench.read(0x2E, 2) == b"\x00\x03"
    bench.write(0x4C, 0x50)
    assert bench.read(0x2E, 2) == b"\x03\x00"
    assert bench.read(0x30, 8).hex(" ") == "20 00 83 fe fa 00 00 00"
    assert bench.read(0x2E, 2) == b"\x02\x00"


def test_packets_of_both_sensors():
    """Sixteen bytes: header 68h, accelerometer, gyroscope, temperature, time stamp in us."""
    bench = Bench(truth={"bias_x": ["1", "0", "0"]})
    bench.start(power=0x0F)
    bench.wait(100 * MS)
    bench.stream(config=0x0F)
    bench.wait(20 * MS)
    assert bench.count() == 32
    packet = bench.read(0x30, 16)
    assert packet[:14].hex(" ") == "68 00 00 00 00 08 00 00 83 00 00 00 00 00"
    assert int.from_bytes(packet[14:], "big") == 110_000 % 65536


def test_a_burst_goes_from_the_counter_on_and_stays_in_the_fifo():
    """INT_STATUS, FIFO_COUNT and packets in one read; after the last packet there is FFh."""
    bench = Bench()
    bench.start()
    bench.stream()
    bench.wait(20 * MS)
    data = bench.read(0x2D, 3 + 16 + 8)
    assert data[0] == 0x10 | 0x08
    assert data[1:3] == b"\x00\x10"
    assert data[3] == data[11] == 0x20
    assert data[19:] == b"\xff" * 8


def test_a_packet_that_was_read_in_part():
    """It comes again as a whole, or goes on where reads may resume."""
    bench = Bench(truth={"bias_x": ["1", "0", "0"]})
    bench.start()
    bench.stream()
    bench.wait(90 * MS)
    bench.packets()
    bench.wait(20 * MS)
    assert bench.read(0x30, 5).hex() == "2000830000"
    assert bench.read(0x30, 3).hex() == "200083"
    assert bench.count() == 16
    bench.write(0x5F, GYRO_ONLY | 0x40)
    assert bench.read(0x30, 5).hex() == "2000830000"
    assert bench.read(0x30, 3).hex() == "000000"
    assert bench.count() == 8


@pytest.mark.parametrize(("mode", "first"), [(0x40, 44), (0x80, 0)], ids=["stream", "stop-on-full"])
def test_an_overflowing_fifo_counts_what_it_lost(mode, first):
    """In stream mode the oldest go, else the newest; 256 packets stay, and a flush forgets."""
    bench = Bench(connects={"rate": "table.rate"})
    bench.start()
    bench.wait(100 * MS)
    bench.stream(mode=mode)
    bench.wait(3 * SECOND)
    assert bench.count() == 2048
    assert bench.read(0x6C, 2) == (44).to_bytes(2, "little")
    assert bench.read(0x2D)[0] & 0x02
    z = bench.packets()["gyro"][:, 2] / 131.0
    assert z[0] == pytest.approx(10 * (0.11 + 0.01 * first), abs=0.01)
    assert z[-1] == pytest.approx(10 * (0.11 + 0.01 * (first + 255)), abs=0.01)
    bench.wait(20 * MS)
    bench.write(0x4B, 0x02)
    assert bench.count() == 0
    assert bench.read(0x6C, 2) == b"\x00\x00"


def test_the_watermark_interrupt_comes_with_the_sample_that_fills_it():
    """Fifty packets every half second, whether the level is in bytes or in packets."""
    for level, config in ((400, 0x30), (50, 0x70)):
        bench = Bench()
        bench.write(0x4C, config)
        bench.start()
        bench.stream(watermark=level)
        for number in range(1, 5):
            bench.wait(500 * MS)
            assert bench.edges == [500 * MS * turn for turn in range(1, number + 1)]
            assert bench.read(0x2D)[0] & WATERMARK
            assert len(bench.packets(50)) == 50


def test_a_watermark_that_nobody_serves_comes_once():
    """With FIFO_WM_GT_TH it comes at every sample instead."""
    bench = Bench()
    bench.start()
    bench.stream(watermark=400)
    bench.wait(530 * MS)
    assert bench.edges == [500 * MS]
    other = Bench()
    other.start()
    other.stream(watermark=400, config=GYRO_ONLY | 0x20)
    other.wait(530 * MS)
    assert other.edges == [500 * MS, 510 * MS, 520 * MS, 530 * MS]


def test_the_sensors_own_oscillator_makes_the_instants():
    """A rate 1 % too high brings the watermark 1 % earlier, and the time stamp counts faster."""
    bench = Bench(truth={"odr_error": "0.01"})
    bench.start()
    bench.stream(watermark=400)
    bench.wait(SECOND)
    assert bench.edges == [round(500 * MS / 1.01)]
    bench.write(0x4B, 0x04)
    bench.write(0x76, 1)
    assert int.from_bytes(bench.read(0x62, 3), "little") == 1_010_000


def test_kinds_of_interrupt_pin():
    """Active low rises at the pulse's end; latched waits for the status; uncleared INT_ASYNC_RESET keeps it still."""
    for register, value, edges in ((0x14, 0x02, [10_100_000, 20_100_000]), (0x14, 0x07, [10 * MS]), (0x64, 0x10, [])):
        bench = Bench()
        bench.start()
        bench.stream(sources=NEW_DATA)
        bench.write(register, value)
        bench.wait(25 * MS)
        assert bench.edges == edges
    latched = Bench()
    latched.start()
    latched.stream(sources=NEW_DATA)
    latched.write(0x14, 0x07)
    latched.wait(15 * MS)
    assert latched.read(0x2D) == bytes([0x10 | NEW_DATA])
    latched.wait(10 * MS)
    assert latched.edges == [10 * MS, 20 * MS]


def test_noise_follows_the_filter():
    """The rms of samples is N sqrt(2 BW), BW the filter's noise bandwidth, whatever the rate of samples is."""
    sigmas = {}
    for code, cut_off in ((0x10, 50.0), (0x11, 100.0), (0x16, 20.0)):
        bench = Bench(truth={"white": ["0.01", "0.01", "0.01"]})
        bench.write(0x51, 0x1A)  # third order
        bench.stream()
        bench.start(bandwidth=code)
        bench.wait(100 * MS)
        bench.packets()
        rows = []
        for _ in range(20):
            bench.wait(2 * SECOND)
            rows.append(bench.packets()["gyro"])
        sigmas[code] = np.std(np.concatenate(rows), axis=0) / 131.0
        expected = np.hypot(0.01 * np.sqrt(2 * 1.0472 * cut_off), 1 / 131.0 / np.sqrt(12))
        assert sigmas[code] == pytest.approx([expected] * 3, rel=0.06)


def test_samples_do_not_depend_on_who_reads_and_when():
    """The FIFO holds the same bytes, however often registers and counters are read in between."""
    streams = []
    for pauses in ([500] * 6, [7, 3, 90, 400, 1, 499] * 3, [1000] * 3):
        bench = Bench(truth={"white": ["0.1"] * 3}, connects={"rate": "table.rate", "temperature": "table.die"})
        bench.start()
        bench.stream(watermark=80)
        taken = b""
        for pause in pauses:
            bench.wait(pause * MS)
            bench.gyro()
            taken += bench.read(0x30, bench.count())
        streams.append(taken)
    assert len(streams[0]) == 300 * 8
    assert streams[0] == streams[1] == streams[2]


def test_power():
    """Below 1.71 V there is nobody; power brings the reset values after the boot time."""
    bench = Bench(connects={"power": "table.supply"}, truth={"boot_time": "0.01"})
    bench.wait(10 * MS)
    bench.start()
    bench.table.command(volts=1.0)
    with pytest.raises(Nack):
        bench.read(0x75)
    bench.wait(SECOND)
    bench.table.command(volts=3.3)
    with pytest.raises(Nack):
        bench.read(0x75)
    bench.wait(10 * MS)
    assert bench.read(0x4E) == b"\x00"


def test_faults_of_its_own():
    """Another identity; a rate beyond the range; a temperature that is no temperature."""
    faults = [
        {"kind": "identity", "value": "0x47", "until": "1 s"},
        {"kind": "saturated", "from": "1 s", "until": "2 s"},
        {"kind": "temperature-raw", "from": "2 s"},
    ]
    bench = Bench(faults=faults)
    assert bench.read(0x75) == b"\x47"
    bench.start()
    bench.wait(SECOND)
    assert bench.read(0x75) == b"\x6f"
    bench.wait(10 * MS)
    assert bench.gyro() == [32767] * 3
    assert bench.read(0x1D, 2) == b"\x00\x00"
    bench.wait(SECOND)
    assert bench.gyro() == [0, 0, 0]
    assert int.from_bytes(bench.read(0x1D, 2), "big") == 24_000


def test_a_stuck_sensor_repeats_its_last_sample():
    """In registers and FIFO alike, until it is over."""
    bench = Bench(truth={"white": ["1", "1", "1"]}, faults=[{"kind": "stuck", "from": "1 s", "until": "2 s"}])
    bench.start()
    bench.stream()
    bench.wait(995 * MS)
    last = bench.gyro()
    bench.packets()
    bench.wait(990 * MS)
    gyro = bench.packets()["gyro"].tolist()
    assert gyro == [last] * 99
    assert bench.gyro() == last
    bench.wait(SECOND)
    assert bench.gyro() != last


def test_a_sensor_that_falls_asleep_forgets_its_settings_and_cannot_be_woken():
    """It answers, and its numbers are invalid; streams end without a word."""
    bench = Bench(faults=[{"kind": "asleep", "from": "1 s", "until": "3 s"}])
    bench.start()
    bench.stream(watermark=80)
    for _ in range(20):
        bench.wait(100 * MS)
        bench.packets()
    assert max(bench.edges) < SECOND
    assert bench.read(0x4E, 2) == b"\x00\x06"
    bench.start()
    bench.wait(500 * MS)
    assert bench.gyro() == [-32768] * 3
    bench.wait(SECOND)
    bench.start()
    bench.wait(SECOND)
    assert bench.gyro() == [0, 0, 0]


def test_a_dead_sensor_has_no_interrupts():
    """Without power the pin is still."""
    bench = Bench(faults=[{"kind": "dead", "from": "15 ms", "until": "35 ms"}])
    bench.start()
    bench.stream(sources=NEW_DATA)
    bench.wait(45 * MS)
    assert bench.edges == [10 * MS, 40 * MS]


def test_a_device_without_a_pin_has_no_interrupts():
    """Whoever listens to it hears nothing."""
    setup = PeerSetup(
        instrument=InstrumentSpec(name="mag", driver="any", address=0x1C),
        truth=Truth({}, ("truth",)),
        connections=Connections({}, {}, set(), ()),
    )
    edges = []
    peer = FaultyBusPeer(MAGNETOMETER.build(setup), setup.faults, setup.stream("faults"))
    peer.attach(VirtualClock())
    peer.on_interrupt(lambda: edges.append(1))
    assert peer.read(0x1C, 1)
    assert not edges


def test_what_cannot_be_is_refused():
    """A wrong address, a wrong identity, negative noise."""
    with pytest.raises(TruthError, match="must be at least 0"):
        Bench(truth={"white": ["-1", "0", "0"]})
    with pytest.raises(TruthError, match="must be a hexadecimal number"):
        Bench(faults=[{"kind": "identity", "value": "gyro"}])
    setup = PeerSetup(
        instrument=InstrumentSpec(name="gyro", driver="any", address=0x1C),
        truth=Truth({}, ("truth",)),
        connections=Connections({}, {}, set(), ()),
    )
    with pytest.raises(TruthError, match="0x68 or 0x69"):
        MODEL.build(setup)
