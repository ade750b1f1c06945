"""What is peculiar to the BNO055: modes and their switching times, pages, units, and a clock that it holds."""

from __future__ import annotations

import pytest
from behind_obc import BehindObc
from sensor_bench import BNO055, BNO055_ACCELEROMETER, BNO055_MAGNETOMETER, Bench

from hil.model.bench import Wire
from hil.model.errors import Garbled

SECOND = 1_000_000_000
MAGGYRO, AMG = 0x06, 0x07
BOTH = pytest.mark.parametrize("kind", [Bench, BehindObc], ids=["own bus", "obc"])
EVERY = pytest.mark.parametrize("chip", [BNO055, BNO055_ACCELEROMETER, BNO055_MAGNETOMETER], ids=lambda chip: chip.role)


def write(bench, register, value):
    """Write one register."""
    bench.bus.write_byte_data(0x28, register, value)


def test_it_is_silent_for_650_ms_and_then_in_configmode():
    """Four names, no data, nothing on page 1 but settings; the driver waits for it."""
    bench = Bench(BNO055)
    bench.supply.command(volts=0.0)
    bench.supply.command(volts=3.3)
    with pytest.raises(OSError, match="Remote I/O error"):
        bench.read(0x00)
    began = bench.clock.now()
    bench.sensor.start()
    assert 0.65 < bench.clock.now() - began < 0.85
    bench = Bench(BNO055)
    assert (bench.read(0x00, 4), bench.read(0x08, 18), bench.read(0x39)) == (b"\xa0\xfb\x32\x0f", bytes(18), b"\x00")
    write(bench, 0x07, 1)
    assert (bench.read(0x07, 4), bench.read(0x00)) == (b"\x01\x0d\x6d\x38", b"\x00")


def test_modes_take_their_time_and_settings_only_configmode():
    """7 ms to a mode, 19 ms back; what is written in between or outside of CONFIGMODE does not count."""
    bench = Bench(BNO055, truth={"accelerometer": {"white": ["0"] * 3}})
    write(bench, 0x3D, AMG)
    write(bench, 0x3B, 0x10)
    bench.clock.sleep(0.0065)
    assert bench.read(0x3D) == b"\x00"
    bench.clock.sleep(0.001)
    write(bench, 0x3B, 0x10)
    assert (bench.read(0x3D), bench.read(0x3B), bench.read(0x39)) == (b"\x07", b"\x80", b"\x06")
    bench.clock.sleep(0.2)
    assert bench.read(0x0C, 2) == (981).to_bytes(2, "little")
    write(bench, 0x3D, 0)
    bench.clock.sleep(0.018)
    assert bench.read(0x3D) == b"\x07"
    bench.clock.sleep(0.0015)
    assert (bench.read(0x3D), bench.read(0x08, 18)) == (b"\x00", bytes(18))


@pytest.mark.parametrize(
    ("units", "rate", "acceleration", "temperature"),
    [(0x00, 32, 981, 40), (0x02, 31, 981, 40), (0x01, 32, 1000, 40), (0x10, 32, 981, 52)],
    ids=["deg/s, m/s2, degC", "rad/s", "mg", "degF"],
)
def test_units_are_those_of_the_unit_register(units, rate, acceleration, temperature):
    """2 deg/s, 1 g and 40 degC: 16 LSB/(deg/s) or 900 LSB/(rad/s), 100 LSB/(m/s2) or 1 LSB/mg, 1 LSB/degC or 2 degF."""
    quiet = {"white": ["0"] * 3, "flicker": ["0"] * 3, "random_walk": ["0"] * 3}
    truth = quiet | {"bias_x": ["2", "0", "0"], "temperature": "40", "accelerometer": {"white": ["0"] * 3}}
    bench = Bench(BNO055, truth=truth)
    write(bench, 0x3B, units)
    write(bench, 0x3D, AMG)
    bench.clock.sleep(0.1)
    numbers = [int.from_bytes(bench.read(register, count), "little") for register, count in ((0x14, 2), (0x0C, 2))]
    assert (*numbers, bench.read(0x34)[0]) == (rate, acceleration, temperature)


@EVERY
@BOTH
def test_a_clock_that_nobody_waits_for_never_gives_a_wrong_number(chip, kind):
    """Half of the transfers come late by a bit: each sample is right, or an error that says what to do."""
    bench = kind(chip, truth=chip.truth, faults=[{"kind": "clock-stretch", "share": "0.5", "from": "2 s"}])
    bench.sensor.start()
    bench.clock.wait_until(2 * SECOND)
    found = 0
    for _ in range(20):
        bench.clock.sleep(0.05)
        try:
            sample = bench.sensor.sample()
        except Garbled as fault:
            found += "waits while the sensor holds the clock" in str(fault)
        else:
            assert sample == pytest.approx(chip.expected, abs=chip.close)
    assert 2 < found < 18


def test_units_that_somebody_else_changes_are_found():
    """Degrees Fahrenheit would be half of them in degrees Celsius."""
    bench = Bench(BNO055)
    bench.sensor.start()
    for register, value in ((0x3D, 0x00), (0x3B, 0x12), (0x3D, MAGGYRO)):
        write(bench, register, value)
        bench.clock.sleep(0.03)
    with pytest.raises(Garbled, match="OPR_MODE reads 0x06 and UNIT_SEL 0x12, set were 0x06 and 0x00"):
        bench.sensor.sample()


def test_its_mode_has_the_sensors_that_are_wired():
    """Without the accelerometer it is the thesis' maggyro; the first sensor that starts sets all that are wired."""
    bench = Bench(BNO055, settings={"range": "500"})
    bench.driver.role(Wire(role="magnetometer", instrument="sensor"))
    bench.sensor.start()
    assert bench.read(0x3D) == bytes([MAGGYRO])
    bench = Bench(BNO055, settings={"range": "500"})
    bench.driver.role(Wire(role="accelerometer", instrument="sensor")).start()
    write(bench, 0x07, 1)
    assert bench.read(0x0A) == b"\x3a"
    write(bench, 0x07, 0)
    assert bench.read(0x3D) == bytes([AMG])
