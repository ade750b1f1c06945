"""The LIS3MDL driver against its peer, through the simulated bus and under the virtual clock."""

from __future__ import annotations

import math

import pytest
from facing import facing

from hil.instruments.lis3mdl import Lis3mdl
from hil.model.bench import Wire
from hil.model.errors import DeviceFault, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.simulation.peers.lis3mdl import MODEL

SECOND = 1_000_000_000
LITTLE_NOISE = ["0.02", "0.02", "0.02"]


def magnetometer(*, faults=(), settings=None, **truth):
    """Return a role facing a sensor."""
    wire = Wire(role="magnetometer", instance="", instrument="device", settings=settings or {})
    truth.setdefault("noise", LITTLE_NOISE)
    return facing(
        MODEL, driver=lambda connection: Lis3mdl(connection).role(wire), truth=truth, faults=faults, address=0x1C
    )


@pytest.mark.parametrize("gauss", [4, 8, 12, 16])
@pytest.mark.parametrize("rate", ["5 Hz", "80 Hz", "155 Hz"])
def test_the_field_is_what_the_sensor_sees_at_every_range_and_rate(gauss, rate):
    """Offset and temperature of the article arrive as uT and degC."""
    settings = {"range": f"{gauss} gauss", "rate": rate}
    offset = ["48.0", "-22.5", "150.0"]
    with magnetometer(settings=settings, offset=offset, temperature="40.0") as (sensor, _):
        sensor.start()
        for _ in range(5):
            x, y, z, temperature = sensor.sample()
            assert (x, y, z) == pytest.approx((48.0, -22.5, 150.0), abs=0.2)
            assert temperature == 40.0


def test_samples_come_once_each_at_the_sensors_rate():
    """Two hundred samples at 80 Hz take two and a half seconds, and none comes twice."""
    with magnetometer(noise=["0.32", "0.32", "0.41"]) as (sensor, clock):
        sensor.start()
        began = clock.now()
        samples = [sensor.sample() for _ in range(200)]
        assert clock.now() - began == pytest.approx(199 / 80, abs=0.01)
        assert len({sample[:3] for sample in samples}) > 190


def test_identity():
    """WHO_AM_I names the type."""
    with facing(MODEL, driver=Lis3mdl, address=0x1C) as (driver, _):
        assert driver.identify() == Identity(model="LIS3MDL")


def test_another_device_at_the_address():
    """It is named in the identity, and start refuses it."""
    faults = [{"kind": "identity", "value": "0x68"}]
    with facing(MODEL, driver=Lis3mdl, address=0x1C, faults=faults) as (driver, _):
        assert driver.identify().model == "WHO_AM_I 0x68"
    with magnetometer(faults=faults) as (sensor, _), pytest.raises(WrongIdentity):
        sensor.start()


def test_a_saturated_sensor_gives_nan_and_a_temperature():
    """A field beyond the range is no number, however long it lasts."""
    faults = [{"kind": "saturated", "from": "1 s", "until": "2 s"}]
    with magnetometer(faults=faults) as (sensor, clock):
        sensor.start()
        clock.wait_until(SECOND + SECOND // 50)
        for _ in range(40):
            *axes, temperature = sensor.sample()
            assert all(math.isnan(axis) for axis in axes)
            assert temperature == 25.0
        clock.wait_until(2 * SECOND + SECOND // 50)
        assert not any(math.isnan(number) for number in sensor.sample())


def test_a_wider_range_holds_what_a_narrow_one_cannot():
    """500 uT is beyond 4 gauss, and within 8."""
    with magnetometer(offset=["500", "0", "0"]) as (sensor, _):
        sensor.start()
        assert math.isnan(sensor.sample()[0])
    with magnetometer(offset=["500", "0", "0"], settings={"range": "8 gauss"}) as (sensor, _):
        sensor.start()
        assert sensor.sample()[0] == pytest.approx(500.0, abs=0.2)


def test_a_stuck_sensor_is_no_reply():
    """Its flags go on and its numbers do not."""
    with magnetometer(faults=[{"kind": "stuck", "from": "1 s"}]) as (sensor, clock):
        sensor.start()
        clock.wait_until(SECOND)
        with pytest.raises(NoReply, match="16 samples in a row are equal"):
            for _ in range(20):
                sensor.sample()


def test_a_dead_sensor_is_no_reply_at_once():
    """A missing acknowledge needs no waiting."""
    with magnetometer(faults=[{"kind": "dead", "from": "1 s"}]) as (sensor, clock):
        sensor.start()
        clock.wait_until(SECOND)
        with pytest.raises(NoReply, match="no acknowledge at address 0x1c"):
            sensor.sample()
        assert clock.now() == pytest.approx(1.0, abs=0.001)


def test_stop_and_start_again():
    """Asleep there is no sample; awake there is a new one, never the old one."""
    with magnetometer() as (sensor, _):
        sensor.start()
        sensor.sample()
        sensor.stop()
        with pytest.raises(Refused, match="has not been started"):
            sensor.sample()
        sensor.start()
        assert len(sensor.sample()) == 4


def test_a_garbled_bus_does_not_start():
    """Flipped bits in the name or in the settings are found out."""
    with magnetometer(faults=[{"kind": "garbled"}]) as (sensor, _), pytest.raises((WrongIdentity, Rejected)):
        sensor.start()


def test_a_start_while_settings_are_garbled_is_refused_or_right():
    """Whenever the disturbance begins, a start that succeeds has set what it should."""
    for step in range(1, 60):
        begins = f"{step * 25} us"
        with magnetometer(faults=[{"kind": "garbled", "from": begins, "until": "2 ms"}]) as (sensor, clock):
            try:
                sensor.start()
            except DeviceFault:
                continue
            clock.wait_until(SECOND)
            assert sensor.sample()[3] == 25.0
