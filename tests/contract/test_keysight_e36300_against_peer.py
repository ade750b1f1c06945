"""The Keysight driver against its peer, through the simulated port and under the virtual clock."""

from __future__ import annotations

import math
from contextlib import suppress

import pytest
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.keysight_e36300 import KeysightE36300
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Garbled, NoReply, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.keysight_e36312a import MODEL

EXACT = {"voltage_noise": "0", "current_noise": "0"}


def coil(**settings):
    """Return the wire of the coil's supply, channel 2."""
    return Wire(role="supply", instance="coil", instrument="device", channel=2, settings=settings)


def supply(*, load="10", faults=(), clamps=None, baud=0, **truth):
    """Return a driver facing a supply with a resistor on every output."""
    return facing(
        MODEL,
        driver=KeysightE36300,
        truth={**EXACT, "load": load, **truth},
        faults=faults,
        clamps=clamps,
        baud=baud,
    )


def test_the_whole_role_on_a_healthy_supply():
    """Configured, switched on, measured in both modes, switched off: every answer is the peer's own."""
    with supply() as (driver, _):
        output = driver.role(coil(over_voltage="5.5"))
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
        assert output.current().value == pytest.approx(0.3)
        output.disable()
        assert not output.enabled()
        assert output.voltage().value == 0.0


def test_identity_and_outlets():
    """Only the channel that was switched on is on."""
    with supply(serial="MY59002391") as (driver, _):
        assert driver.identify() == Identity(
            manufacturer="Keysight Technologies", model="E36312A", serial="SIM-MY59002391", firmware="2.1.0-1.0.4-1.12"
        )
        output = driver.role(coil())
        output.configure(1.0, 0.1)
        output.enable()
        assert driver.outlets() == (Outlet(1, on=False), Outlet(2, on=True), Outlet(3, on=False))


@pytest.mark.parametrize("baud", [0, 9600])
def test_it_works_over_a_slow_line_too(baud):
    """The line's speed changes nothing but the time that passes."""
    with supply(baud=baud) as (driver, clock):
        output = driver.role(coil())
        output.configure(2.0, 0.5)
        output.enable()
        assert output.current().value == pytest.approx(0.2)
        assert clock.now() < 1.5


def test_a_setting_beyond_the_rating_is_rejected_by_the_instrument():
    """Channel 2 gives 25 V; nobody clamped it."""
    with supply() as (driver, _), pytest.raises(Rejected, match="Data out of range"):
        driver.role(coil()).configure(40.0, 0.1)


def test_a_setting_coarser_than_the_tolerance_is_found_out():
    """An instrument that rounds to 0.1 V does not do what it was told."""
    with supply(voltage_resolution="0.1") as (driver, _), pytest.raises(Rejected, match="reads back 4.2"):
        driver.role(coil()).configure(4.23, 0.1)


def test_clamps_hold_in_front_of_the_instrument():
    """The instrument would take 6 V."""
    clamp = Clamp(output="supply.coil", quantity="voltage", unit="V", minimum=0.0, maximum=5.0)
    with supply(clamps={2: (clamp,)}) as (driver, clock):
        with pytest.raises(ClampExceeded):
            driver.role(coil()).configure(6.0, 0.1)
        assert clock.now() == 0.0


def test_a_protection_that_tripped_keeps_the_output_off():
    """Set below what stands at the output it trips, and only a person clears it."""
    with supply(output_voltage_offset="0.5") as (driver, _):
        output = driver.role(coil(over_voltage="4.3"))
        output.configure(4.2, 0.7)
        with pytest.raises(Rejected, match="over-voltage protection of supply.coil has tripped"):
            output.enable()
        with pytest.raises(Rejected, match="has tripped"):
            output.enable()
        assert output.mode() == "off"


def test_an_output_that_refuses_to_go_off_is_rejected():
    """Whoever asked for safety learns that there is none."""
    faults = [{"kind": "refuse-off", "channel": "2"}]
    with supply(faults=faults) as (driver, _):
        output = driver.role(coil())
        output.configure(1.0, 0.1)
        output.enable()
        with pytest.raises(Rejected, match="was switched off and is on"):
            output.disable()


def test_an_output_that_lies_about_being_off_shows_its_current():
    """The read-back is the instrument's word; the proof is the measured current."""
    faults = [{"kind": "refuse-off", "channel": "2", "says": "off"}]
    with supply(faults=faults) as (driver, _):
        output = driver.role(coil())
        output.configure(1.0, 0.2)
        output.enable()
        output.disable()
        assert not output.enabled()
        assert output.current().value == pytest.approx(0.1)


def test_a_measurement_that_is_no_number_is_nan():
    """The peer's 9.91E37 arrives as NaN."""
    with supply(faults=[{"kind": "not-a-number"}]) as (driver, _):
        assert math.isnan(driver.role(coil()).voltage().value)


def test_a_dead_supply_is_no_reply_within_bounded_time():
    """Three exchanges of half a second, of the bench's time."""
    with supply(faults=[{"kind": "dead"}]) as (driver, clock):
        with pytest.raises(NoReply, match="nothing came within 0.5 s"):
            driver.identify()
        assert clock.now() == pytest.approx(1.5)


def test_a_supply_that_comes_back_answers_again():
    """A pause of power costs one repeated question."""
    with supply(faults=[{"kind": "dead", "from": "0 s", "until": "0.6 s"}]) as (driver, _):
        assert driver.identify().model == "E36312A"


def test_a_late_supply_never_answers_the_wrong_question():
    """After a spell of replies 0.7 s late the voltage is the voltage, and the current the current."""
    with supply(faults=[{"kind": "late", "from": "1 s", "until": "2 s", "by": "0.7 s"}]) as (driver, clock):
        output = driver.role(coil())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(1_000_000_000)
        readings = []
        for _ in range(4):
            for read, true in ((output.voltage, 4.0), (output.current, 0.4)):
                try:
                    readings.append((read().value, true))
                except NoReply:
                    continue
        assert len(readings) >= 4
        assert all(value == pytest.approx(true) for value, true in readings)


def test_a_garbled_supply_never_gives_a_wrong_identity_silently():
    """Bits flipped in every byte are nonsense, and said to be."""
    with supply(faults=[{"kind": "garbled"}]) as (driver, _), pytest.raises((Garbled, NoReply)):
        driver.outlets()


def test_half_replies_are_no_reply():
    """Without a line feed there is no value."""
    with supply(faults=[{"kind": "partial", "bytes": "3"}]) as (driver, _), pytest.raises(NoReply, match="only b'"):
        driver.role(coil()).voltage()


def test_chatter_between_questions_is_a_fault_and_never_a_value():
    """An unasked line every 0.3 s is told as what it is; what is read is right all the same."""
    told = []
    with supply(faults=[{"kind": "chatty", "from": "0.2 s", "every": "0.3 s", "text": "+9.9\n"}]) as (driver, clock):
        output = driver.role(coil())
        output.configure(4.0, 0.7)
        output.enable()
        for _ in range(20):
            clock.sleep(0.25)
            try:
                assert output.voltage().value == pytest.approx(4.0)
            except Garbled as fault:
                told.append(str(fault))
    assert len(told) > 5
    assert all("b'+9.9\\n' arrived unsolicited" in text for text in told)


@pytest.mark.parametrize("text", ["0\n", "+0.0E+00\n", "1\n", ";0\n"])
@pytest.mark.parametrize("every", ["1 ms", "3 ms", "11 ms"])
def test_an_unasked_line_is_no_reading_however_often_it_comes(text, every):
    """A supply that chatters what a safe one would say: on is never read as off, nor 4 V as none."""
    chatter = {"kind": "chatty", "from": "1 s", "every": every, "text": text}
    with supply(faults=[chatter]) as (driver, clock):
        output = driver.role(coil())
        output.configure(4.0, 0.7)
        output.enable()
        for read, right in ((output.enabled, True), (lambda: round(output.voltage().value), 4)) * 10:
            clock.wait_until(max(clock.now_ns(), 1_000_000_000) + 1_700_000)
            with suppress(Garbled, NoReply):
                assert read() == right


def test_switching_off_works_on_a_supply_that_cannot_be_understood():
    """Replies are nonsense, but the output goes off, and the driver does not claim to know it."""
    with supply(faults=[{"kind": "garbled", "from": "1 s", "until": "5 s"}]) as (driver, clock):
        output = driver.role(coil())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(1_000_000_000)
        with pytest.raises((Garbled, NoReply)):
            output.disable()
        clock.wait_until(5_000_000_000)
        assert not output.enabled()
