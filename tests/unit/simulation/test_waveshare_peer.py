"""The simulated relay board: requests, refusals, silence, contacts."""

from __future__ import annotations

import pytest
from twin import Twin

from hil.clock.virtual import VirtualClock
from hil.simulation.peers.modbus_rtu import FrameReader, seal
from hil.simulation.world import DeviceClock


@pytest.fixture
def twin():
    """Return a twin."""
    return Twin()


def ask(twin, body: str) -> str:
    """Send a body with its checksum and return the answer without its own."""
    answer = twin.exchange("relays", seal(bytes.fromhex(body)))
    assert not answer or seal(answer[:-2]) == answer
    return answer[:-2].hex(" ").upper()


def test_contacts_follow_their_coils(twin):
    """A coil moves its plant input after the operate time, and reads back at once."""
    ask(twin, "01 05 00 00 FF 00")
    assert twin.coil.inputs["contact_a"] is True
    assert twin.coil.inputs["contact_b"] is False
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 01"
    ask(twin, "01 05 00 01 55 00")
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 03"
    ask(twin, "01 05 00 01 55 00")
    assert twin.coil.inputs["contact_b"] is False


def test_contact_takes_its_time(twin):
    """After the frame's end (3.5 characters) and 8 ms the contact has moved, not before."""
    silence = 3.5 * 11 / 9600
    twin.lines["relays"].write(seal(bytes.fromhex("01050000FF00")))
    twin.clock.sleep(silence + 0.0079)
    assert twin.coil.inputs["contact_a"] is False
    twin.clock.sleep(0.0002)
    assert twin.coil.inputs["contact_a"] is True


def test_last_command_counts_for_a_contact_on_its_way():
    """On, off and on again within the operate time closes the contact once, after the last command."""
    twin = Twin(truths={"relays": {"operate_time": "0.03"}})
    line = twin.lines["relays"]
    for value in ("FF00", "0000", "FF00"):
        line.write(seal(bytes.fromhex(f"01050000{value}")))
        twin.clock.sleep(0.005)
    twin.clock.sleep(0.025)
    assert twin.coil.inputs["contact_a"] is False
    twin.clock.sleep(0.01)
    assert twin.coil.inputs["contact_a"] is True


@pytest.mark.parametrize(("baud", "silence_us"), [(9600, 4010), (19200, 2005), (38400, 1750), (115200, 1750)])
def test_silence_that_ends_a_frame(baud, silence_us):
    """It is 3.5 characters up to 19,200 baud, and 1.75 ms above."""
    clock, frames = VirtualClock(), []
    reader = FrameReader(baud, frames.append)
    reader.attach(DeviceClock(clock, 1))
    reader.receive(b"\x01")
    clock.wait_until(silence_us * 1000 - 1000)
    assert frames == []
    clock.wait_until(silence_us * 1000 + 1000)
    assert frames == [b"\x01"]


def test_several_coils_at_once(twin):
    """0F writes a range and leaves the others; 00FF of 05 reaches all."""
    assert ask(twin, "01 0F 00 01 00 03 01 05") == "01 0F 00 01 00 03"
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 0A"
    assert ask(twin, "01 01 00 01 00 02") == "01 01 01 01"
    ask(twin, "01 05 00 FF FF 00")
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 FF"
    ask(twin, "01 05 00 FF 00 00")
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 00"


@pytest.mark.parametrize(
    ("body", "answer"),
    [
        ("01 02 00 00 00 08", "01 82 01"),
        ("01 10 00 00 00 01 02 00 00", "01 90 01"),
        ("01 05 00 08 FF 00", "01 85 02"),
        ("01 05 00 00 12 34", "01 85 03"),
        ("01 01 00 04 00 08", "01 81 02"),
        ("01 01 00 00 00 00", "01 81 03"),
        ("01 01 00 00 00 09", "01 81 03"),
        ("01 01 00", "01 81 03"),
        ("01 0F 00 00 00 08 02 FF 00", "01 8F 03"),
        ("01 0F 00", "01 8F 03"),
        ("01 03 00 00 00 01", "01 83 02"),
        ("01 03 40 00 00 02", "01 83 03"),
        ("01 06 40 00 00 00", "01 86 03"),
        ("01 06 20 00 07 00", "01 86 03"),
        ("01 06 12 34 00 00", "01 86 02"),
    ],
)
def test_refusals(twin, body, answer):
    """What it does not know, where there is nothing, and what has no meaning are exceptions 1, 2 and 3."""
    assert ask(twin, body) == answer
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 00"


def test_silence_for_others_and_for_broken_frames(twin):
    """Another address, a wrong checksum, and a frame cut in two by silence get no answer and no effect."""
    assert ask(twin, "02 05 00 00 FF 00") == ""
    assert twin.modbus("01 05 00 00 FF 00 8C 3B") == ""
    assert twin.modbus("01 05 00 00") == ""
    assert twin.modbus("FF 00 8C 3A") == ""
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 00"


def test_frame_may_come_in_pieces(twin):
    """Pauses shorter than 3.5 characters do not end a frame."""
    line = twin.lines["relays"]
    for byte in bytes.fromhex("01050000FF008C3A"):
        line.write(bytes([byte]))
        twin.clock.sleep(0.002)
    twin.clock.sleep(0.1)
    assert line.read(line.waiting(), 0).hex() == "01050000ff008c3a"


def test_broadcast_is_carried_out_without_an_answer(twin):
    """Address 0 switches every board, and none of them answers."""
    assert ask(twin, "00 05 00 00 FF 00") == ""
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 01"


def test_address_can_be_changed(twin):
    """After 06 to 4000h the board answers to its new address only."""
    assert ask(twin, "01 06 40 00 00 07") == "01 06 40 00 00 07"
    assert ask(twin, "01 01 00 00 00 08") == ""
    assert ask(twin, "07 03 40 00 00 01") == "07 03 02 00 07"


def test_contact_welded_from_the_start():
    """It reads released and is closed."""
    twin = Twin(truths={"relays": {"welded": ["2"]}})
    assert ask(twin, "01 01 00 00 00 08") == "01 01 01 00"
    assert twin.coil.inputs["contact_b"] is True
    ask(twin, "01 05 00 01 00 00")
    assert twin.coil.inputs["contact_b"] is True


def test_a_relay_that_is_closed_for_a_time_opens_by_itself(twin):
    """700 ms after the last such command, whatever came before; another command ends the time."""
    ask(twin, "01 05 02 00 00 07")
    twin.clock.sleep(0.5)
    ask(twin, "01 05 02 00 00 07")
    twin.clock.sleep(0.6)
    assert twin.coil.inputs["contact_a"] is True
    twin.clock.sleep(0.2)
    assert twin.coil.inputs["contact_a"] is False
    ask(twin, "01 05 02 00 00 07")
    ask(twin, "01 05 00 00 FF 00")
    twin.clock.sleep(5.0)
    assert twin.coil.inputs["contact_a"] is True
    ask(twin, "01 05 04 00 00 07")
    twin.clock.sleep(0.5)
    assert twin.coil.inputs["contact_a"] is False
    twin.clock.sleep(0.3)
    assert twin.coil.inputs["contact_a"] is True


@pytest.mark.parametrize(
    ("body", "code"), [("01 05 02 08 00 07", "02"), ("01 05 02 00 00 00", "03"), ("01 05 02 00 80 00", "03")]
)
def test_a_time_that_it_does_not_have_is_refused(twin, body, code):
    """Eight relays, and 15 bits of tenths of a second."""
    assert ask(twin, body) == f"01 85 {code}"
