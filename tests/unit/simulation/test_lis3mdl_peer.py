"""The simulated LIS3MDL: registers, traps, conversions on its own grid."""

from __future__ import annotations

import numpy as np
import pytest
from twin import MAGNETOMETER, Twin

QUIET = {"mag": {"noise": ["0", "0", "0"]}}


@pytest.fixture
def twin():
    """Return a twin whose magnetometer has no noise."""
    return Twin(truths=QUIET)


def test_without_power_it_does_not_acknowledge(twin):
    """Absent power is a missing acknowledge; 10 ms after power it answers."""
    with pytest.raises(OSError, match="Remote I/O error"):
        twin.register(0x0F)
    twin.power_sensor()
    assert twin.register(0x0F) == 0x3D


def test_registers_after_power_on(twin):
    """It boots in power-down; a power cycle forgets every setting."""
    twin.power_sensor()
    defaults = bytes([0x10, 0x00, 0x03, 0x00, 0x00])
    assert twin.burst(0xA0, 5) == defaults
    twin.write(0x20, 0x7C)
    twin.scpi("OUTP OFF,(@1)")
    twin.scpi("OUTP ON,(@1)")
    assert twin.burst(0xA0, 5) == defaults


def test_auto_increment_needs_bit_seven(twin):
    """Without it a burst repeats one register."""
    twin.wake_sensor()
    assert twin.burst(0x0F, 3) == b"\x3d\x3d\x3d"
    assert twin.burst(0x20, 2) == b"\xfc\xfc"
    assert twin.burst(0xA0, 2) == b"\xfc\x00"
    twin.bus.write_i2c_block_data(MAGNETOMETER, 0xA0, [0x70, 0x40])
    assert twin.burst(0xA0, 2) == b"\x70\x40"


def test_burst_of_eight_rolls_over_to_x(twin):
    """From 2Dh it goes back to 28h, so that bytes 7 and 8 are X again, not the temperature."""
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    data = twin.burst(0xA8, 8)
    assert data[6:8] == data[0:2]
    assert twin.burst(0xAE, 2) != data[6:8]


def test_temperature(twin):
    """8 LSB per degree from 25 degC: -40 at the air's 20 degC; without TEMP_EN nothing."""
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    assert int.from_bytes(twin.burst(0xAE, 2), "little", signed=True) == -40
    twin.write(0x20, 0x7C)
    twin.clock.sleep(0.1)
    assert twin.burst(0xAE, 2) == b"\0\0"


@pytest.mark.parametrize(("ctrl2", "sensitivity"), [(0x00, 6842), (0x20, 3421), (0x40, 2281), (0x60, 1711)])
def test_full_scales(twin, ctrl2, sensitivity):
    """Four ranges with the datasheet's sensitivities."""
    twin.wake_sensor(ctrl2=ctrl2)
    twin.clock.sleep(0.1)
    assert twin.field() == tuple(round(field / 100 * sensitivity) for field in (22, 5, -38))


@pytest.mark.parametrize(
    ("ctrl1", "rate"),
    [(0x60, 0.625), (0x64, 1.25), (0x70, 10), (0x7C, 80), (0x62, 155), (0x42, 300), (0x22, 560), (0x02, 1000)],
)
def test_output_rates(twin, ctrl1, rate):
    """New data comes at the rate of DO, or with FAST_ODR at the one of the performance mode."""
    twin.wake_sensor(ctrl1=ctrl1)
    start = twin.clock.now_ns()
    twin.clock.wait_until(start + round(0.97e9 / rate) - 200_000)
    assert twin.register(0x27) == 0
    twin.clock.wait_until(start + round(1e9 / rate))
    assert twin.register(0x27) & 0x0F == 0x0F


def test_status_tells_new_and_lost_data(twin):
    """Data available per axis until it is read, overrun once a sample was missed."""
    twin.wake_sensor()
    assert twin.register(0x27) == 0
    twin.clock.sleep(0.013)
    assert twin.register(0x27) == 0x0F
    twin.burst(0xA8, 2)
    assert twin.register(0x27) == 0x06
    twin.burst(0xAA, 4)
    assert twin.register(0x27) == 0
    twin.clock.sleep(0.025)
    assert twin.register(0x27) == 0xFF
    twin.burst(0xA8, 6)
    assert twin.register(0x27) == 0


def test_block_data_update_keeps_both_halves_of_one_sample():
    """With BDU the high byte belongs to the low byte's sample; without it to the newest."""

    def halves(ctrl5):
        twin = Twin(truths={"mag": {"noise": ["3", "3", "3"]}})
        twin.wake_sensor(ctrl5=ctrl5)
        twin.clock.sleep(0.1)
        whole = twin.field()[0]
        low = twin.register(0x28)
        twin.clock.sleep(0.1)
        mixed = int.from_bytes(bytes([low, twin.register(0x29)]), "little", signed=True)
        return whole, mixed, twin.field()[0]

    first, mixed, second = halves(0x40)
    assert mixed == first != second
    first, mixed, second = halves(0x00)
    assert mixed & 0xFF == first & 0xFF
    assert mixed >> 8 == second >> 8


def test_readings_do_not_depend_on_polling():
    """Twins with the same commands read the same sample, polled a hundred times or once."""
    often, once = Twin(), Twin()
    for twin in (often, once):
        twin.wake_sensor()
    start_ns = once.clock.now_ns()
    for step in range(100):
        often.clock.wait_until(start_ns + step * 4_321_000)
        often.field()
    for twin in (often, once):
        twin.clock.wait_until(start_ns + 500_000_000)
        twin.coil.command(board="y_plus", supply_voltage=5.0, supply_current=0.016)
        twin.clock.wait_until(start_ns + 503_000_000)
    assert often.field() == once.field()
    often.clock.sleep(0.1)
    once.clock.wait_until(often.clock.now_ns())
    assert often.field() == once.field()


def test_noise_level_by_mode_and_independence_of_axes():
    """The best mode spreads as the truth says, low power sqrt(1000/155) times that; axes do not correlate."""

    def samples(ctrl1, ctrl4, count=1500):
        twin = Twin()
        twin.wake_sensor(ctrl1=ctrl1, ctrl4=ctrl4)
        rows = []
        for _ in range(count):
            twin.clock.sleep(0.0125)
            rows.append(twin.field())
        return np.array(rows) / 68.42

    best, poorest = samples(0xFC, 0x0C), samples(0x9C, 0x00)
    assert best.std(axis=0) == pytest.approx([0.32, 0.32, 0.41], rel=0.08)
    assert poorest.std(axis=0) / best.std(axis=0) == pytest.approx([2.54] * 3, rel=0.12)
    assert np.abs(np.corrcoef(best.T) - np.eye(3)).max() < 0.12
    assert best.mean(axis=0) == pytest.approx([22, 5, -38], abs=0.05)


def test_power_down_holds_the_last_sample(twin):
    """Asleep, the data registers keep still and no new data is told."""
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    before = twin.field()
    twin.write(0x22, 0x03)
    twin.coil.command(board="y_plus", supply_voltage=5.0, supply_current=0.016)
    twin.clock.sleep(5)
    assert twin.field() == before
    assert twin.register(0x27) == 0


def test_single_conversion(twin):
    """One sample, then power-down; it can be read as late as one likes, and asked for again."""
    twin.wake_sensor(ctrl1=0xFC)
    twin.write(0x22, 0x01)
    twin.clock.sleep(10)
    assert twin.register(0x22) == 0x03
    first = twin.field()
    assert first == (1505, 342, -2600)
    twin.coil.command(board="y_plus", supply_voltage=5.0, supply_current=0.016)
    twin.clock.sleep(1)
    assert twin.field() == first
    twin.write(0x22, 0x01)
    twin.clock.sleep(1)
    assert twin.field()[2] > first[2] + 800


def test_offset_gain_and_offset_registers():
    """Hard iron and gain are the truth's; the offset registers are subtracted."""
    twin = Twin(truths={"mag": {"noise": ["0", "0", "0"], "offset": ["10", "0", "0"], "gain": ["0", "0.1", "0"]}})
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    assert twin.field()[:2] == (round(32 * 68.42), round(5.5 * 68.42))
    twin.bus.write_i2c_block_data(MAGNETOMETER, 0x85, [0x10, 0x00])
    assert twin.field()[0] == round(32 * 68.42) - 16


def test_soft_reset_and_reboot(twin):
    """A soft reset brings the registers of power-on; a reboot keeps them; both bits clear themselves."""
    twin.wake_sensor(ctrl2=0x20)
    twin.write(0x21, 0x28)
    assert twin.burst(0xA0, 3) == bytes([0xFC, 0x20, 0x00])
    twin.write(0x21, 0x04)
    assert twin.burst(0xA0, 3) == bytes([0x10, 0x00, 0x03])


def test_read_only_registers_stay(twin):
    """Writing the identity, data or reserved registers changes nothing."""
    twin.power_sensor()
    for register in (0x0F, 0x28, 0x27, 0x10):
        twin.write(register, 0x55)
    assert twin.register(0x0F) == 0x3D
    assert twin.burst(0xA8, 6) == bytes(6)
    assert twin.register(0x10) == 0


def test_strong_field_stops_at_sixteen_bits():
    """Beyond the range the reading is the largest number, not a wrapped one."""
    twin = Twin(truths=QUIET, coil={"earth_field": ["600", "-600", "0"]})
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    assert twin.field()[:2] == (32767, -32768)
