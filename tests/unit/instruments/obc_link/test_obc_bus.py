"""The I2C bus behind the board: what each operation of smbus2 sends, and what failures become."""

from __future__ import annotations

import errno
import struct

import pytest
from scripted_obc import I2C, IDENTIFY, SPEED, ScriptedObc, boot_notice, identity
from smbus2 import i2c_msg

from hil.clock.virtual import VirtualClock
from hil.instruments.obc_link.bus import ObcBus
from hil.instruments.obc_link.session import ObcSession
from hil.model.errors import DeviceFault, Garbled, Refused


@pytest.fixture
def port():
    """The line with a board at its end."""
    return ScriptedObc(VirtualClock())


@pytest.fixture
def bus(port):
    """A bus at 400 kHz."""
    return ObcBus(ObcSession("obc", port, port.clock), port.clock, frequency_hz=400_000)


def results(*pairs):
    """Return the payload of a reply to I2C from status and bytes of each message."""
    body = b"".join(struct.pack("<BH", status, len(data)) + data for status, data in pairs)
    return lambda _: bytes((0, len(pairs))) + body


WRITTEN = (0, b"")
OPERATIONS = [
    ("read_byte", (0x68,), "00 01 68 01 0100", [(0, b"\x5a")], 0x5A),
    ("write_byte", (0x68, 7), "00 01 68 00 0100 07", [WRITTEN], None),
    ("read_byte_data", (0x68, 0x75), "00 02 68 00 0100 75 68 01 0100", [WRITTEN, (0, b"\x6f")], 0x6F),
    ("write_byte_data", (0x68, 0x4E, 15), "00 01 68 00 0200 4e 0f", [WRITTEN], None),
    ("read_word_data", (0x68, 1), "00 02 68 00 0100 01 68 01 0200", [WRITTEN, (0, b"\x34\x12")], 0x1234),
    ("write_word_data", (0x68, 1, 0x1234), "00 01 68 00 0300 01 34 12", [WRITTEN], None),
    ("read_i2c_block_data", (0x68, 1, 3), "00 02 68 00 0100 01 68 01 0300", [WRITTEN, (0, b"abc")], [97, 98, 99]),
    ("write_i2c_block_data", (0x68, 1, [2, 3]), "00 01 68 00 0300 01 02 03", [WRITTEN], None),
]


@pytest.mark.parametrize(("name", "arguments", "sent", "replies", "value"), OPERATIONS, ids=lambda v: str(v)[:22])
def test_operations(bus, port, name, arguments, sent, replies, value):
    """Each operation sends these messages and returns what they read."""
    port.answers[I2C] = results(*replies)
    assert getattr(bus, name)(*arguments) == value
    assert port.requests[-1].payload == bytes.fromhex(sent)


def test_combined_messages_fill_their_reads(bus, port):
    """i2c_rdwr runs messages longer than a block, zeros included, and fills the reads."""
    data = bytes(range(200)) * 2
    port.answers[I2C] = results(WRITTEN, (0, data))
    write, read = i2c_msg.write(0x68, [0x30]), i2c_msg.read(0x68, 400)
    bus.i2c_rdwr(write, read)
    assert bytes(read) == data
    assert port.requests[-1].payload == bytes.fromhex("00 02 68 00 0100 30 68 01 9001")


@pytest.mark.parametrize(
    ("status", "number"),
    [(1, errno.EREMOTEIO), (2, errno.EREMOTEIO), (3, errno.EIO), (4, errno.ETIMEDOUT)],
)
def test_failures_on_the_bus_are_errors_of_the_system(bus, port, status, number):
    """A missing acknowledge is EREMOTEIO, a held bus ETIMEDOUT, anything else EIO; the link itself is well."""
    port.answers[I2C] = results((status, b""), (5, b""))
    with pytest.raises(OSError, match="at address 0x68 behind obc") as caught:
        bus.read_byte_data(0x68, 0x75)
    assert caught.value.errno == number


@pytest.mark.parametrize("replies", [[WRITTEN], [WRITTEN, (0, b"ab")], [WRITTEN, (9, b"")], [(0, b"x"), (0, b"a")]])
def test_replies_to_other_questions_are_garbled(bus, port, replies):
    """Another number of messages, other lengths or an unknown status are nonsense of the board."""
    port.answers[I2C] = results(*replies)
    with pytest.raises(Garbled, match="obc: the reply to I2C is nonsense"):
        bus.read_byte_data(0x68, 0x75)


def test_the_speed_is_set_once_before_the_first_transfer(bus, port):
    """The bus speed goes to the board right after it was met, and not again."""
    port.answers[I2C] = results(WRITTEN)
    bus.write_byte(0x68, 1)
    bus.write_byte(0x68, 2)
    assert port.asked() == [IDENTIFY, SPEED, I2C, I2C]
    assert port.requests[1].payload == struct.pack("<BI", 0, 400_000)


def test_the_speed_is_set_again_after_a_reset(bus, port):
    """A board that has started over has forgotten its speed."""
    port.answers[I2C] = results(WRITTEN)
    bus.write_byte(0x68, 1)
    port.before = boot_notice(42)
    with pytest.raises(DeviceFault, match="restarted"):
        bus.write_byte(0x68, 2)
    port.answers[IDENTIFY] = lambda _: identity(boots=42)
    bus.write_byte(0x68, 3)
    assert port.asked()[-3:] == [IDENTIFY, SPEED, I2C]


def test_too_much_is_refused_before_it_is_sent(bus, port):
    """More messages, or more bytes, than the board takes are not sent."""
    with pytest.raises(Refused, match="too much for it"):
        bus.i2c_rdwr(*[i2c_msg.read(0x68, 1) for _ in range(9)])
    with pytest.raises(Refused, match="too much for it"):
        bus.i2c_rdwr(i2c_msg.write(0x68, [0] * 2048))
    assert I2C not in port.asked()


def test_blocks_hold_32_bytes(bus):
    """Longer blocks are an error of the caller, as smbus2 has it."""
    with pytest.raises(ValueError, match="a block holds 32 bytes, not 33"):
        bus.read_i2c_block_data(0x68, 0, 33)
    with pytest.raises(ValueError, match="a block holds 32 bytes, not 33"):
        bus.write_i2c_block_data(0x68, 0, [0] * 33)
