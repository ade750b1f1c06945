"""IIM-42652: register values, packets, times, and what a sensor that does not measure looks like."""

from __future__ import annotations

import math
import struct

import pytest
from scripted import ScriptedBus

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.iim42652 import CELSIUS, FIFO, Iim42652
from hil.instruments.sampled import Channel
from hil.model.bench import Wire
from hil.model.errors import NoReply, Refused, Rejected

OUTPUTS = b"\x1d"


def wire(role="gyroscope", channel=0, **settings):
    """Return a wire with these settings."""
    return Wire(role=role, instance="", instrument="gyro", channel=channel, settings=settings)


def starting(gyro="88", mode="10", power=b"\x0c", reset=b"\x10"):
    """Return the dialogue of a start: name, reset, settings, on, and all read back."""
    values = {0x4C: 0x30, 0x4F: int(gyro, 16), 0x51: 0x1A, 0x52: int(mode, 16), 0x64: 0x00}
    return [
        (b"\x75", b"\x6f"),
        (b"\x11\x01", None),
        (b"\x2d", reset),
        *((bytes(pair), None) for pair in values.items()),
        (b"\x4e\x0c", None),
        *((bytes((register,)), bytes((value,))) for register, value in values.items()),
        (b"\x4e", power),
    ]


def outputs(x, y, z, temperature=0):
    """Return the dialogue of a read of all outputs."""
    return (OUTPUTS, struct.pack(">7h", temperature, -32768, -32768, -32768, x, y, z))


def gyroscope(script, **settings):
    """Return the role on a bus that plays this script, the bus, and the clock."""
    clock, bus = VirtualClock(), ScriptedBus(0x68, script)
    driver = Iim42652(Connection(device="gyro", clock=clock, clamps=Clamps(), bus=bus, address=0x68))
    return driver.role(wire(**settings)), bus, clock


@pytest.mark.parametrize(
    ("settings", "gyro", "mode"),
    [
        ({}, "88", "10"),
        ({"range": "125 deg/s", "rate": "100 Hz", "bandwidth": "50 Hz"}, "88", "10"),
        ({"range": "2000", "rate": "12.5", "bandwidth": "6.25"}, "0b", "10"),
        ({"range": "1000", "rate": "25", "bandwidth": "100"}, "2a", "11"),
        ({"range": "500", "rate": "50", "bandwidth": "80"}, "49", "12"),
        ({"range": "250", "rate": "200", "bandwidth": "40"}, "67", "14"),
        ({"range": "62.5", "rate": "500", "bandwidth": "31.25"}, "af", "15"),
        ({"range": "31.25", "rate": "1000", "bandwidth": "50"}, "c6", "16"),
        ({"range": "15.625", "rate": "100", "bandwidth": "10"}, "e8", "17"),
    ],
)
def test_start_writes_the_registers(settings, gyro, mode):
    """Reset, big-endian counts in bytes, range and rate, third-order filter, low-noise mode; read back after 60 ms."""
    sensor, bus, clock = gyroscope([*starting(gyro, mode), outputs(1, 2, 3)], **settings)
    sensor.start()
    assert bus.done
    assert clock.now() == pytest.approx(0.062)


def test_start_waits_for_valid_data():
    """An axis, or the temperature, that is marked invalid is not valid yet."""
    invalid = [outputs(-32768, 0, 0), outputs(0, 0, -32768), outputs(1, 1, 1, -32768)]
    sensor, bus, clock = gyroscope([*starting(), *invalid, outputs(1, 2, 3)])
    sensor.start()
    assert bus.done
    assert clock.now() == pytest.approx(0.062 + 3 * 0.01)


def test_data_that_stay_invalid_are_no_reply():
    """Half a second is more than a start can take."""
    sensor, bus, clock = gyroscope(starting())
    bus.repeat_last(*outputs(-32768, -32768, -32768))
    with pytest.raises(NoReply, match="no valid data"):
        sensor.start()
    assert clock.now() < 0.6


def test_a_start_that_did_not_happen_is_rejected():
    """A reset that is not reported, a setting that reads otherwise."""
    with pytest.raises(Rejected, match="reset"):
        gyroscope(starting(reset=b"\x08"))[0].start()
    with pytest.raises(Rejected, match="PWR_MGMT0 was set to 0x0c and reads back 0x00"):
        gyroscope(starting(power=b"\x00"))[0].start()


def test_a_sample_is_one_transfer():
    """Temperature and rates belong together; invalid and saturated axes are NaN."""
    sensor, bus, _ = gyroscope(
        [
            *starting(),
            outputs(1, 1, 1),
            outputs(262, -524, 131, 1325),
            outputs(32767, -32767, -32768, -32768),
        ]
    )
    sensor.start()
    assert sensor.channels() == (*(Channel(axis, "deg/s") for axis in "xyz"), Channel("temperature", "degC"))
    assert sensor.sample() == pytest.approx((1.0, -2.0, 0.5, 35.0), abs=0.002)
    assert all(math.isnan(number) for number in sensor.sample())
    assert bus.done


def test_what_the_wiring_says_about_numbers():
    """Noise bandwidth of a Butterworth filter of third order, one count, full scale; no pause while nothing streams."""
    sensor, _, _ = gyroscope([], range="250", bandwidth="20")
    assert sensor.bandwidth().value == pytest.approx(20 * math.pi / 3)
    assert sensor.bandwidth().unit == "Hz"
    assert sensor.resolution().value == pytest.approx(1 / 131)
    assert sensor.full_scale().value == 250.0
    assert sensor.longest_pause == 0.0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"range": "300"}, "'range' must be one of .* deg/s"),
        ({"rate": "2000"}, "'rate' must be one of .* Hz"),
        ({"bandwidth": "30"}, "'bandwidth' must be one of .*10, 20, 25, 40, 50, 80, 100.* Hz"),
        ({"range": "300", "lien": "1"}, "'range' must be one of .*: unknown key 'lien', did you mean 'line'"),
        ({"line": "-1"}, "'line' must be at least 0"),
        ({"line": "0.5"}, "'line' must be a whole number"),
    ],
)
def test_wiring_that_cannot_be(settings, message):
    """Each is refused with what there is."""
    with pytest.raises(Refused, match=message):
        gyroscope([], **settings)


def test_nothing_streams_before_begin():
    """Drain and end say so."""
    sensor, _, _ = gyroscope([])
    for call in (sensor.drain, sensor.end, sensor.sample, lambda: sensor.begin(100.0)):
        with pytest.raises(Refused):
            call()


def test_temperature():
    """25 degC at zero, 132.48 counts per kelvin, NaN where it is marked invalid, or beyond -40 and 105 degC."""
    assert CELSIUS.number(0) == 25.0
    assert CELSIUS.number(-3312) == pytest.approx(0.0)
    assert CELSIUS.number(-8611) == pytest.approx(-40.0, abs=0.01)
    assert CELSIUS.number(10598) == pytest.approx(105.0, abs=0.01)
    assert math.isnan(CELSIUS.number(-8612))
    assert math.isnan(CELSIUS.number(10599))
    assert math.isnan(CELSIUS.number(-32768))


def packet(header, *axes):
    """Return one packet."""
    return struct.pack(">B3hb", header, *axes, 0)


def test_packets_are_read_up_to_the_first_empty_one():
    """Headers of other packets are marked, flags of clocks are not looked at."""
    data = packet(0x20, 1, -2, 3) + packet(0x68, 9, 9, 9) + packet(0x23, 4, 5, 6) + b"\xff" * 8 + packet(0x20, 7, 7, 7)
    packets = FIFO.decode(data)
    assert packets.counts.tolist() == [[1, -2, 3], [9, 9, 9], [4, 5, 6]]
    assert packets.usable.tolist() == [True, False, True]
    assert len(FIFO.decode(b"").usable) == 0


def test_noise_by_range():
    """What the typical noise density leaves in counts: less than one where the range is wide."""
    assert gyroscope([], range="1000")[0]._sampling.noise < 1.0
    assert gyroscope([], range="125")[0]._sampling.noise == pytest.approx(0.0038 * math.sqrt(52.36) * 262, rel=1e-3)
