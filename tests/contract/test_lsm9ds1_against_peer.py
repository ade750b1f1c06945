"""The LSM9DS1: its peer against the data sheet, and what is its driver's alone: one rate, and a thermometer."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from sensor_bench import LSM9DS1, LSM9DS1_MAGNETOMETER, Bench

from hil.instruments.driver import Strap
from hil.model.bench import Wire
from hil.model.errors import Refused

AG, M = 0x6A, 0x1C
QUIET = {kind: ["0", "0", "0"] for kind in ("white", "flicker", "random_walk")}
STILL = QUIET | {"accelerometer": {"white": ["0", "0", "0"]}, "noise": ["0", "0", "0"]}


def made(**truth):
    """Return a chip without noise on its bus, a little after power-on."""
    return Bench(LSM9DS1, truth=STILL | truth)


def get(bench, die, register, count=1):
    """Read registers of a die."""
    return bytes(bench.bus.read_i2c_block_data(die, register, count))


def put(bench, die, **values):
    """Write registers of a die, and let it sample: `put(bench, AG, x10=0x60)`."""
    for register, value in values.items():
        bench.bus.write_byte_data(die, int(register[1:], 16), value)
    bench.clock.sleep(0.2)


def test_both_dies_are_off_after_power_on():
    """Identities and reset values; nothing is sampled, and the temperature reads as 25 degC, whatever it is."""
    bench = made(temperature="-10")
    assert get(bench, AG, 0x0F) + get(bench, M, 0x0F) + get(bench, AG, 0x10) + get(bench, AG, 0x17) == b"\x68\x3d\0\0"
    assert get(bench, M, 0xA0, 5).hex() == "1000030000"
    assert get(bench, AG, 0x15, 2) == b"\x00\x00"


@pytest.mark.parametrize(("degrees", "counts"), [("25", 0), ("-40", -1040), ("85", 960), ("25.5", 8)])
def test_a_temperature_has_sixteen_counts_per_degree(degrees, counts):
    """It is 0 at 25 degC, measured with either sensor of its die; one driver's (counts >> 4) / 16 + 27.5 is wrong."""
    assert abs((counts >> 4) / 16 + 27.5 - float(degrees)) >= 2.0
    for register in ("x10", "x20"):
        bench = made(temperature=degrees)
        put(bench, AG, **{register: 0x60})
        assert struct.unpack("<h", get(bench, AG, 0x15, 2)) == (counts,)


@pytest.mark.parametrize(("code", "milli"), [(0, 8.75), (1, 17.5), (3, 70.0)])
def test_rates_have_the_sensitivity_of_the_data_sheet(code, milli):
    """mdeg/s per count; 245, 500 and 2000 deg/s."""
    bench = made(bias_x=["100", "0", "0"], bias_z=["-3", "0", "0"])
    put(bench, AG, x10=0x60 | code << 3)
    assert get(bench, AG, 0x17) == b"\x06"
    assert struct.unpack("<hhh", get(bench, AG, 0x18, 6)) == (round(100e3 / milli), 0, round(-3e3 / milli))
    assert get(bench, AG, 0x28, 6) == bytes(6)


def test_rates_stay_where_they_were_while_the_accelerometer_goes_on():
    """The gyroscope is switched off: until the next sample of the die its registers show the last rate."""
    bench = made(bias_x=["100", "0", "0"])
    put(bench, AG, x10=0x60, x20=0x60)
    bench.bus.write_byte_data(AG, 0x10, 0x00)
    assert struct.unpack("<h", get(bench, AG, 0x18, 2)) == (round(100e3 / 8.75),)
    bench.clock.sleep(0.2)
    assert get(bench, AG, 0x18, 2) == bytes(2)


@pytest.mark.parametrize(("code", "milli"), [(0, 0.061), (2, 0.122), (3, 0.244), (1, 0.732)])
def test_the_codes_of_accelerations_are_not_in_their_order(code, milli):
    """Mg per count; 2, 4, 8 and 16 g."""
    bench = made()
    put(bench, AG, x20=0x60 | code << 3)
    assert struct.unpack("<hhh", get(bench, AG, 0x28, 6)) == (0, 0, round(1e3 / milli))


def test_an_oscillator_that_is_off_leaves_the_filter_as_it_is():
    """At 476 Hz of its own the accelerometer has the filter of 476 Hz, not the widest."""
    spreads = []
    for error in ("0", "0.099"):
        bench = made(odr_error=error, accelerometer={"white": ["0.1"] * 3})
        put(bench, AG, x20=0xA0)
        samples = []
        for _ in range(100):
            bench.clock.sleep(0.01)
            samples.append(struct.unpack("<hhh", get(bench, AG, 0x28, 6)))
        spreads.append(np.std(samples, axis=0).mean())
    assert spreads[1] == pytest.approx(spreads[0], rel=0.15)


@pytest.mark.parametrize(("code", "milli"), [(0, 0.14), (1, 0.29), (2, 0.43), (3, 0.58)])
def test_fields_have_the_sensitivity_of_the_data_sheet(code, milli):
    """Mgauss per count; the address goes on only where its upper bit says so."""
    bench = made(offset=["50", "-20", "0"])
    put(bench, M, x21=code << 5, x22=0)
    assert struct.unpack("<hhh", get(bench, M, 0xA8, 6)) == (round(500 / milli), round(-200 / milli), 0)
    assert get(bench, M, 0x28, 3) == get(bench, M, 0xA8) * 3


def test_an_address_that_does_not_go_on():
    """IF_ADD_INC is on after power-on, and can be switched off."""
    bench = made()
    assert get(bench, AG, 0x1E, 2) == b"\x38\x38"
    put(bench, AG, x22=0)
    assert get(bench, AG, 0x1E, 3) == b"\x38\x38\x38"
    assert get(bench, AG, 0x22, 2) == bytes(2)


def test_two_rates_on_one_die_are_refused():
    """The accelerometer would sample at the gyroscope's."""
    bench = Bench(LSM9DS1)
    bench.driver.role(Wire(role="accelerometer", instrument="", settings={"rate": "238 Hz"}))
    with pytest.raises(Refused, match="have one rate, and are wired for 119 and 238 Hz; give both wires the same"):
        bench.sensor.start()


def test_the_magnetometer_alone_wakes_the_thermometer():
    """The other die samples as slowly as it can, and rests once nothing needs its thermometer."""
    bench = Bench(LSM9DS1_MAGNETOMETER)
    bench.sensor.start()
    assert get(bench, AG, 0x10) + get(bench, AG, 0x20) == b"\x00\x20"
    bench.sensor.stop()
    assert get(bench, AG, 0x20) == b"\x00"
    assert LSM9DS1.driver.straps() == (Strap("SDO_A/G", (0x6A, 0x6B)), Strap("SDO_M", (0x1C, 0x1E)))


def test_the_fifo_holds_32_levels_of_both_sensors():
    """A transfer gives six numbers a level, the oldest first; what it told of a loss is gone with it."""
    bench = made(bias_x=["100", "0", "0"])
    put(bench, AG, x10=0x60, x20=0x60, x23=0x02)
    bench.bus.write_byte_data(AG, 0x2E, 0xC0 | 10)
    assert get(bench, AG, 0x2F) == b"\x00"
    bench.clock.sleep(11 / 119)
    assert get(bench, AG, 0x2F)[0] in {0x80 | 10, 0x80 | 11}
    bench.clock.sleep(1.0)
    assert get(bench, AG, 0x2F) == bytes([0x80 | 0x40 | 32])
    assert struct.unpack("<12h", get(bench, AG, 0x18, 24)) == (11429, 0, 0, 0, 0, 16393) * 2
    assert get(bench, AG, 0x2F) == bytes([0x80 | 30])
    put(bench, AG, x2E=0x00)
    assert get(bench, AG, 0x2F)[0] & 0x7F == 0
