"""The golden frames of the protocol's page, read out of the page, in both directions."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import pytest

from hil.instruments.obc_link import messages
from hil.instruments.obc_link.frames import crc, seal, unseal
from hil.wire.streaming import FifoRead, RegisterRead

PAGE = (Path(__file__).parents[4] / "docs" / "reference" / "obc-link.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| \d+ \| (host|device) \| ([^|]+) \| `([0-9A-F ]+)` \|", PAGE, re.MULTILINE)
GOLDEN = {name: bytes.fromhex(text) for _, name, text in ROWS}
GOOD = sorted(set(GOLDEN) - {"bad CRC"})


def payload(name):
    """Return the payload of a golden frame."""
    return unseal(GOLDEN[name][:-1]).payload


def test_the_page_has_its_frames():
    """The walks below find what the page shows."""
    assert len(GOLDEN) == len(ROWS) == 30


def test_crc_has_the_published_check_value():
    """CRC-16/CCITT-FALSE of 123456789 is 29B1."""
    assert crc(b"123456789") == 0x29B1


@pytest.mark.parametrize("name", GOOD)
def test_golden_frames_open_and_close_again(name):
    """Every good frame decodes, and the same frame encodes to the same bytes."""
    frame = unseal(GOLDEN[name][:-1])
    assert frame.version == 1
    assert seal(frame.kind, frame.sequence, frame.payload) == GOLDEN[name]


def test_the_wrong_crc_is_refused():
    """The frame with one wrong bit is none."""
    with pytest.raises(ValueError, match="CRC"):
        unseal(GOLDEN["bad CRC"][:-1])


def test_identify():
    """The reply to IDENTIFY says what the page says."""
    board = messages.identification(payload("IDENTIFY reply")[1:])
    assert (board.major, board.minor, board.name, board.firmware) == (1, 0, "hil-obc", "1.0.0")
    assert (board.build, board.unique_id) == ("9f3c21d07be45a18", "20373257533055100041002b")
    assert (board.boots, messages.reason_text(board.reason)) == (41, "power-on or brown-out")
    assert (board.buses, board.lines, board.channels, board.streams) == (1, 2, 6, 1)
    assert (board.transfers, board.messages, board.largest_frame, board.ring) == (8, 8, 2048, 16384)


def test_time_is_as_long_as_its_reply():
    """Request and reply of TIME take the same time on the line."""
    assert len(GOLDEN["TIME request"]) == len(GOLDEN["TIME reply"])


def test_adc():
    """The reply to ADC gives the voltage that the page says."""
    found = messages.conversions(payload("ADC reply")[1:])
    volts = found.total / found.taken / found.full_scale * found.reference_mv / 1000
    assert (found.channel, found.taken, round(volts, 4)) == (2, 16, 1.6504)


def test_stream_program():
    """The program of the page is what the driver sends for the same transfers."""
    transfers = [
        RegisterRead(address=0x68, register=0x1D, length=2),
        FifoRead(address=0x68, count_register=0x2E, unit=1, record=8, data_register=0x30, most=1024),
    ]
    assert messages.program(0, 0, transfers, None, 0) == payload("STREAM_START request")
    timer = messages.program(0, 0, transfers, 1_000_000, None)
    assert timer[2:7] == struct.pack("<BI", 0, 1_000_000)


@pytest.mark.parametrize(
    ("name", "number", "lost", "device_s", "lengths"),
    [
        ("STREAM_DATA", 0, 0, 8.020113, (2, 16)),
        ("STREAM_DATA after loss", 7, 2, 8.16012, (None, 0)),
        ("STREAM_DATA, long", 8, 2, 8.180121, (2, 400)),
    ],
)
def test_stream_data(name, number, lost, device_s, lengths):
    """Stream data says what the page says."""
    frame = messages.stream_frame(payload(name))
    assert (frame.number, frame.lost, frame.device_s) == (number, lost, device_s)
    assert tuple(None if reply is None else len(reply) for reply in frame.replies) == lengths


def test_long_stream_data_holds_its_bytes():
    """Byte i of the long frame's FIFO is 1 + (7 i mod 255)."""
    data = messages.stream_frame(payload("STREAM_DATA, long")).replies[1]
    assert data == bytes(1 + 7 * index % 255 for index in range(400))


def test_boot_and_event():
    """Boot notice and event say what the page says."""
    notice = messages.started(payload("BOOT"))
    assert (notice.boots, messages.reason_text(notice.reason)) == (42, "independent watchdog")
    told = messages.event(payload("EVENT"))
    assert (told.event, told.detail) == (1, 2000)


@pytest.mark.parametrize("read", [messages.identification, messages.conversions, messages.stream_frame])
def test_cut_payloads_are_refused(read):
    """A payload that is too short is a ValueError, whatever reads it."""
    with pytest.raises(ValueError, match="expected"):
        read(b"\0\0\0")


def test_stream_data_with_missing_bytes_is_refused():
    """A transfer that announces more than there is, is refused."""
    with pytest.raises(ValueError, match="missing"):
        messages.stream_frame(payload("STREAM_DATA")[:-1])
