"""The magnetometer's peer against registers and bytes that its datasheet and its users publish."""

from __future__ import annotations

from twin import Twin


def test_identity_and_power_on_values():
    """WHO_AM_I is 3Dh; CTRL_REG1..5 are 10h, 00h, 03h, 00h, 00h; nothing is measured yet."""
    twin = Twin()
    twin.power_sensor()
    assert twin.register(0x0F) == 0x3D
    assert twin.burst(0xA0, 5) == bytes.fromhex("1000030000")
    assert twin.burst(0xA7, 9) == bytes(9)


def test_one_gauss_in_every_range():
    """One gauss reads 6842, 3421, 2281, 1711."""
    for ctrl2, reading in ((0x00, 6842), (0x20, 3421), (0x40, 2281), (0x60, 1711)):
        twin = Twin(truths={"mag": {"noise": ["0", "0", "0"]}}, coil={"earth_field": ["100", "-100", "0"]})
        twin.wake_sensor(ctrl2=ctrl2)
        twin.clock.sleep(0.1)
        assert twin.field() == (reading, -reading, 0)


def test_temperature_is_zero_at_25_degrees():
    """Eight counts per degree: 0 at 25 degC, 80 at 35 degC."""
    for ambient, reading in (("25", 0), ("35", 80), ("-10.5", -284)):
        twin = Twin(coil={"ambient": ambient})
        twin.wake_sensor()
        twin.clock.sleep(0.1)
        assert int.from_bytes(twin.burst(0xAE, 2), "little", signed=True) == reading


def test_temperature_cannot_be_read_after_the_axes():
    """The published trap: the burst of eight from 28h gives X where the temperature was expected."""
    twin = Twin(coil={"ambient": "30"})
    twin.wake_sensor()
    twin.clock.sleep(0.1)
    burst = twin.burst(0xA8, 8)
    assert burst[6:] == burst[:2] != twin.burst(0xAE, 2) == bytes([40, 0])
