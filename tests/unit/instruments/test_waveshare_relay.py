"""Waveshare relay board: published frames, named contacts, everything read back."""

from __future__ import annotations

import pytest
from scripted import ScriptedPort

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection, Outlet
from hil.instruments.waveshare_relay import WaveshareRelay
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity

READ = bytes.fromhex("01 01 00 00 00 08 3D CC")
NONE_ON = bytes.fromhex("01 01 01 00 51 88")
FIRST_ON = bytes.fromhex("01 01 01 01 90 48")
CLOSE_1 = bytes.fromhex("01 05 00 00 FF 00 8C 3A")
OPEN_1 = bytes.fromhex("01 05 00 00 00 00 CD CA")
ALL_OFF = bytes.fromhex("01 0F 00 00 00 08 01 00 FE 95")
ALL_OFF_DONE = bytes.fromhex("01 0F 00 00 00 08 54 0D")
READ_VERSION = bytes.fromhex("01 03 80 00 00 01 AD CA")
WIRE = Wire(role="relays", instance="", instrument="board", contacts={"heater": 1, "lamp": 2})


def driver(*script, address=0):
    """Return a driver on a port that plays this script, and the port."""
    port = ScriptedPort(VirtualClock(), script)
    return WaveshareRelay(
        Connection(device="board", clock=port.clock, clamps=Clamps(), port=port, address=address)
    ), port


def test_closing_a_contact_is_read_back():
    """Contact 1 is coil 0."""
    board, port = driver((CLOSE_1, CLOSE_1), (READ, FIRST_ON))
    board.role(WIRE).close("heater")
    assert port.done


def test_opening_a_contact_is_read_back():
    """Off is function 05 with 0000."""
    board, port = driver((OPEN_1, OPEN_1), (READ, NONE_ON))
    board.role(WIRE).open("heater")
    assert port.done


def test_release_all_is_one_frame_for_the_whole_board():
    """Function 0F, then all eight are read."""
    board, port = driver((ALL_OFF, ALL_OFF_DONE), (READ, NONE_ON))
    board.role(WIRE).release_all()
    assert port.done


def test_closed_names_only_the_wires_own_contacts():
    """A relay that the wire does not name is not reported."""
    board, _ = driver((READ, bytes.fromhex("01 01 01 07 10 4A")))
    assert board.role(WIRE).closed() == ("heater", "lamp")


def test_a_relay_that_reads_back_otherwise_is_rejected():
    """An acknowledgement alone proves nothing."""
    board, _ = driver((CLOSE_1, CLOSE_1), (READ, NONE_ON))
    with pytest.raises(Rejected, match="the board acknowledged, but reads back relay 1 otherwise"):
        board.role(WIRE).close("heater")


def test_one_relay_that_stays_on_spoils_release_all():
    """Every relay of the board is compared."""
    board, _ = driver((ALL_OFF, ALL_OFF_DONE), (READ, FIRST_ON))
    with pytest.raises(Rejected, match="relay 1 otherwise"):
        board.role(WIRE).release_all()


@pytest.mark.parametrize("echo", [b"", CLOSE_1[:4], b"\xff" * 8])
def test_a_lost_or_damaged_echo_is_forgiven_where_the_relay_closed(echo):
    """The setting is not repeated; what it became is read."""
    board, port = driver((CLOSE_1, echo), (READ, FIRST_ON))
    board.role(WIRE).close("heater")
    assert port.done


@pytest.mark.parametrize(("echo", "error"), [(b"", NoReply), (CLOSE_1[:4], Garbled)])
def test_a_lost_echo_is_a_fault_where_the_relay_did_not_close(echo, error):
    """The first thing that went wrong is what is reported."""
    board, port = driver((CLOSE_1, echo), (READ, NONE_ON))
    with pytest.raises(error, match="asked for coil 0 on"):
        board.role(WIRE).close("heater")
    assert port.done


def test_a_refused_setting_is_rejected():
    """An exception of the board is reported with its meaning."""
    board, _ = driver((CLOSE_1, bytes.fromhex("01 85 04 43 53")))
    with pytest.raises(Rejected, match="it failed while it carried the request out"):
        board.role(WIRE).close("heater")


def test_an_unknown_contact_sends_nothing():
    """The error lists the contacts that exist."""
    board, port = driver()
    with pytest.raises(Refused, match="no contact 'heather'; its contacts are heater, lamp"):
        board.role(WIRE).close("heather")
    assert port.written == []


def test_it_is_identified_by_its_version_register():
    """Model and firmware are what could be verified; nobody knows a serial number."""
    board, _ = driver((READ_VERSION, bytes.fromhex("01 03 02 00 C8 B9 D2")), (READ, NONE_ON))
    assert board.identify() == Identity(model="Modbus RTU Relay", firmware="2.00")


@pytest.mark.parametrize("reply", [[("01 83 02 C0 F1")], [("01 03 02 00 00 B8 44"), "01 01 01 00 51 88"]])
def test_a_unit_without_that_register_is_nobody(reply):
    """An identity without a model can match no expectation."""
    board, _ = driver(*zip((READ_VERSION, READ), map(bytes.fromhex, reply), strict=False))
    assert board.identify() == Identity()


def test_outlets_are_numbered_as_the_board_prints_them():
    """1 to 8."""
    board, _ = driver((READ, FIRST_ON))
    outlets = board.outlets()
    assert outlets[0] == Outlet(1, on=True)
    assert outlets[1:] == tuple(Outlet(number, on=False) for number in range(2, 9))


def test_another_unit_address_is_used():
    """The bench file's address goes into every frame."""
    board, port = driver((bytes.fromhex("05 01 00 00 00 08 3C 48"), bytes.fromhex("05 01 01 00 50 B8")), address=5)
    board.outlets()
    assert port.done


@pytest.mark.parametrize(
    ("wire", "sentence"),
    [
        (Wire(role="supply", instance="", instrument="board"), "does not fill the role supply"),
        (Wire(role="relays", instance="", instrument="board"), "no contacts"),
        (Wire(role="relays", instance="", instrument="board", contacts={"a": 0}), "contact a is relay 0"),
        (Wire(role="relays", instance="", instrument="board", contacts={"a": 9}), "contact a is relay 9"),
        (
            Wire(role="relays", instance="", instrument="board", contacts={"a": 1}, settings={"toggle": "1"}),
            "unknown key 'toggle'",
        ),
    ],
)
def test_wires_that_it_cannot_serve_are_refused(wire, sentence):
    """The sentence says what is wrong with the wire."""
    board, port = driver()
    with pytest.raises(Refused, match=sentence):
        board.role(wire)
    assert port.written == []


def test_it_is_reached_by_a_port():
    """A bench file that gives it a bus is refused."""
    with pytest.raises(Refused, match="reached by a port"):
        WaveshareRelay(Connection(device="board", clock=VirtualClock(), clamps=Clamps()))
