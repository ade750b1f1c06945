"""What is peculiar to the ICM-20948: banks, sleep, and the way to its magnetometer."""

from __future__ import annotations

import pytest
from behind_obc import BehindObc
from sensor_bench import ICM20948, ICM20948_MAGNETOMETER, Bench

from hil.model.errors import NoReply, WrongIdentity

MAGNETOMETER = 0x0C
BOTH = pytest.mark.parametrize("kind", [Bench, BehindObc], ids=["own bus", "obc"])


def write(bench, register, value, address=0x68):
    """Write one register."""
    bench.bus.write_byte_data(address, register, value)


def test_what_it_says_after_power_on():
    """It sleeps, its data are 0, its settings lie in bank 2, and every bank shows which one is selected."""
    bench = Bench(ICM20948)
    assert (bench.read(0x00), bench.read(0x06), bench.read(0x2D, 14)) == (b"\xea", b"\x41", bytes(14))
    write(bench, 0x7F, 0x20)
    assert (bench.read(0x7F), bench.read(0x00, 2), bench.read(0x14)) == (b"\x20", b"\x00\x01", b"\x01")


def test_data_are_0_until_it_has_started():
    """35 ms after it was woken."""
    bench = Bench(ICM20948, truth={"bias_x": ["100", "0", "0"]})
    write(bench, 0x06, 0x01)
    bench.clock.sleep(0.034)
    assert bench.read(0x2D, 12) == bytes(12)
    bench.clock.sleep(0.003)
    assert int.from_bytes(bench.read(0x33, 2), "big") == pytest.approx(13_100, abs=100)


@pytest.mark.parametrize("stuck", [False, True])
def test_the_temperature_alone_is_that_of_the_whole_sample(stuck):
    """Reading it before the axes changes nothing, also where every number is stuck."""
    faults = [{"kind": "stuck", "from": "1 s"}] if stuck else []
    bench = Bench(ICM20948, truth={"temperature": "31.5"}, faults=faults)
    write(bench, 0x06, 0x01)
    for wait_s in (0.5, 1.0):
        bench.clock.sleep(wait_s)
        assert bench.read(0x39, 2) == bench.read(0x2D, 14)[12:] != bytes(2)


@pytest.mark.parametrize(
    ("power", "pins", "user", "there"),
    [(0x01, 0x02, 0x00, True), (0x41, 0x02, 0x00, False), (0x01, 0x00, 0x00, False), (0x01, 0x02, 0x20, False)],
    ids=["there", "asleep", "no bypass", "the chip is master"],
)
def test_the_magnetometer_answers_only_through_the_bypass(power, pins, user, there):
    """Awake, BYPASS_EN set, I2C_MST_EN clear: else nobody acknowledges at 0x0C."""
    bench = Bench(ICM20948)
    for register, value in ((0x06, power), (0x0F, pins), (0x03, user)):
        write(bench, register, value)
    if there:
        assert bench.bus.read_i2c_block_data(MAGNETOMETER, 0x00, 2) == [0x48, 0x09]
    else:
        with pytest.raises(OSError, match="Remote I/O error"):
            bench.bus.read_byte_data(MAGNETOMETER, 0x01)


def test_magnetometer_data_stay_until_the_second_status_is_read():
    """They are protected while they are read; what came meanwhile is lost and an overrun, and the next one is new."""
    bench = Bench(ICM20948_MAGNETOMETER, truth={"noise": ["9"] * 3})
    bench.sensor.start()

    def data(register, count):
        return bench.bus.read_i2c_block_data(MAGNETOMETER, register, count)

    first = data(0x11, 6)
    bench.clock.sleep(0.1)
    assert (data(0x11, 6), data(0x10, 1), data(0x18, 1)) == (first, [0x02], [0x00])
    assert data(0x10, 1) == [0x00]
    bench.clock.sleep(0.01)
    assert (data(0x10, 1), data(0x11, 6) == first) == ([0x01], False)


def test_a_bypass_that_cannot_be_set_is_an_error_that_says_so():
    """The magnetometer does not start, whatever its own address says."""
    bench = Bench(ICM20948_MAGNETOMETER, faults=[{"kind": "bypass-off"}])
    with pytest.raises(NoReply, match=r"cannot be reached: INT_PIN_CFG is 0x00, .* 0x02 \(BYPASS_EN is not set\)"):
        bench.sensor.start()


@BOTH
@pytest.mark.parametrize(
    ("register", "value", "said"),
    [(0x0F, 0x00, "BYPASS_EN is not set"), (0x03, 0x20, "I2C_MST_EN must be off"), (0x06, 0x41, "the chip sleeps")],
)
def test_a_bypass_that_is_lost_ends_the_samples(kind, register, value, said):
    """Somebody else writes to the chip: the next sample is an error with the register that is wrong."""
    bench = kind(chip=ICM20948_MAGNETOMETER)
    bench.sensor.start()
    write(bench, 0x03, 0x40)  # FIFO_EN, which shuts nothing
    bench.sensor.sample()
    write(bench, register, value)
    with pytest.raises(NoReply, match=f"sensor: its magnetometer cannot be reached: .*{said}"):
        bench.sensor.sample()


def test_a_magnetometer_of_another_type():
    """The bypass is open, and who answers there is not an AK09916; after it another chip is found first."""
    bench = Bench(ICM20948_MAGNETOMETER)
    bench.driver._dies[True].read = lambda _: 0x05
    with pytest.raises(WrongIdentity, match="WIA2 is 0x05, the AK09916 has 0x09"):
        bench.sensor.start()


def test_a_measurement_at_once_is_what_its_registers_are():
    """Flags, axes and overflow, and the transfer goes on at the first register; two transfers find nothing new."""
    whole, single = (
        Bench(ICM20948_MAGNETOMETER, truth={"noise": ["9"] * 3, "offset": ["-40", "9", "7"]}) for _ in "12"
    )
    for bench in (whole, single):
        bench.sensor.start()
        bench.clock.sleep(0.0255 - bench.clock.now() % 0.01)
    data = whole.bus.read_i2c_block_data(MAGNETOMETER, 0x10, 11)
    parts = [single.bus.read_byte_data(MAGNETOMETER, register) for register in (*range(0x10, 0x19), 0x00, 0x01)]
    assert data == parts
    assert data[9:] == [0x48, 0x09]
    assert whole.bus.read_byte_data(MAGNETOMETER, 0x10) == single.bus.read_byte_data(MAGNETOMETER, 0x10) == 0
