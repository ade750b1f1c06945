"""The relay board's driver against its peer, through the simulated port and under the virtual clock."""

from __future__ import annotations

from dataclasses import replace

import pytest
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.waveshare_relay import WaveshareRelay
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.waveshare_relay import MODEL

WIRE = Wire(role="relays", instance="", instrument="device", contacts={"heater": 1, "lamp": 4, "valve": 8})


def board(*, faults=(), truth=None, address=0):
    """Return a driver facing a board on a 9600 baud line."""
    return facing(MODEL, driver=WaveshareRelay, truth=truth, faults=faults, baud=9600, address=address)


def test_the_whole_role_on_a_healthy_board():
    """Closed, opened, all released; every answer is the peer's own."""
    with board() as (driver, _):
        relays = driver.role(WIRE)
        assert relays.closed() == ()
        relays.close("valve")
        relays.close("heater")
        relays.close("lamp")
        assert relays.closed() == ("heater", "lamp", "valve")
        relays.open("lamp")
        assert relays.closed() == ("heater", "valve")
        relays.release_all()
        assert relays.closed() == ()


def test_closing_twice_leaves_it_closed():
    """No command toggles."""
    with board() as (driver, _):
        relays = driver.role(WIRE)
        relays.close("heater")
        relays.close("heater")
        assert relays.closed() == ("heater",)


def test_identity_and_outlets():
    """The version register is what can be verified."""
    with board() as (driver, _):
        assert driver.identify() == Identity(model="Modbus RTU Relay", firmware="SIMULATED")
        driver.role(WIRE).close("lamp")
        assert [outlet for outlet in driver.outlets() if outlet.on] == [Outlet(4, on=True)]
        assert len(driver.outlets()) == 8


def test_another_address_is_another_board():
    """The right address is answered, the wrong one is silence."""
    with board(truth={"address": "5"}, address=5) as (driver, _):
        assert len(driver.outlets()) == 8
    with board(truth={"address": "5"}) as (driver, _), pytest.raises(NoReply, match="unit 1 gave no reply"):
        driver.outlets()


def test_one_exchange_takes_what_the_line_takes():
    """Sixteen characters at 9600 baud, the silence and the board's own time; nothing else waits."""
    with board() as (driver, clock):
        driver.outlets()
        assert 0.01 < clock.now() < 0.03


def test_a_dead_board_is_no_reply_within_bounded_time():
    """A write is sent once and read back three times."""
    with board(faults=[{"kind": "dead"}]) as (driver, clock):
        with pytest.raises(NoReply):
            driver.role(WIRE).close("heater")
        assert clock.now() < 2.5


def test_a_board_that_comes_back_is_read_again():
    """The write was lost with the power; what is reported is the write."""
    with board(faults=[{"kind": "dead", "from": "0 s", "until": "0.5 s"}]) as (driver, _):
        relays = driver.role(WIRE)
        with pytest.raises(NoReply, match="asked for coil 0 on"):
            relays.close("heater")
        relays.close("heater")
        assert relays.closed() == ("heater",)


def test_a_late_board_never_says_what_is_not_so():
    """Through a spell of late replies every answer that gets through is true."""
    with board(faults=[{"kind": "late", "from": "0 s", "until": "4 s", "by": "0.52 s"}]) as (driver, clock):
        relays = driver.role(WIRE)
        true = set()
        while clock.now() < 5:
            for act, name in ((relays.close, "lamp"), (relays.open, "lamp")):
                try:
                    act(name)
                except (NoReply, Garbled):
                    continue
                true = {"lamp"} if act == relays.close else set()
                assert set(relays.closed()) == true
            clock.sleep(0.05)


@pytest.mark.parametrize("fault", [{"kind": "garbled"}, {"kind": "partial", "bytes": "4"}])
def test_damaged_replies_are_garbled(fault):
    """Neither flipped bits nor half frames become coils."""
    with board(faults=[fault]) as (driver, _), pytest.raises(Garbled):
        driver.outlets()


def test_a_damaged_echo_is_forgiven_where_the_board_obeyed():
    """The board did what it was told; the read-back says so."""
    with board(faults=[{"kind": "garbled", "from": "0 s", "until": "0.03 s"}]) as (driver, _):
        relays = driver.role(WIRE)
        relays.close("heater")
        assert relays.closed() == ("heater",)


def test_chatter_on_the_line_is_a_fault_and_the_board_obeys():
    """Unasked bytes are told as what they are, after the setting has left; what is read is right."""
    told = []
    with board(faults=[{"kind": "chatty", "every": "0.1 s", "text": "?"}]) as (driver, clock):
        relays = driver.role(WIRE)
        for _ in range(20):
            for act, contacts in ((lambda: relays.close("heater"), ("heater",)), (relays.release_all, ())):
                try:
                    act()
                    assert relays.closed() == contacts
                except Garbled as fault:
                    told.append(str(fault))
            clock.sleep(0.07)
    assert len(told) > 5
    assert all("3f arrived unsolicited" in text for text in told)


HELD = replace(WIRE, settings={"beat": "2 s"})


def test_a_contact_that_is_held_opens_by_itself():
    """Nobody has to be alive for it: 2 s after it was closed, and not before."""
    with board() as (driver, clock):
        relays = driver.role(HELD)
        assert relays.watchdog_s == 2.0
        relays.close("heater")
        clock.sleep(1.8)
        assert relays.closed() == ("heater",)
        clock.sleep(0.3)
        assert relays.closed() == ()


def test_heartbeats_keep_it_closed():
    """Each starts the board's time again; the contact does not open for a moment in between."""
    with board() as (driver, clock):
        relays = driver.role(HELD)
        relays.close("heater")
        relays.close("lamp")
        for _ in range(10):
            clock.sleep(1.5)
            relays.beat()
            assert relays.closed() == ("heater", "lamp")
        clock.sleep(2.1)
        assert relays.closed() == ()


def test_a_heartbeat_that_is_late_closes_nothing_again():
    """What the board has opened stays open until somebody closes it on purpose."""
    with board() as (driver, clock):
        relays = driver.role(HELD)
        relays.close("heater")
        clock.sleep(2.5)
        with pytest.raises(Rejected, match="the board opened relay 1 by itself: no heartbeat"):
            relays.beat()
        relays.beat()
        assert relays.closed() == ()


@pytest.mark.parametrize("release", ["open", "release_all"])
def test_what_is_released_is_not_held_any_more(release):
    """Neither by the board's timer nor by a heartbeat, and without one nothing is sent."""
    with board() as (driver, clock):
        relays = driver.role(HELD)
        relays.close("heater")
        relays.open("heater") if release == "open" else relays.release_all()
        before = clock.now()
        relays.beat()
        assert clock.now() == before
        clock.sleep(3.0)
        assert relays.closed() == ()


def test_without_a_beat_a_contact_stays():
    """As before: a wire that asks for no watchdog has none."""
    with board() as (driver, clock):
        relays = driver.role(WIRE)
        assert relays.watchdog_s == 0.0
        relays.close("heater")
        clock.sleep(4000.0)
        relays.beat()
        assert relays.closed() == ("heater",)


@pytest.mark.parametrize("beat", ["0.5 s", "3300 s", "-1 s"])
def test_a_beat_that_the_board_cannot_keep_is_refused(beat):
    """Its timer has 15 bits of tenths of a second."""
    with board() as (driver, _), pytest.raises(Refused, match="beat"):
        driver.role(replace(WIRE, settings={"beat": beat}))
