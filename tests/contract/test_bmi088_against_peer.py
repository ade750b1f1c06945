"""The BMI088: its peer against the data sheet, and what is its driver's alone: two dies with a name each."""

from __future__ import annotations

import struct

import pytest
from sensor_bench import BMI088, Bench

from hil.analysis.noise.rate_noise import RateNoise
from hil.instruments.driver import Strap
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import Refused, WrongIdentity
from hil.simulation.peers.bmi088 import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.truth import Truth, TruthError

ACC, GYRO = 0x18, 0x68
QUIET = {kind: ["0", "0", "0"] for kind in ("white", "flicker", "random_walk")}


def made(**truth):
    """Return a peer without noise on its bus, a little after power-on."""
    return Bench(BMI088, truth=QUIET | {"accelerometer": {"white": ["0", "0", "0"]}} | truth)


def get(bench, die, register, count=1):
    """Read registers of a die."""
    return bytes(bench.bus.read_i2c_block_data(die, register, count))


def put(bench, die, **values):
    """Write registers of a die: `put(bench, ACC, x7C=0)`."""
    for register, value in values.items():
        bench.bus.write_byte_data(die, int(register[1:], 16), value)


def resume(bench):
    """Let the accelerometer measure, at 24 g."""
    put(bench, ACC, x7C=0x00, x7D=0x04, x41=0x03)
    bench.clock.sleep(0.05)


def test_the_accelerometer_is_suspended_after_power_on():
    """Its temperature is 8000h, which stands for none, and its axes are 0; it goes back there with a soft reset."""
    bench = made()
    assert get(bench, ACC, 0x00) + get(bench, ACC, 0x7C, 2) == b"\x1e\x03\x00"
    assert (get(bench, ACC, 0x12, 6), get(bench, ACC, 0x22, 2)) == (bytes(6), b"\x80\x00")
    resume(bench)
    assert struct.unpack("<hhh", get(bench, ACC, 0x12, 6)) == (0, 0, 1365)
    put(bench, ACC, x7E=0xB6)
    bench.clock.sleep(0.002)
    assert get(bench, ACC, 0x22, 2) == b"\x80\x00"


@pytest.mark.parametrize(
    ("degrees", "code"),
    [(23.0, "0000"), (23.125, "0020"), (22.875, "ffe0"), (85.0, "3e00"), (-40.0, "c100"), (25.0, "0200")],
)
def test_a_temperature_is_eleven_bits_at_the_upper_end(degrees, code):
    """Eighths of a kelvin from 23 degC, the high byte first; the vendor's driver: MSB * 8 + LSB / 32."""
    bench = made(temperature=str(degrees))
    resume(bench)
    assert get(bench, ACC, 0x22, 2).hex() == code


@pytest.mark.parametrize(("code", "per_degree"), [(code, 16.384 * 2**code) for code in range(5)])
def test_rates_have_the_sensitivity_of_the_data_sheet(code, per_degree):
    """The gyroscope runs after power-on, and rests in suspend mode; the top bit of the bandwidth reads as 1."""
    bench = made(bias_x=["100", "0", "0"], bias_z=["-3", "0", "0"])
    put(bench, GYRO, x0F=code, x10=0x07)
    bench.clock.sleep(0.02)
    assert get(bench, GYRO, 0x10) == b"\x87"
    expected = (round(100 * per_degree), 0, round(-3 * per_degree))
    assert struct.unpack("<hhh", get(bench, GYRO, 0x02, 6)) == expected
    put(bench, GYRO, x11=0x80)
    bench.clock.sleep(0.02)
    assert get(bench, GYRO, 0x02, 6) == bytes(6)


def test_the_fifo_counts_a_hundred_frames_and_then_says_that_it_lost_some():
    """Writing FIFO_CONFIG_1 empties it and takes the flag away; reading does not."""
    bench = made(bias_y=["1", "0", "0"])
    put(bench, GYRO, x10=0x07, x3E=0x80)
    bench.clock.sleep(0.995)
    assert get(bench, GYRO, 0x0E) == bytes([99])
    bench.clock.sleep(0.02)
    assert get(bench, GYRO, 0x0E) == bytes([0x80 | 100])
    assert get(bench, GYRO, 0x3F, 12) == struct.pack("<hhh", 0, 16, 0) * 2
    assert get(bench, GYRO, 0x0E) == bytes([0x80 | 98])
    put(bench, GYRO, x3E=0x80)
    assert get(bench, GYRO, 0x0E) == b"\x00"


def test_axes_that_nobody_reads_are_not_made(monkeypatch):
    """Identity, status, temperature and sleep need none of them, however long the dies have run."""
    bench = Bench(BMI088)
    resume(bench)

    def made_all_the_same(*_):
        raise AssertionError("samples of an axis were made")

    with monkeypatch.context() as patched:
        patched.setattr(RateNoise, "samples", made_all_the_same)
        bench.clock.sleep(3600.0)
        assert (get(bench, GYRO, 0x00), get(bench, GYRO, 0x0A), get(bench, ACC, 0x22, 2)) == (
            b"\x0f",
            b"\x80",
            b"\x02\x00",
        )
        put(bench, GYRO, x11=0x80)
        put(bench, ACC, x7D=0x00)
    assert get(bench, GYRO, 0x02, 6) + get(bench, ACC, 0x12, 6) == bytes(12)


def test_what_was_measured_before_a_setting_has_the_old_one():
    """Until the first new sample, data registers show the last of the old range, read before or not."""
    bench = made(bias_x=["100", "0", "0"])
    put(bench, GYRO, x10=0x07)
    bench.clock.sleep(0.05)
    put(bench, GYRO, x0F=0x04)
    assert struct.unpack("<hhh", get(bench, GYRO, 0x02, 6))[0] == round(100 * 16.384)
    bench.clock.sleep(0.02)
    assert struct.unpack("<hhh", get(bench, GYRO, 0x02, 6))[0] == round(100 * 262.144)


def test_what_is_at_the_addresses():
    """Both dies are identified, and each address can be one of two."""
    assert BMI088.driver.straps() == (Strap("SDO1", (0x18, 0x19)), Strap("SDO2", (0x68, 0x69)))
    bench = Bench(BMI088)
    bench.driver._dies[False].address = 0x68
    with pytest.raises(WrongIdentity, match="ACC_CHIP_ID is 0x0f at address 0x68, the BMI088 has 0x1e.*SDO1"):
        bench.sensor.start()
    with pytest.raises(Refused, match="'bandwidth' must be 12 or 32 Hz at 100 Hz"):
        bench.driver.role(Wire(role="gyroscope", instrument="sensor", settings={"bandwidth": "64 Hz"}))
    spec = InstrumentSpec(name="imu", driver="bmi088", address=0x18, second_address=0x10)
    setup = PeerSetup(instrument=spec, truth=Truth({}, ()), connections=Connections({}, {}, set(), ()))
    with pytest.raises(TruthError, match="the BMI088 answers at 0x68 or 0x69, not at 0x10"):
        MODEL.build(setup)
