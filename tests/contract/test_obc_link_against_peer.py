"""The driver of the OBC link against the simulated board: both are written from the page, and share nothing else."""

from __future__ import annotations

import errno
from contextlib import contextmanager
from itertools import pairwise

import pytest
from obc_page import Sensor

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.obc_link.driver import ObcLink
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import DeviceFault, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.faults import read_faults
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.peers.obc_link.board import MODEL
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth
from hil.wire.exchange import publish_stream, withdraw
from hil.wire.opening import open_port
from hil.wire.simulated_line import SimulatedLine
from hil.wire.streaming import FifoRead, RegisterRead
from hil.wire.transcript import Transcript

URL = "sim://obc-contract/"
FIFO = FifoRead(address=0x68, count_register=0x2E, unit=1, record=8, data_register=0x30, most=1024)
TEMPERATURE = RegisterRead(address=0x68, register=0x1D, length=2)


class Bench:
    """A driver, its bus, and what is behind: the clock, the line, the board, a sensor whose pin a test pulls."""

    def __init__(self, truth, faults):
        self.clock = VirtualClock()
        self.sensor = Sensor()
        self.sensor.attach(self.clock)
        wrong = read_faults(faults, ("faults",), fault_kinds(MODEL))
        spec = InstrumentSpec(name="obc", driver="obc-link", baud=921_600)
        self.board = MODEL.build(
            PeerSetup(
                instrument=spec,
                truth=Truth(truth or {}, ("truth",)),
                connections=Connections({}, {}, set(), ("connects",)),
                faults=wrong,
                seeds=Seeds(1),
            )
        )
        peer = FaultySerialPeer(self.board, wrong, Seeds(1).stream("obc", "faults"))
        peer.serve([self.sensor])
        self.line = SimulatedLine("obc", peer, self.clock, baud=921_600, buffer=65_536)
        peer.attach(self.line, self.clock)
        publish_stream(f"{URL}obc", self.line)
        self.port = open_port("obc", f"{URL}obc", self.clock, Transcript(None), baud=921_600)
        self.driver = ObcLink(Connection(device="obc", clock=self.clock, clamps=Clamps(), port=self.port))
        self.bus = self.driver.bus(400_000)

    def pulses(self, period_s, count, size):
        """Let the sensor fill its FIFO with `size` bytes and pulse its pin, over and over; return the instants."""
        instants = [self.clock.now_ns() + round((number + 1) * period_s * 1e9) for number in range(count)]

        def fill(number):
            self.sensor.fifo += bytes([number % 256]) * size
            self.sensor.pull()

        for number, at_ns in enumerate(instants):
            self.clock.at(at_ns, lambda number=number: fill(number))
        return instants

    def drained(self, stream, seconds, pause=0.5):
        """Fetch frames every `pause`, and return all of them."""
        frames = []
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.clock.sleep(pause)
            frames += stream.frames()
        return frames


@contextmanager
def facing(truth=None, faults=()):
    """Yield a bench, and free its URL."""
    bench = Bench(truth, faults)
    try:
        yield bench
    finally:
        bench.port.close()
        withdraw(URL)


def test_identity():
    """Firmware, version and chip, as the board says them."""
    with facing({"firmware": "1.2.3", "unique_id": "00112233445566778899aabb"}) as bench:
        identity = bench.driver.identify()
        assert isinstance(identity, Identity)
        assert (identity.model, identity.firmware) == ("hil-obc", identity.firmware)
        assert "1.2.3" in identity.firmware
        assert identity.serial.lower() == "00112233445566778899aabb"
        assert list(bench.driver.outlets()) == []


def test_the_whole_role():
    """What the board says of itself, and the voltage of an open input."""
    with facing({"analog_noise": "0"}) as bench:
        role = bench.driver.role(Wire(role="obc", instance="", instrument="obc"))
        assert b"SIMULATE".hex() in role.identify().lower()
        figure = role.analog(0)
        assert (figure.value, figure.unit) == (0.0, "V")


def test_named_inputs_are_sampled_in_counts():
    """Means of raw conversions, in the order of the inputs; reference and full scale as the board states them."""
    with facing({"analog_noise": "0", "reference": "3.2968"}) as bench:
        wire = Wire(role="obc", instance="", instrument="obc", settings={"a1": "monitor", "a4": "photodiode"})
        role = bench.driver.role(wire)
        assert [(channel.name, channel.unit) for channel in role.channels()] == [
            ("monitor", "LSB"),
            ("photodiode", "LSB"),
        ]
        assert role.sample() == (0.0, 0.0)
        assert (role.full_scale().value, role.reference().value) == (4095.0, 3.297)
        plain = bench.driver.role(Wire(role="obc", instance="", instrument="obc"))
        with pytest.raises(Refused, match="no analogue input is named"):
            plain.sample()
        alike = Wire(role="obc", instance="", instrument="obc", settings={"a0": "same", "a1": "same"})
        with pytest.raises(Refused, match="two inputs have one name"):
            bench.driver.role(alike)


def test_every_way_of_a_transfer():
    """Byte, word and block, read and written, arrive at the sensor as they are."""
    with facing() as bench:
        bus, sensor = bench.bus, bench.sensor
        sensor.registers[0x10] = bytes(range(40))
        assert bus.read_byte_data(0x68, 0x75) == 0x6F
        assert bus.read_byte(0x68) == 0x6F
        assert bus.read_word_data(0x68, 0x10) == 0x0100
        assert bus.read_i2c_block_data(0x68, 0x10, 32) == list(range(32))
        bus.write_byte_data(0x68, 0x4E, 0x0F)
        bus.write_word_data(0x68, 0x20, 0x1234)
        bus.write_i2c_block_data(0x68, 0x30, [1, 0, 2])
        bus.write_byte(0x68, 0x75)
        assert sensor.written[-4:] == [b"\x4e\x0f", b"\x20\x34\x12", b"\x30\x01\x00\x02", b"\x75"]


def test_combined_messages_of_smbus2():
    """`i2c_rdwr` runs them with repeated starts and fills the reads."""
    smbus2 = pytest.importorskip("smbus2")
    with facing() as bench:
        bench.sensor.registers[0x10] = bytes(range(1, 101))
        write, read = smbus2.i2c_msg.write(0x68, [0x10]), smbus2.i2c_msg.read(0x68, 100)
        bench.bus.i2c_rdwr(write, read)
        assert bytes(read) == bytes(range(1, 101))


def test_nobody_acknowledges():
    """That is the device's fault, not the link's: the same OSError as on a bus of the host."""
    faults = [{"kind": "nack", "address": "0x68", "from": "1 s", "until": "2 s"}]
    with facing(faults=faults) as bench:
        with pytest.raises(OSError, match="0x1c") as caught:
            bench.bus.read_byte(0x1C)
        assert caught.value.errno == errno.EREMOTEIO
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F
        bench.clock.wait_until(1_100_000_000)
        with pytest.raises(OSError, match="0x68"):
            bench.bus.read_byte_data(0x68, 0x75)
        bench.clock.wait_until(2_100_000_000)
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F


def test_a_stream_by_the_interrupt_line():
    """Every frame with the board's time of the edge, whole, in order, and a summary without losses."""
    with facing({"clock_offset": "77"}) as bench:
        bench.sensor.registers[0x1D] = b"\x01\x05"
        stream = bench.bus.start_stream([TEMPERATURE, FIFO], line=0)
        instants = bench.pulses(0.5, 40, 400)
        frames = bench.drained(stream, 21)
        assert [frame.number for frame in frames] == list(range(40))
        assert [frame.device_s for frame in frames] == pytest.approx([77 + at / 1e9 for at in instants], abs=2e-6)
        assert all(frame.replies == (b"\x01\x05", bytes([frame.number]) * 400) for frame in frames)
        summary = stream.stop()
        assert (summary.frames, summary.lost) == (40, 0)


def test_a_stream_by_the_timer():
    """The period is the board's: a clock 100 ppm fast gives frames 100 ppm sooner, at even device times."""
    with facing({"clock_drift": "0.0001"}) as bench:
        stream = bench.bus.start_stream([TEMPERATURE], period_s=0.25)
        frames = bench.drained(stream, 20)
        steps = [after.device_s - before.device_s for before, after in pairwise(frames)]
        assert steps == pytest.approx([0.25] * len(steps), abs=1e-9)
        assert 79 <= len(frames) <= 81
        stream.stop()


@pytest.mark.parametrize("drift", [1e-4, -1e-4, 0.0])
def test_drift_is_estimated_within_its_uncertainty(drift):
    """Ten minutes of a stream tell 100 ppm to well below one, and the truth lies within three uncertainties."""
    with facing({"clock_drift": str(drift), "clock_offset": "1000"}) as bench:
        stream = bench.bus.start_stream([TEMPERATURE], period_s=1.0)
        bench.drained(stream, 600, pause=1.0)
        summary = stream.stop()
        assert summary.drift_uncertainty is not None
        assert 0 < summary.drift_uncertainty < 1e-6
        assert abs(summary.drift - drift) <= 3 * summary.drift_uncertainty
        shown = 1000 + bench.clock.now() * (1 + drift)
        assert bench.clock.now() - shown == pytest.approx(summary.offset_s, abs=2e-3)


def test_frames_lost_on_the_line_and_in_the_board():
    """Both are counted, the board's by its own counter; what came is in order."""
    faults = [
        {"kind": "lose-frames", "from": "2 s", "frames": "3"},
        {"kind": "stall", "from": "5 s", "until": "9 s"},
    ]
    with facing({"ring": "4096"}, faults) as bench:
        stream = bench.bus.start_stream([RegisterRead(address=0x68, register=0, length=500)], period_s=0.1)
        frames = bench.drained(stream, 12, pause=0.2)
        summary = stream.stop()
        frames += stream.frames()
        numbers = [frame.number for frame in frames]
        missing = set(range(numbers[-1] + 1)) - set(numbers)
        assert numbers == sorted(set(numbers))
        assert frames[-1].lost == len(missing) - 3 > 20
        assert (summary.frames, summary.lost) == (len(frames), len(missing))


def test_a_sensor_that_stops_acknowledging_in_a_stream():
    """Its replies are None for as long as it lasts, and the stream goes on."""
    faults = [{"kind": "nack", "address": "0x68", "from": "1 s", "until": "2 s"}]
    with facing(faults=faults) as bench:
        stream = bench.bus.start_stream([TEMPERATURE], period_s=0.1)
        frames = bench.drained(stream, 3)
        gone = [frame.number for frame in frames if frame.replies == (None,)]
        assert len(gone) == 10
        assert gone == list(range(gone[0], gone[0] + 10))
        assert frames[-1].replies == (b"\0\0",)
        stream.stop()


def test_transfers_while_a_stream_runs():
    """Requests pass frames by; nothing is lost on either way."""
    with facing() as bench:
        stream = bench.bus.start_stream([RegisterRead(address=0x68, register=0x75, length=1000)], period_s=0.05)
        frames = []
        for _ in range(100):
            assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F
            bench.clock.sleep(0.02)
            frames += stream.frames()
        summary = stream.stop()
        frames += stream.frames()
        assert summary.lost == 0
        assert [frame.number for frame in frames] == list(range(summary.frames))


def test_a_reset_during_a_stream():
    """It is told as the board's fault, once; the next transfer meets the board again, at the bus's own speed."""
    with facing(faults=[{"kind": "reset", "from": "3 s"}]) as bench:
        stream = bench.bus.start_stream([TEMPERATURE], period_s=0.1)
        with pytest.raises(DeviceFault) as caught:
            bench.drained(stream, 10)
        assert caught.value.device == "obc"
        assert 3 < bench.clock.now() < 4
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F
        assert bench.board._bus.frequency_hz == 400_000


def test_a_program_that_the_board_cannot_run():
    """The board's refusal is told."""
    with facing() as bench, pytest.raises(Rejected):
        bench.bus.start_stream([FIFO, FIFO], line=0)


def test_a_host_that_is_gone_leaves_no_stream():
    """The board falls silent by its watchdog."""
    with facing() as bench:
        bench.bus.start_stream([TEMPERATURE], period_s=0.1)
        bench.clock.sleep(120)
        assert not bench.board._stream.running


@pytest.mark.parametrize("kind", ["garbled", "partial"])
def test_damage_on_the_way(kind):
    """For a while nothing usable comes: a fault of the board within bounded time. Afterwards all is well."""
    more = {"bytes": "4"} if kind == "partial" else {}
    with facing(faults=[{"kind": kind, "from": "1 s", "until": "3 s", **more}]) as bench:
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F
        bench.clock.wait_until(1_000_000_000)
        with pytest.raises(DeviceFault):
            bench.bus.read_byte_data(0x68, 0x75)
        assert bench.clock.now() < 2.2
        bench.clock.wait_until(3_100_000_000)
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F


def test_a_little_damage_costs_no_request():
    """One byte in three hundred is hit: requests are repeated, none is executed twice, none is lost."""
    with facing(faults=[{"kind": "garbled", "share": "0.003"}]) as bench:
        for number in range(300):
            bench.bus.write_byte_data(0x68, 0x20, number % 256)
        assert bench.driver.session.repeated > 0
        assert bench.sensor.written == [bytes([0x20, number % 256]) for number in range(300)]


def test_damaged_stream_frames_are_lost_and_counted():
    """What cannot be trusted is no frame; the numbers tell how many."""
    with facing(faults=[{"kind": "garbled", "share": "0.001", "from": "1 s"}]) as bench:
        stream = bench.bus.start_stream([RegisterRead(address=0x68, register=0x75, length=100)], period_s=0.1)
        frames = bench.drained(stream, 30)
        summary = stream.stop()
        frames += stream.frames()
        assert all(frame.replies == (b"\x6f".ljust(100, b"\0"),) for frame in frames)
        missing = set(range(summary.frames + summary.lost)) - {frame.number for frame in frames}
        assert summary.lost == len(missing) > 5


@pytest.mark.parametrize("by", ["50 ms", "150 ms"])
def test_late_replies_are_waited_for_or_dropped(by):
    """A late copy never becomes the answer to another question."""
    with facing(faults=[{"kind": "late", "by": by, "from": "1 s", "until": "1500 ms"}]) as bench:
        bench.sensor.registers.update({number: bytes([number]) for number in range(0x10, 0x20)})
        bench.clock.wait_until(900_000_000)
        for _ in range(4):
            for number in range(0x10, 0x20):
                assert bench.bus.read_byte_data(0x68, number) == number
                bench.clock.sleep(0.01)


def test_a_dead_board():
    """No reply within bounded time; the board is to blame."""
    with facing(faults=[{"kind": "dead", "from": "1 s", "until": "2 s"}]) as bench:
        bench.driver.identify()
        bench.clock.wait_until(1_000_000_000)
        with pytest.raises(NoReply) as caught:
            bench.bus.read_byte_data(0x68, 0x75)
        assert caught.value.device == "obc"
        assert bench.clock.now() < 2
        bench.clock.wait_until(2_100_000_000)
        assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F


def test_bytes_that_nobody_asked_for():
    """Chatter between the frames does no harm."""
    with facing(faults=[{"kind": "chatty", "every": "7 ms", "text": "?!"}]) as bench:
        for _ in range(50):
            assert bench.bus.read_byte_data(0x68, 0x75) == 0x6F
