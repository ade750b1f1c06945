"""The Rigol driver against its peer, through the simulated port and under the virtual clock."""

from __future__ import annotations

import itertools
from contextlib import suppress

import pytest
import sweeps
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.rigol_dp832 import RigolDp832
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.rigol_dp832 import MODEL

UNASKED = list(itertools.product(["OFF\n", "0.0000\n", "NO\n", "ON\n"], ["1 ms", "3 ms", "11 ms", "37 ms"]))

EXACT = {"voltage_noise": "0", "current_noise": "0"}


def charge(**settings):
    """Return the wire of the charging supply, channel 1."""
    return Wire(role="supply", instance="charge", instrument="device", channel=1, settings=settings)


def supply(*, load="10", faults=(), clamps=None, baud=0, **truth):
    """Return a driver facing a supply with a resistor on every output."""
    truth = {**EXACT, "load": load, **truth}
    return facing(MODEL, driver=RigolDp832, truth=truth, faults=faults, clamps=clamps, baud=baud)


@pytest.mark.parametrize("baud", [0, 9600])
def test_the_whole_role_on_a_healthy_supply(baud):
    """Configured, switched on, measured in both modes, switched off: every answer is the peer's own."""
    with supply(baud=baud) as (driver, _):
        output = driver.role(charge(over_voltage="5.25 V", over_current="1 A"))
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


def test_identity_and_outlets():
    """Only the channel that was switched on is on."""
    with supply() as (driver, _):
        assert driver.identify() == Identity(
            manufacturer="RIGOL TECHNOLOGIES", model="DP832", serial="SIM-DP8C000000001", firmware="00.01.16"
        )
        output = driver.role(charge())
        output.configure(1.0, 0.1)
        output.enable()
        assert driver.outlets() == (Outlet(1, on=True), Outlet(2, on=False), Outlet(3, on=False))


def test_each_wire_has_its_own_channel():
    """What one output is set to is not what another one is set to, in whatever order."""
    with supply() as (driver, _):
        outputs = {
            channel: driver.role(Wire(role="supply", instance=f"c{channel}", instrument="device", channel=channel))
            for channel in (1, 2, 3)
        }
        for channel, output in outputs.items():
            output.configure(channel, 0.5)
        for output in outputs.values():
            output.enable()
        assert [output.voltage().value for output in outputs.values()] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize(("protection", "level"), [("over_voltage", "4.3"), ("over_current", "0.45")])
def test_a_protection_that_tripped_keeps_the_output_off(protection, level):
    """Set below what the output gives it trips, and only a person clears it."""
    with supply(output_voltage_offset="0.5") as (driver, _):
        output = driver.role(charge(**{protection: level}))
        output.configure(4.2, 0.7)
        for _ in range(2):
            with pytest.raises(Rejected, match=f"{protection.replace('_', '-')} protection of supply.charge has trip"):
                output.enable()
        assert output.mode() == "off"


def test_a_setting_beyond_the_rating_is_rejected_by_the_instrument():
    """Channel 1 takes 32 V; nobody clamped it."""
    with supply() as (driver, _), pytest.raises(Rejected, match="Data out of range"):
        driver.role(charge()).configure(40.0, 0.1)


def test_a_setting_coarser_than_the_tolerance_is_found_out():
    """10 mV are the instrument's step; 0.1 V are not."""
    with supply() as (driver, _):
        driver.role(charge()).configure(4.225, 0.1)
    with supply(voltage_resolution="0.1") as (driver, _), pytest.raises(Rejected, match="reads back 4.2"):
        driver.role(charge()).configure(4.23, 0.1)


def test_clamps_hold_in_front_of_the_instrument():
    """The instrument would take 6 V."""
    clamp = Clamp(output="supply.charge", quantity="voltage", unit="V", minimum=0.0, maximum=4.2)
    with supply(clamps={1: (clamp,)}) as (driver, clock):
        with pytest.raises(ClampExceeded):
            driver.role(charge()).configure(6.0, 0.1)
        assert clock.now() == 0.0


@pytest.mark.parametrize(
    ("wire", "message"),
    [
        (Wire(role="relays", instance="", instrument="device"), "does not fill the role relays"),
        (Wire(role="supply", instance="x", instrument="device", channel=4), "no channel 4"),
        (charge(over_voltages="5"), "did you mean 'over_voltage'"),
        (charge(over_voltage="high"), "must be a number in V"),
    ],
)
def test_a_wire_that_it_cannot_fill_is_refused(wire, message):
    """The bench file's mistake is told with what would be right."""
    with supply() as (driver, _), pytest.raises(Refused) as refused:
        driver.role(wire)
    assert message in str(refused.value)


@pytest.mark.parametrize(("says", "match"), [("on", "was switched off and is on"), ("off", "")])
def test_an_output_that_refuses_to_go_off(says, match):
    """It is rejected, or where it lies its current shows it."""
    with supply(faults=[{"kind": "refuse-off", "channel": "1", "says": says}]) as (driver, _):
        output = driver.role(charge())
        output.configure(1.0, 0.2)
        output.enable()
        if match:
            with pytest.raises(Rejected, match=match):
                output.disable()
        else:
            output.disable()
            assert not output.enabled()
        assert output.current().value == pytest.approx(0.1)


def test_a_late_supply_never_answers_the_wrong_question():
    """After a spell of replies 0.7 s late the voltage is the voltage, and the current the current."""
    with supply(faults=[{"kind": "late", "from": "2 s", "until": "3 s", "by": "0.7 s"}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(2_000_000_000)
        readings = []
        for _ in range(4):
            for read, true in ((output.voltage, 4.0), (output.current, 0.4)):
                with suppress(NoReply, Garbled):
                    readings.append((read().value, true))
        assert len(readings) >= 4
        assert all(value == pytest.approx(true) for value, true in readings)


@pytest.mark.parametrize(("text", "every"), sweeps.sample(UNASKED, 6))
def test_an_unasked_line_is_no_reading_however_often_it_comes(text, every):
    """A supply that chatters what a safe one would say: on is never read as off, nor 4 V as none."""
    with supply(faults=[{"kind": "chatty", "from": "2 s", "every": every, "text": text}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        for read, right in ((output.enabled, True), (lambda: round(output.voltage().value), 4)) * 10:
            clock.wait_until(max(clock.now_ns(), 2_000_000_000) + 1_700_000)
            with suppress(Garbled, NoReply):
                assert read() == right


def test_switching_off_works_on_a_supply_that_cannot_be_understood():
    """Replies are nonsense, but the output goes off, and the driver does not claim to know it."""
    with supply(faults=[{"kind": "garbled", "from": "2 s", "until": "6 s"}]) as (driver, clock):
        output = driver.role(charge())
        output.configure(4.0, 0.7)
        output.enable()
        clock.wait_until(2_000_000_000)
        with pytest.raises((Garbled, NoReply)):
            output.disable()
        clock.wait_until(6_000_000_000)
        assert not output.enabled()
