"""The driver `obc-link`: identity, role, analogue inputs and bus."""

from __future__ import annotations

import math
import struct

import pytest
from scripted_obc import ADC, SPEED, ScriptedObc

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.obc_link.driver import ObcLink
from hil.model.bench import Wire
from hil.model.errors import Garbled, Refused
from hil.model.identity import Identity


@pytest.fixture
def port():
    """The line with a board at its end."""
    return ScriptedObc(VirtualClock())


@pytest.fixture
def driver(port):
    """The driver at its port."""
    return ObcLink(Connection(device="obc", clock=port.clock, clamps=Clamps(), port=port))


@pytest.fixture
def board(driver):
    """The role that the driver fills."""
    return driver.role(Wire(role="obc", instance="", instrument="obc"))


def adc(total, squares, *, channel=2, count=64):
    """Return the reply to ADC."""
    return lambda _: struct.pack("<BBHIQHH", 0, channel, count, total, squares, 4095, 3300)


def test_making_a_driver_sends_nothing(driver, port):
    """Driver, role and bus come to life without a byte."""
    driver.bus()
    driver.role(Wire(role="obc", instance="", instrument="obc"))
    assert port.lines == []
    assert driver.outlets() == ()


def test_identity(driver):
    """The firmware's name, the chip's unique id, and version with build are the identity."""
    assert driver.identify() == Identity(
        model="hil-obc", serial="000102030405060708090a0b", firmware="1.0.0+9f9f9f9f9f9f9f9f"
    )
    assert driver.session.damaged == 0


def test_the_role_says_who_it_is(board):
    """The role's identity names protocol, firmware and build."""
    assert board.identify() == "protocol 1.0, hil-obc 1.0.0, build 9f9f9f9f9f9f9f9f"


def test_analogue_input(board, port):
    """The mean of 64 conversions in V; its uncertainty holds the converter's step and the scatter of the mean."""
    port.answers[ADC] = adc(64 * 2048, 64 * 2048**2)
    quiet = board.analog(2)
    step = 3.3 / 4095
    assert (quiet.value, quiet.unit) == (pytest.approx(2048 * step), "V")
    assert quiet.uncertainty == pytest.approx(step / math.sqrt(12))
    assert port.requests[-1].payload == struct.pack("<BH", 2, 64)
    port.answers[ADC] = adc(64 * 2048, 32 * 2038**2 + 32 * 2058**2)
    variance = 64 * 10**2 / 63
    assert board.analog(2).uncertainty == pytest.approx(step * math.sqrt(variance / 64 + 1 / 12))


def test_an_input_at_full_scale_has_no_number(board, port):
    """An input at the reference or above is NaN."""
    port.answers[ADC] = adc(64 * 4095, 64 * 4095**2)
    assert math.isnan(board.analog(2).value)


def test_conversions_of_another_channel_are_garbled(board, port):
    """A reply about another channel is nonsense."""
    port.answers[ADC] = adc(0, 0, channel=3)
    with pytest.raises(Garbled, match="channel 2, got 64 of 3"):
        board.analog(2)


@pytest.mark.parametrize("channel", [-1, 6, 77, 256])
def test_an_input_that_the_board_does_not_have_is_refused(board, port, channel):
    """The sentence names the board, the number and the inputs there are; no byte is sent."""
    board.identify()
    sent = len(port.requests)
    with pytest.raises(Refused, match=f"obc: no analogue input has the number {channel}; its inputs are 0 to 5$"):
        board.analog(channel)
    assert len(port.requests) == sent


def test_the_bus_has_its_frequency(driver, port):
    """The frequency of the bench file goes to the board before the first transfer."""
    port.answers[3] = lambda _: bytes.fromhex("00 01 00 0000")
    driver.bus(400e3).write_byte(0x68, 1)
    speed = next(request for request in port.requests if request.kind == SPEED)
    assert speed.payload == struct.pack("<BI", 0, 400_000)


def test_other_roles_and_places_are_refused(driver, port):
    """The driver does not fill the role supply, takes no settings, and is reached by a port."""
    with pytest.raises(Refused, match="does not fill the role supply"):
        driver.role(Wire(role="supply", instance="", instrument="obc"))
    with pytest.raises(Refused, match="unknown key 'speed'"):
        driver.role(Wire(role="obc", instance="", instrument="obc", settings={"speed": "1"}))
    with pytest.raises(Refused, match="reached by a port"):
        ObcLink(Connection(device="obc", clock=port.clock, clamps=Clamps()))
