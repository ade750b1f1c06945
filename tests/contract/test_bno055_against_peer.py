"""What is peculiar to the BNO055: modes and their switching times, pages, units, and a clock that it holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from behind_obc import BehindObc
from sensor_bench import BNO055, BNO055_ACCELEROMETER, BNO055_MAGNETOMETER, Bench

from hil.model.bench import Wire
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.simulation.peers.obc_link.stream import Stream

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


@EVERY
def test_a_sensor_that_fell_asleep_is_in_configmode(chip):
    """Its data are 0, which is no number; one that stays there does not start."""
    bench = Bench(chip, faults=[{"kind": "asleep", "from": "2 s"}])
    bench.sensor.start()
    bench.clock.wait_until(2 * SECOND)
    with pytest.raises(NoReply, match="sensor: it is in CONFIGMODE: it has lost its settings"):
        bench.sensor.sample()
    with pytest.raises(Rejected, match="OPR_MODE was set to 0x0[67] and reads back 0x00"):
        bench.sensor.start()


def test_units_that_somebody_else_changes_are_found():
    """Degrees Fahrenheit would be half of them in degrees Celsius."""
    bench = Bench(BNO055)
    bench.sensor.start()
    for register, value in ((0x3D, 0x00), (0x3B, 0x12), (0x3D, MAGGYRO)):
        write(bench, register, value)
        bench.clock.sleep(0.03)
    with pytest.raises(Garbled, match="OPR_MODE reads 0x06 and UNIT_SEL 0x12, set were 0x06 and 0x00"):
        bench.sensor.sample()


def test_a_temperature_in_counts_is_no_number():
    """127 is beyond what the chip is made for."""
    bench = Bench(BNO055, faults=[{"kind": "temperature-raw"}])
    bench.sensor.start()
    assert math.isnan(bench.sensor.sample()[3])
    with pytest.raises(NoReply, match="temperature is marked invalid"):
        bench.sensor.temperature()


def test_three_sensors_of_one_chip_live_side_by_side():
    """The first that starts sets all that are wired; without the accelerometer the mode is the thesis' maggyro."""
    bench = Bench(BNO055, truth={"bias_x": ["1.5", "0", "0"], "offset": ["48", "0", "0"]}, settings={"range": "500"})
    bench.sensor.start()
    assert bench.read(0x3D) == bytes([MAGGYRO])
    bench.sensor.stop()
    others = [bench.driver.role(Wire(role=role, instrument="sensor")) for role in ("accelerometer", "magnetometer")]
    roles = (*others, bench.sensor)
    for role in roles:
        role.start()
    assert bench.read(0x3D) == bytes([AMG])
    assert [role.sample()[0] for role in others] == pytest.approx([0, 48], abs=2)
    assert bench.sensor.sample()[0] == pytest.approx(1.5, abs=0.5)
    others[0].stop()
    assert bench.sensor.full_scale().value == 500
    assert bench.sensor.sample()[0] == pytest.approx(1.5, abs=0.5)


def streamed(bench, rate, seconds, pause=0.7):
    """Return the rows of a stream, and its report."""
    bench.sensor.begin(rate)
    blocks, end = [], bench.clock.now() + seconds
    while bench.clock.now() < end:
        bench.clock.sleep(min(pause, end - bench.clock.now()))
        blocks.append(bench.sensor.drain())
    return np.concatenate(blocks), bench.sensor.end()


@EVERY
def test_the_timer_of_a_board_reads_it(chip, monkeypatch):
    """Every tick a row, from one period on; turns that are made together are what they are one by one."""
    found = []
    for alone in (False, True):
        if alone:
            monkeypatch.setattr(Stream, "_unseen_ns", lambda _: None)
        bench = BehindObc(chip, truth=chip.truth, obc={"clock_drift": "0.0001"})
        bench.sensor.start()
        rows, report = streamed(bench, 27.0, 5.0)
        assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) / 27, abs=2e-5)
        assert len(rows) in {134, 135}
        assert rows[:, 1:] == pytest.approx(np.tile(chip.expected, (len(rows), 1)), abs=chip.close)
        assert (report.lost, report.drift) == (0, pytest.approx(1e-4, abs=2e-6))
        found.append((rows, bench.sensor.sample()))
    assert np.array_equal(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]


def test_only_a_board_lets_it_stream_and_only_one_of_a_board():
    """On a bus of the host it is asked; a second stream would end the first."""
    bench = Bench(BNO055)
    bench.sensor.start()
    assert not bench.sensor.streams
    with pytest.raises(Refused, match="has no FIFO, and its bus no timer"):
        bench.sensor.begin(27.0)
    bench = BehindObc(BNO055)
    other = bench.driver.role(Wire(role="magnetometer", instrument="sensor"))
    for sensor in (bench.sensor, other):
        sensor.start()
    bench.sensor.begin(27.0)
    assert bench.sensor.streams
    with pytest.raises(Refused, match="already streaming"):
        bench.sensor.begin(27.0)
    with pytest.raises(Refused, match="the board runs one stream at a time"):
        other.begin(6.0)
    bench.clock.sleep(0.5)
    assert len(bench.sensor.drain()) == 13
    bench.sensor.stop()
    other.begin(6.0)


@pytest.mark.parametrize(
    ("fault", "of_board", "told"),
    [
        ({"kind": "asleep"}, False, "sensor: it is in CONFIGMODE"),
        ({"kind": "clock-stretch"}, False, "waits while the sensor holds the clock"),
        ({"kind": "stuck"}, False, "sensor: .* consecutive samples are equal"),
        ({"kind": "nack", "address": "0x28"}, True, "sensor: no acknowledge at address 0x28"),
        ({"kind": "stall"}, True, "obc: no reading of sensor for .* s, though its link answers"),
    ],
    ids=lambda each: each["kind"] if isinstance(each, dict) else None,
)
def test_a_fault_in_a_stream_ends_it_after_the_rows_before(fault, of_board, told):
    """None of its rows is a wrong number."""
    faults = [fault | {"from": "4 s"}]
    bench = BehindObc(BNO055, truth=BNO055.truth, **{"obc_faults" if of_board else "faults": faults})
    bench.sensor.start()
    bench.sensor.begin(27.0)
    rows = []
    with pytest.raises(DeviceFault, match=told):
        while bench.clock.now() < 12:
            bench.clock.sleep(0.9)
            rows.extend(bench.sensor.drain())
    assert len(rows) > 40
    assert np.array(rows)[:, 1:] == pytest.approx(np.tile(BNO055.expected, (len(rows), 1)), abs=BNO055.close)
