"""LIS3MDL: register values of the data sheet, conversions, and what a dead sensor looks like."""

from __future__ import annotations

import math
import struct

import pytest
from scripted import ScriptedBus

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.lis3mdl import Lis3mdl
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected

IDENTITY = (b"\x0f", b"\x3d")
NEW, OLD = (b"\x27", b"\x08"), (b"\x27", b"\x00")
XYZ, TEMPERATURE = b"\xa8", b"\xae"
STATUS_AND_XYZ = b"\xa7"
UNCHANGED = (STATUS_AND_XYZ, bytes(7))


def starting(ctrl="fc 00 00 0c 40"):
    """Return the dialogue of a start: name, power-down, settings, old data away, awake, read back."""
    values = bytes.fromhex(ctrl)
    return [
        IDENTITY,
        (b"\x22\x03", None),
        (bytes((0x20, values[0])), None),
        (bytes((0x21, values[1])), None),
        (bytes((0x23, values[3])), None),
        (bytes((0x24, values[4])), None),
        (XYZ, bytes(6)),
        (b"\x22\x00", None),
        (b"\xa0", values),
    ]


def sampling(x, y, z, temperature):
    """Return the dialogue of one sample with these counts."""
    return [
        (STATUS_AND_XYZ, struct.pack("<Bhhh", 0x08, x, y, z)),
        (TEMPERATURE, struct.pack("<h", temperature)),
    ]


def magnetometer(script, **settings):
    """Return the role on a bus that plays this script, the bus, and the clock."""
    clock, bus = VirtualClock(), ScriptedBus(0x1C, script)
    driver = Lis3mdl(Connection(device="mag", clock=clock, clamps=Clamps(), bus=bus, address=0x1C))
    return driver.role(Wire(role="magnetometer", instance="", instrument="mag", settings=settings)), bus, clock


@pytest.mark.parametrize(
    ("settings", "ctrl"),
    [
        ({}, "fc 00 00 0c 40"),
        ({"range": "4 gauss", "rate": "80 Hz"}, "fc 00 00 0c 40"),
        ({"range": "8 gauss", "rate": "40 Hz"}, "f8 20 00 0c 40"),
        ({"range": "12 gauss", "rate": "0.625 Hz"}, "e0 40 00 0c 40"),
        ({"range": "16 gauss", "rate": "155 Hz"}, "e2 60 00 0c 40"),
        ({"rate": "10"}, "f0 00 00 0c 40"),
    ],
)
def test_start_writes_the_registers_of_the_data_sheet(settings, ctrl):
    """Temperature on, ultra-high performance on all axes, block data update, continuous conversion."""
    sensor, bus, _ = magnetometer([*starting(ctrl), OLD, NEW], **settings)
    sensor.start()
    assert bus.done


def test_start_waits_for_the_first_new_sample_on_the_benchs_clock():
    """What lay in the registers from before is no sample."""
    sensor, bus, clock = magnetometer([*starting(), OLD, OLD, OLD, NEW])
    sensor.start()
    assert bus.done
    assert 0 < clock.now() < 0.125


@pytest.mark.parametrize(("gauss", "counts"), [(4, 6842), (8, 3421), (12, 2281), (16, 1711)])
def test_a_sample_is_in_microtesla_at_every_range(gauss, counts):
    """One gauss is 100 uT, whatever the range."""
    script = [*starting(f"fc {(gauss // 4 - 1) << 5:02x} 00 0c 40"), NEW, *sampling(counts, -counts, counts // 2, 0)]
    sensor, bus, _ = magnetometer(script, range=f"{gauss} gauss")
    sensor.start()
    x, y, z, _ = sensor.sample()
    assert (x, y) == (100.0, -100.0)
    assert z == pytest.approx(50.0, abs=0.03)
    assert bus.done


@pytest.mark.parametrize(("counts", "degrees"), [(0, 25.0), (-120, 10.0), (80, 35.0), (-1, 24.875)])
def test_temperature_is_read_by_itself_and_starts_at_25(counts, degrees):
    """8 counts per degree from 25 degC, in a transfer of its own."""
    sensor, _, _ = magnetometer([*starting(), NEW, *sampling(1, 2, 3, counts)])
    sensor.start()
    assert sensor.sample()[3] == degrees


@pytest.mark.parametrize("counts", [32767, -32768, 27369, -27369])
def test_an_axis_at_the_rail_or_beyond_full_scale_is_nan(counts):
    """The other axes keep their numbers."""
    sensor, _, _ = magnetometer([*starting(), NEW, *sampling(counts, 6842, 27368, 0)])
    sensor.start()
    x, y, z, temperature = sensor.sample()
    assert math.isnan(x)
    assert (y, z, temperature) == (100.0, 400.0, 25.0)


def test_a_sample_is_never_read_twice():
    """The driver waits until the status register says that there is a new one."""
    sensor, bus, clock = magnetometer([*starting(), NEW, UNCHANGED, UNCHANGED, *sampling(0, 0, 0, 0)])
    sensor.start()
    sensor.sample()
    assert bus.done
    assert clock.now() == pytest.approx(2 / (8 * 80))


def test_what_changed_without_the_flag_is_a_sample_of_a_sensor_that_is_set():
    """It came after its status was read; in a sensor that was reset, zeros did."""
    came = (STATUS_AND_XYZ, struct.pack("<Bhhh", 0x00, 6842, 0, 0))
    controls = bytes.fromhex("fc 00 00 0c 40")
    sensor, bus, _ = magnetometer([*starting(), NEW, came, (b"\xa0", controls), (TEMPERATURE, bytes(2))])
    sensor.start()
    assert sensor.sample()[:3] == (100.0, 0.0, 0.0)
    assert bus.done
    reset = [(STATUS_AND_XYZ, bytes(7)), (b"\xa0", bytes.fromhex("10 00 03 00 00"))]
    sensor, bus, _ = magnetometer([*starting(), NEW, *sampling(1, 2, 3, 0), *reset])
    sensor.start()
    sensor.sample()
    bus.repeat_last(*UNCHANGED)
    with pytest.raises(NoReply, match="no new sample"):
        sensor.sample()


def test_a_sensor_that_stands_still_is_no_reply():
    """Two periods and a margin, then the error says what that means."""
    sensor, bus, clock = magnetometer([*starting(), NEW])
    sensor.start()
    bus.repeat_last(*UNCHANGED)
    with pytest.raises(NoReply, match=r"mag: no new sample within 0.125 s at 80 Hz; .* started again"):
        sensor.sample()
    assert clock.now() == pytest.approx(0.125, abs=0.002)


def test_a_bus_that_reads_only_ones_is_garbled():
    """A sensor that does not know its name any more did not measure -1."""
    ones = [(STATUS_AND_XYZ, b"\xff" * 7), (TEMPERATURE, b"\xff" * 2)]
    sensor, bus, _ = magnetometer([*starting(), NEW, *ones, (b"\x0f", b"\xff")])
    sensor.start()
    with pytest.raises(Garbled, match="nothing but ones"):
        sensor.sample()
    assert bus.done


def test_a_true_minus_one_everywhere_is_a_sample():
    """Near zero field and 25 degC that happens; the name tells the difference."""
    sensor, _, _ = magnetometer([*starting(), NEW, *sampling(-1, -1, -1, -1), IDENTITY])
    sensor.start()
    assert sensor.sample()[3] == 24.875


def test_start_refuses_settings_that_read_back_otherwise():
    """A write that was acknowledged and lost is found out."""
    script = starting()
    script[-1] = (b"\xa0", bytes.fromhex("10 00 03 00 00"))
    sensor, _, _ = magnetometer(script)
    with pytest.raises(Rejected, match="fc 00 00 0c 40 and read back 10 00 03 00 00"):
        sensor.start()
    with pytest.raises(Refused, match="has not been started"):
        sensor.sample()


def test_stop_is_power_down_and_read_back():
    """After it there is nothing to sample."""
    sensor, bus, _ = magnetometer([*starting(), NEW, (b"\x22\x03", None), (b"\xa2", b"\x03")])
    sensor.start()
    sensor.stop()
    assert bus.done
    with pytest.raises(Refused, match="has not been started"):
        sensor.sample()
