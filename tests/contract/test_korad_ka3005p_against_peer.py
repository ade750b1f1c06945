"""The Korad driver against its peer, through the simulated port and under the virtual clock."""

from __future__ import annotations

import itertools
import re
from contextlib import suppress

import pytest
import sweeps
from by_bytes import BY_BYTES, rig
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.korad_ka3005p import KoradKa3005p
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.korad_ka3005p import MODEL

UNASKED = list(itertools.product(["0", "\x01", "0\n", "00.00"], ["7 ms", "110 ms", "333 ms"]))

EXACT = {"voltage_noise": "0", "current_noise": "0"}


def charge(**settings):
    """Return the wire of the charging supply."""
    return Wire(role="supply", instance="charge", instrument="device", channel=1, settings=settings)


def supply(*, load="10", faults=(), clamps=None, **truth):
    """Return a driver facing a supply with a resistor at its output."""
    truth = {**EXACT, "load": load, **truth}
    return facing(MODEL, driver=KoradKa3005p, truth=truth, faults=faults, clamps=clamps, baud=9600)


@pytest.mark.parametrize("faults", [(), ({"kind": "stray-byte"},)], ids=["", "stray byte"])
def test_the_whole_role_on_a_healthy_supply(faults):
    """Configured, switched on, measured in both modes, switched off; a sixth byte after ISET1? changes nothing."""
    with supply(faults=faults) as (driver, _):
        output = driver.role(charge(over_voltage="at setting"))
        assert output.mode() == "off"
        output.configure(4.2, 0.7)
        assert not output.enabled()
        output.enable()
        assert output.enabled()
        assert output.mode() == "CV"
        assert output.voltage().value == pytest.approx(4.2)
        assert output.current().value == pytest.approx(0.42)
        output.configure(5.0, 0.3)
        assert output.mode() == "CC"
        assert output.voltage().value == pytest.approx(3.0)
        output.disable()
        assert not output.enabled()
        assert output.voltage().value == 0.0


@pytest.mark.parametrize(
    ("text", "identity"),
    [
        ("KORADKA3005PV2.0", ("Korad", "KA3005P", "", "SIMULATED")),
        ("VELLEMANLABPS3005DV2.0", ("Velleman", "LABPS3005D", "", "SIMULATED")),
        ("TENMA 72-2540 V2.0", ("Tenma", "72-2540", "", "SIMULATED")),
        ("KORAD KA3005P V5.5 SN:03379314", ("Korad", "KA3005P", "03379314", "SIMULATED")),
        ("S-LS-31 V2.0", ("", "S-LS-31 V0.0", "", "SIMULATED")),
    ],
)
def test_who_it_says_that_it_is(text, identity):
    """One supply under many names, most without a serial number; a simulated one says so under each."""
    with supply(identity=text) as (driver, _):
        manufacturer, model, serial, firmware = identity
        assert driver.identify() == Identity(manufacturer=manufacturer, model=model, serial=serial, firmware=firmware)


def test_a_control_byte_after_the_identification_is_none_of_it():
    """Some units send 0x01 after their name."""
    with supply(identity="KORADKA3005PV2.0\x01") as (driver, _):
        assert driver.identify().firmware == "SIMULATED"
        assert driver.outlets() == (Outlet(1, on=False),)


def test_what_is_no_identification_is_garbled():
    """A number is nobody's name."""
    with supply(identity="04.20") as (driver, _), pytest.raises(Garbled, match="KORADKA3005PV2.0 or another name"):
        driver.identify()


def test_each_exchange_ends_in_bounded_time():
    """A reading takes its two questions and their silences; a dead supply three waits of half a second."""
    with supply() as (driver, clock):
        driver.role(charge()).voltage()
        assert clock.now() < 0.25
        start = clock.now()
        driver.role(charge()).enabled()
        assert clock.now() - start < 0.35
    with supply(faults=[{"kind": "dead"}]) as (driver, clock):
        with pytest.raises(NoReply, match=r"nothing came within 0.5 s"):
            driver.identify()
        assert clock.now() < 2.0


def test_a_setting_that_the_supply_passes_over_is_found_out():
    """It takes 31 V, and says nothing about 40."""
    with supply() as (driver, _), pytest.raises(Rejected, match="set by VSET1:40.00 and reads back 0"):
        driver.role(charge()).configure(40.0, 0.1)


def test_a_setting_that_is_rounded_is_found_out():
    """A supply of 0.1 V resolution does not do what it was told."""
    with supply(voltage_resolution="0.1") as (driver, _), pytest.raises(Rejected, match="reads back 4.2"):
        driver.role(charge()).configure(4.23, 0.1)


@pytest.mark.parametrize(("volts", "amperes"), [(float("nan"), 1), (-1, 1), (100, 1), (1, float("inf")), (1, 10)])
def test_what_does_not_fit_a_command_is_refused(volts, amperes):
    """Five characters hold 99.99 V and 9.999 A."""
    with supply() as (driver, clock):
        with pytest.raises(Refused, match="is not a number to set"):
            driver.role(charge()).configure(volts, amperes)
        assert clock.now() == 0.0


def test_clamps_hold_in_front_of_the_supply():
    """At a setting, and at switching on what somebody else has set."""
    clamp = Clamp(output="supply.charge", quantity="current", unit="A", minimum=0.0, maximum=1.0)
    with supply(clamps={1: (clamp,)}) as (driver, clock):
        output = driver.role(charge())
        with pytest.raises(ClampExceeded):
            output.configure(4.2, 1.5)
        assert clock.now() == 0.0
        with pytest.raises(ClampExceeded, match="current 5 A"):
            output.enable()
        assert not output.enabled()


@pytest.mark.parametrize(("protection", "amperes"), [("over_voltage", 0.7), ("over_current", 0.2)])
def test_a_protection_that_acts_is_told(protection, amperes):
    """The supply switches itself off, and the driver does not say that it is on."""
    with supply(output_voltage_offset="0.5") as (driver, _):
        output = driver.role(charge(**{protection: "at setting"}))
        output.configure(4.2, amperes)
        with pytest.raises(Rejected, match="was switched on and is off"):
            output.enable()
        assert output.mode() == "off"


@pytest.mark.parametrize(
    ("wire", "message"),
    [
        (Wire(role="relays", instance="", instrument="device"), "does not fill the role relays"),
        (Wire(role="supply", instance="x", instrument="device", channel=2), "no channel 2"),
        (charge(over_volts="at setting"), "unknown key 'over_volts'"),
        (charge(over_voltage="4.25"), "have no level"),
    ],
)
def test_a_wire_that_it_cannot_fill_is_refused(wire, message):
    """A level of protection that it has not is never taken for one that it has."""
    with supply() as (driver, _), pytest.raises(Refused, match=message):
        driver.role(wire)


@pytest.mark.parametrize("says", ["on", "off"])
def test_an_output_that_refuses_to_go_off(says):
    """It is rejected, or where it lies its current shows it."""
    with supply(faults=[{"kind": "refuse-off", "says": says}]) as (driver, _):
        output = driver.role(charge())
        output.configure(1.0, 0.2)
        output.enable()
        if says == "on":
            with pytest.raises(Rejected, match="was switched off and is on"):
                output.disable()
        else:
            output.disable()
            assert not output.enabled()
        assert output.current().value == pytest.approx(0.1)


@pytest.mark.parametrize("by", ["0.3 s", "0.7 s"])
def test_a_late_supply_never_answers_the_wrong_question(by):
    """After a spell of late replies the voltage is the voltage, the current the current, and on is on."""
    with supply(faults=[{"kind": "late", "from": "3 s", "until": "5 s", "by": by}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(3_000_000_000)
        readings = []
        for _ in range(4):
            for read, true in ((output.voltage, 4.0), (output.current, 0.4)):
                with suppress(NoReply, Garbled):
                    readings.append((read().value, true))
            with suppress(NoReply, Garbled):
                readings.append((output.enabled(), True))
        assert len(readings) >= 6
        assert all(value == pytest.approx(true) for value, true in readings)


@pytest.mark.parametrize(("text", "every"), sweeps.sample(UNASKED, 6))
def test_an_unasked_byte_is_no_reading_however_often_it_comes(text, every):
    """A supply that chatters what a safe one would say: on is never read as off, nor 4 V as none."""
    with supply(faults=[{"kind": "chatty", "from": "3 s", "every": every, "text": text}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        for read, right in ((output.enabled, True), (lambda: round(output.voltage().value), 4)) * 10:
            clock.wait_until(max(clock.now_ns(), 3_000_000_000) + 1_700_000)
            with suppress(Garbled, NoReply):
                assert read() == right


def test_what_came_unasked_is_told():
    """The message shows the bytes; the next question is answered again."""
    with supply(faults=[{"kind": "chatty", "from": "1 s", "until": "1.1 s", "every": "1 s", "text": "0"}]) as (
        driver,
        clock,
    ):
        output = driver.role(charge())
        assert not output.enabled()
        clock.wait_until(1_200_000_000)
        with pytest.raises(Garbled, match="b'0' arrived unsolicited"):
            output.voltage()
        assert output.voltage().value == 0.0


def test_switching_off_works_on_a_supply_that_cannot_be_understood():
    """Replies are nonsense, but the output goes off, and the driver does not claim to know it."""
    with supply(faults=[{"kind": "garbled", "from": "3 s", "until": "9 s"}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(3_000_000_000)
        with pytest.raises((Garbled, NoReply)):
            output.disable()
        clock.wait_until(9_000_000_000)
        assert not output.enabled()


def test_switching_off_leaves_first_among_chatter():
    """What waits does not keep the command back; the fault is told after it."""
    with supply(faults=[{"kind": "chatty", "from": "3 s", "until": "4 s", "every": "50 ms", "text": "0"}]) as (
        driver,
        clock,
    ):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(3_100_000_000)
        with pytest.raises(Garbled):
            output.disable()
        clock.wait_until(4_000_000_000)
        with suppress(Garbled):
            output.enabled()
        assert not output.enabled()


ENDS = pytest.mark.parametrize("end", ["none", "lf", "crlf", "nul"])


@ENDS
@pytest.mark.parametrize("faults", [(), [{"kind": "stray-byte"}]])
def test_the_whole_role_whatever_ends_a_reply(end, faults):
    """Firmware that ends its replies is understood, with a stray byte before the end and without."""
    with supply(reply_end=end, faults=faults) as (driver, _):
        assert driver.outlets() == (Outlet(1, on=False),)
        assert driver.identify().model == "KA3005P"
        output = driver.role(charge())
        output.configure(4.2, 0.7)
        output.enable()
        assert output.enabled()
        assert output.current().value == pytest.approx(0.42)
        output.disable()
        assert not output.enabled()


@ENDS
def test_bytes_make_it_safe_whatever_ends_a_reply(end):
    """What is on is never proven off."""
    kind = BY_BYTES["korad-ka3005p"]
    with rig(kind, truth={"reply_end": end}) as found:
        kind.drive(found)
        assert not found.proven(found.code(kind.proof))
        assert not found.proven(found.code())
        assert found.make_safe(found.code(kind.proof))
        assert not found.on()


@ENDS
@pytest.mark.parametrize("text", ["\n", "\r\n", "\x00", "0"])
def test_a_late_end_is_no_status(end, text):
    """The end of a reply that comes by itself has no bit for on; it is not believed to be a status."""
    chatter = {"kind": "chatty", "from": "3 s", "every": "73 ms", "text": text}
    with supply(reply_end=end, faults=[chatter]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        for _ in range(12):
            clock.wait_until(max(clock.now_ns(), 3_000_000_000) + 1_700_000)
            with suppress(Garbled, NoReply):
                assert output.enabled()


@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n", b"\0"])
def test_every_status_is_read_by_driver_and_guardian_alike(end):
    """Of all bytes those without the bit for on are off, but for the ends of lines."""
    with rig(BY_BYTES["korad-ka3005p"]) as found:
        asked = found.code().proof[1]
    for status in range(256):
        off = re.search(asked.expect, bytes((status,)) + end, re.DOTALL)
        assert bool(off) == (not status & 0x40 and status not in b"\r\n")
