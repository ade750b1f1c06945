"""Modbus sessions: published frames, the bench's clock alone, and what became of every failure."""

from __future__ import annotations

import logging

import pytest
from scripted import ScriptedPort, late

from hil.clock.virtual import VirtualClock
from hil.instruments.modbus_session import ModbusSession
from hil.model.errors import Garbled, NoReply, Rejected

# The first two are published by the vendor of the relay board; the others follow from the same rule.
ON = bytes.fromhex("01 05 00 00 FF 00 8C 3A")
READ_COILS = bytes.fromhex("01 01 00 00 00 08 3D CC")
READ_VERSION = bytes.fromhex("01 03 80 00 00 01 AD CA")
VERSION_2_00 = bytes.fromhex("01 03 02 00 C8 B9 D2")
ALL_OFF = bytes.fromhex("01 0F 00 00 00 08 01 00 FE 95")


def framed(text):
    """Return the bytes with their CRC, computed bit by bit as the specification tells."""
    data = bytes.fromhex(text)
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return data + crc.to_bytes(2, "little")


COILS_5 = framed("01 01 01 05")


def session(*script, unit=1):
    """Return a session on a port that plays this script, and the port."""
    port = ScriptedPort(VirtualClock(), script)
    return ModbusSession("relays", port, port.clock, unit), port


def test_a_coil_is_switched_by_the_published_frame():
    """Function 05 with FF00, echoed."""
    modbus, port = session((ON, ON))
    modbus.write_coil(0, True)
    assert port.done


def test_a_coil_is_released_by_function_05_with_0000():
    """Off is 0000, never the vendor's toggle."""
    off = framed("01 05 00 07 00 00")
    modbus, port = session((off, off))
    modbus.write_coil(7, False)
    assert port.done


def test_all_coils_are_released_by_function_0f():
    """Address and count come back."""
    modbus, port = session((ALL_OFF, framed("01 0F 00 00 00 08")))
    modbus.write_coils(0, [False] * 8)
    assert port.done


def test_coils_are_read_low_bit_first():
    """Bit 0 of the first byte is the first coil."""
    modbus, _ = session((READ_COILS, COILS_5))
    assert modbus.read_coils(0, 8) == (True, False, True, False, False, False, False, False)


def test_holding_registers_are_read():
    """Function 03, the published frames of the version register."""
    modbus, _ = session((READ_VERSION, VERSION_2_00))
    assert modbus.read_holding(0x8000, 1) == (200,)


def test_a_register_is_written_by_function_06():
    """Address and value come back; another value is no echo."""
    request = framed("01 06 00 02 FF 60")
    modbus, port = session((request, request), (request, framed("01 06 00 02 FF 61")), (request, framed("01 86 02")))
    modbus.write_holding(2, 0xFF60)
    with pytest.raises(Garbled, match="the echo 01 06 00 02 ff 60"):
        modbus.write_holding(2, 0xFF60)
    with pytest.raises(Rejected, match="holding register 0x0002 set to 65376, unit 1 answered exception 2"):
        modbus.write_holding(2, 0xFF60)
    assert port.done


def test_a_reply_in_pieces_is_one_reply():
    """Bytes come one by one at 9600 baud."""
    pieces = tuple((0.001 * (number + 1), COILS_5[number : number + 1]) for number in range(len(COILS_5)))
    modbus, port = session((READ_COILS, pieces))
    assert modbus.read_coils(0, 8)[0]
    assert port.clock.now() == pytest.approx(0.006)


def test_a_dead_unit_is_no_reply_on_the_benchs_clock():
    """A read is asked three times, each within half a second."""
    modbus, port = session(*[(READ_COILS, b"")] * 3)
    with pytest.raises(NoReply, match=r"relays: asked for coils 0 to 7, unit 1 gave no reply within 0.5 s; check"):
        modbus.read_coils(0, 8)
    assert port.done
    assert port.longest_wait == 0.5
    assert port.clock.now() == pytest.approx(1.6)


def test_a_write_is_never_repeated():
    """What became of a write is the driver's to read back."""
    modbus, port = session((ON, b""))
    with pytest.raises(NoReply):
        modbus.write_coil(0, True)
    assert port.done


def test_a_half_frame_is_garbled():
    """The message shows what came."""
    modbus, port = session((ON, ON[:5]))
    with pytest.raises(Garbled, match="got 01 05 00 00 ff"):
        modbus.write_coil(0, True)
    assert port.clock.now() == pytest.approx(0.5)


def test_a_wrong_checksum_is_garbled():
    """A frame whose CRC is wrong is not believed."""
    modbus, _ = session(*[(READ_COILS, COILS_5[:-1] + b"\x00")] * 3)
    with pytest.raises(Garbled, match="expected a frame of unit 1, got 01 01 01 05"):
        modbus.read_coils(0, 8)


def test_a_damaged_reply_is_asked_for_again():
    """A read may be repeated, and then is."""
    modbus, port = session((READ_COILS, b"\x00\xff\x13"), (READ_COILS, COILS_5))
    assert modbus.read_coils(0, 8)[2]
    assert port.done


def test_a_stream_of_nonsense_ends_at_the_deadline():
    """A unit that never falls silent does not hang the bench."""
    chatter = tuple((0.01 * number, b"\xaa") for number in range(400))
    modbus, port = session((ON, chatter))
    with pytest.raises(Garbled):
        modbus.write_coil(0, True)
    assert port.clock.now() == pytest.approx(0.5, abs=0.011)


@pytest.mark.parametrize(
    ("reply", "expected"),
    [
        (framed("01 05 00 01 FF 00"), "the echo 01 05 00 00 ff 00 8c 3a"),
        (framed("01 05 00 00 00 00"), "the echo"),
        (framed("01 05 00 00 55 00"), "the echo"),
        (COILS_5, "a reply to function 05"),
        (framed("02 05 00 00 FF 00"), "a frame of unit 1"),
        (framed("01 81 02"), "a reply to function 05"),
    ],
)
def test_a_reply_to_something_else_is_garbled(reply, expected):
    """A sound frame is not enough: it must be the reply to this request."""
    modbus, _ = session((ON, reply))
    with pytest.raises(Garbled, match=expected):
        modbus.write_coil(0, True)


@pytest.mark.parametrize(
    ("request_bytes", "reply", "read"),
    [
        (READ_COILS, framed("01 01 02 05 00"), lambda modbus: modbus.read_coils(0, 8)),
        (READ_COILS, framed("01 01 00"), lambda modbus: modbus.read_coils(0, 8)),
        (READ_VERSION, framed("01 03 04 00 C8 00 00"), lambda modbus: modbus.read_holding(0x8000, 1)),
        (READ_VERSION, framed("01 03 03 00 C8 00"), lambda modbus: modbus.read_holding(0x8000, 1)),
        (READ_VERSION, framed("01 03 00"), lambda modbus: modbus.read_holding(0x8000, 1)),
    ],
)
def test_a_reply_of_the_wrong_length_is_garbled(request_bytes, reply, read):
    """Too many, too few or half registers are no answer, however good the checksum."""
    modbus, _ = session(*[(request_bytes, reply)] * 3)
    with pytest.raises(Garbled):
        read(modbus)


def test_the_wrong_count_after_function_0f_is_garbled():
    """The unit must repeat what it was told."""
    modbus, _ = session((ALL_OFF, framed("01 0F 00 00 00 04")))
    with pytest.raises(Garbled, match="address and count"):
        modbus.write_coils(0, [False] * 8)


@pytest.mark.parametrize(("code", "meaning"), [("02", "no such address"), ("06", "busy"), ("63", "does not name")])
def test_an_exception_is_rejected_with_its_meaning_and_not_repeated(code, meaning):
    """The unit answered; asking again would not help."""
    modbus, port = session((READ_VERSION, framed(f"01 83 {code}")))
    with pytest.raises(Rejected, match=meaning):
        modbus.read_holding(0x8000, 1)
    assert port.done


def test_a_late_echo_answers_no_later_request():
    """A reply that comes just after its time is waited for and thrown away."""
    modbus, port = session((ON, late(0.53, ON)), (READ_COILS, COILS_5))
    with pytest.raises(NoReply):
        modbus.write_coil(0, True)
    assert modbus.read_coils(0, 8)[0]
    assert modbus.discarded == len(ON)
    assert port.done


def test_a_very_late_echo_is_not_taken_for_coils():
    """A reply that comes in the middle of the next request is seen to be none of its own."""
    modbus, port = session((ON, late(0.6, ON)), (READ_COILS, late(0.1, COILS_5)), (READ_COILS, COILS_5))
    with pytest.raises(NoReply):
        modbus.write_coil(0, True)
    assert modbus.read_coils(0, 8)[0]
    assert port.done


def test_what_came_before_a_read_is_a_fault_and_no_reply():
    """A frame that waits may be the reply that another request should have got; nothing is sent."""
    modbus, port = session((READ_COILS, COILS_5))
    port.come(COILS_5)
    with pytest.raises(Garbled, match="01 01 01 05 .* arrived unsolicited"):
        modbus.read_coils(0, 8)
    assert port.written == []
    assert modbus.discarded == len(COILS_5)
    assert modbus.read_coils(0, 8)[0]


def test_a_quiet_gap_shows_the_reply_that_a_stale_frame_has_displaced():
    """A stale frame is read in place of the reply; the reply that comes after it gives it away."""
    modbus, _ = session((READ_COILS, ((0.0, COILS_5), (0.008, framed("01 01 01 07")))))
    modbus.read_coils(0, 8)
    with pytest.raises(Garbled, match="01 01 01 07 .* arrived"):
        modbus.must_be_quiet(0.02)


def test_silence_is_quiet():
    """A gap in which nothing comes is what it takes, and no more."""
    modbus, port = session((READ_COILS, COILS_5))
    modbus.read_coils(0, 8)
    modbus.must_be_quiet(0.02)
    assert port.clock.now() == pytest.approx(0.02)


def test_a_port_that_fails_is_no_reply():
    """An unplugged adapter is a fault of the bench, not a traceback."""
    modbus, _ = session((ON, OSError(5, "Input/output error")))
    with pytest.raises(NoReply, match="the port failed at coil 0 on"):
        modbus.write_coil(0, True)


def test_many_silences_close_nothing():
    """After any number of dead exchanges the session still works when the unit comes back."""
    modbus, port = session(*[(ON, b"")] * 12, (ON, ON))
    for _ in range(12):
        with pytest.raises(NoReply):
            modbus.write_coil(0, True)
    modbus.write_coil(0, True)
    assert port.done


def test_no_wall_clock_decides_anything(monkeypatch):
    """Pymodbus' reads of the wall clock are either not reached, or without effect."""

    def forbidden(*_args):
        raise AssertionError("the wall clock was used")

    ages = iter(range(0, 10**9, 10**6))
    monkeypatch.setattr("pymodbus.client.serial.time.time", forbidden)
    monkeypatch.setattr("pymodbus.client.serial.time.sleep", forbidden)
    monkeypatch.setattr("pymodbus.transaction.transaction.monotonic", lambda: next(ages))
    pieces = tuple((0.04 * (number + 1), COILS_5[number : number + 1]) for number in range(len(COILS_5)))
    modbus, port = session((READ_COILS, pieces), *[(READ_COILS, b"")] * 3)
    assert modbus.read_coils(0, 8)[0]
    with pytest.raises(NoReply):
        modbus.read_coils(0, 8)
    assert port.done


def test_nothing_of_pymodbus_reaches_the_log():
    """The library's own messages stay inside; ours are errors with a hint."""
    heard = []

    class Listener(logging.Handler):
        def emit(self, record):
            heard.append(record.getMessage())

    listener = Listener()
    logging.getLogger().addHandler(listener)
    modbus, _ = session((ON, framed("02 05 00 00 FF 00")))
    try:
        with pytest.raises(Garbled):
            modbus.write_coil(0, True)
    finally:
        logging.getLogger().removeHandler(listener)
    assert heard == []
