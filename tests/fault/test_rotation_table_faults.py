"""What goes wrong with a rotation table ends in a fault of the device, or shows in the encoder; never in silence."""

from __future__ import annotations

import pytest
from rotation import Controller, table

from hil.bench.safe_off import make_safe
from hil.model.bench import Proof, SafeStep
from hil.model.errors import ClampExceeded, DeviceFault, Garbled, NoReply, Rejected

SAFE = (
    SafeStep(
        output="rotation_table",
        state="stopped",
        within_s=15.0,
        proof=Proof(output="rotation_table", quantity="rate", unit="deg/s", minimum=-0.05, maximum=0.05),
    ),
)


def safe_results(role, clock):
    """Return what became of the safe-off."""
    results = []
    make_safe(SAFE, {"rotation_table": role}, clock, results.append)
    return results


@pytest.mark.parametrize("fault", [{"kind": "slipping", "share": "0.8"}, {"kind": "stalled"}])
def test_a_table_that_does_not_follow_is_told_and_stopped(fault):
    """The encoder does not show the rate, whatever the controller says; nothing turns afterwards."""
    with table(faults=[fault]) as (role, physics, clock, driver):
        with pytest.raises(Rejected, match="set to 50 deg/s and its encoder shows"):
            role.set_rate(50.0)
        assert physics.observe("table_rate") == 0
        assert not driver.outlets()[0].on
        assert clock.now() < 15


def test_the_controllers_echo_would_not_have_told():
    """While the table slips, `TV?` and `MD?` are those of a table that follows."""
    controller = Controller(faults=[{"kind": "slipping", "share": "0.8"}])
    controller.ask("1VA50;1AC100;1MO;1MV+")
    controller.clock.sleep(2)
    assert controller.ask("1TV?") == ["50.000000"]
    assert controller.ask("TB?")[0].startswith("0, ")
    assert controller.table.observe("table_rate") == pytest.approx(40.0)


def test_a_slip_that_hides_in_the_tolerance_shows_in_the_encoder():
    """At 1 deg/s five percent are within the tolerance: the reading tells the true rate, not the command."""
    with table(faults=[{"kind": "slipping", "share": "0.95"}]) as (role, _, clock, _):
        role.set_rate(1.0)
        (first, begun), (last, ended) = role.reading(), (clock.sleep(30), role.reading())[1]
        assert (last.value - first.value) / (ended.value - begun.value) == pytest.approx(0.95, abs=2e-4)


def test_a_table_that_begins_to_slip_shows_in_the_encoder():
    """Slipping that comes while it turns is in the next rate."""
    with table(faults=[{"kind": "slipping", "share": "0.5", "from": "8 s"}]) as (role, _, clock, _):
        role.set_rate(20.0)
        assert role.rate().value == pytest.approx(20.0, abs=0.05)
        clock.wait_until(8_100_000_000)
        assert role.rate().value == pytest.approx(10.0, abs=0.05)


def test_a_table_that_goes_on_after_a_stop_has_its_power_cut():
    """The stop is acknowledged, the encoder disagrees: the motor is cut, the fault is told, safe-off is proven."""
    with table(faults=[{"kind": "no-stop"}]) as (role, physics, clock, driver):
        role.set_rate(20.0)
        with pytest.raises(Rejected, match="went on; its motor power was cut"):
            role.stop()
        assert physics.observe("table_rate") == 0
        assert not driver.outlets()[0].on
        assert [result.ok for result in safe_results(role, clock)] == [True]


def test_a_table_that_nothing_stops_is_an_unsafe_end():
    """Neither stop nor power: it is said each time, and safe-off is not proven."""
    with table(faults=[{"kind": "no-stop", "power": "stays"}], clamps=()) as (role, physics, clock, _):
        role.set_rate(20.0)
        with pytest.raises(Rejected, match="still turns"):
            role.stop()
        (result,) = safe_results(role, clock)
        assert not result.ok
        assert "went on" in result.detail
        assert physics.observe("table_rate") == 20


def test_a_harness_at_its_end_and_no_stop_is_a_fault_of_the_table():
    """The reading that finds the end of the turns raises the worse of both: the table goes on."""
    with table(faults=[{"kind": "no-stop", "power": "stays"}]) as (role, _, clock, _):
        role.set_rate(50.0)
        clock.sleep(35)
        with pytest.raises((Rejected, ClampExceeded), match="went on"):
            role.turns()


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ({"kind": "dead"}, NoReply),
        ({"kind": "late", "by": "700 ms"}, DeviceFault),
        ({"kind": "garbled"}, DeviceFault),
        ({"kind": "partial", "bytes": "3"}, NoReply),
        ({"kind": "chatty", "every": "3 ms", "text": "0.000000\r\n"}, Garbled),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else value.__name__,
)
@pytest.mark.parametrize("operation", ["angle", "rate", "at_rest", "reading", "stop", "turns"])
def test_faults_of_the_line_are_faults_of_the_device(fault, error, operation):
    """Every operation of a turning table raises, within bounded time."""
    with table(faults=[{**fault, "from": "8 s"}], clamps=()) as (role, _, clock, _):
        role.set_rate(20.0)
        clock.wait_until(8_100_000_000)
        began = clock.now()
        with pytest.raises(error):
            getattr(role, operation)()
        assert clock.now() - began < 12


@pytest.mark.parametrize("late", ["510 ms", "600 ms", "1100 ms", "1700 ms", "2200 ms"])
def test_a_stale_reply_is_never_an_angle(late):
    """Whatever late replies come in place of fresh ones, an angle is that of its own question, or there is none."""
    with table(faults=[{"kind": "late", "by": late, "from": "8 s", "until": "11 s"}], clamps=()) as (
        role,
        physics,
        clock,
        _,
    ):
        role.set_rate(20.0)
        clock.wait_until(8_000_000_000)
        read = 0
        while clock.now() < 20:
            try:
                angle, at = role.reading()
            except DeviceFault:
                clock.sleep(0.05)
                continue
            read += 1
            true = physics.observe_at("angle", round(at.value * 1e9))
            assert angle.value == pytest.approx(true, abs=0.1)
            clock.sleep(0.05)
        assert read > 10


def test_a_chattering_controller_does_not_keep_a_stop_from_leaving():
    """The stop leaves before anything is read; what chatters is told, and the table stands."""
    chatty = {"kind": "chatty", "every": "3 ms", "text": "0, 1, NO ERROR DETECTED\r\n", "from": "8 s"}
    with table(faults=[chatty], clamps=()) as (role, physics, clock, _):
        role.set_rate(20.0)
        clock.wait_until(8_100_000_000)
        with pytest.raises(DeviceFault):
            role.stop()
        clock.sleep(2)
        assert physics.observe("table_rate") == 0
        assert not safe_results(role, clock)[0].ok


def test_another_controller_is_another_identity():
    """Who answers something else is told by what it says, or is no ESP at all."""
    with table(faults=[{"kind": "identity", "value": "ESP300 Version 2.11 1/1/01"}]) as (_, _, _, driver):
        assert driver.identify().model == "ESP300"
    with table(faults=[{"kind": "identity", "value": "SMC100CC 2.0"}]) as (_, _, _, driver), pytest.raises(Garbled):
        driver.identify()


def test_errors_of_before_are_not_held_against_the_first_setting():
    """What somebody left in the buffer before the bench was armed is taken out, and the table turns."""
    with table() as (role, _, _, driver):
        port = driver._connection.port
        port.write(b"QQ\r1PA\r")
        role.set_rate(10.0)
        assert role.rate().value == pytest.approx(10.0, abs=0.05)
        port.write(b"QQ\r")
        with pytest.raises(Rejected, match="6 COMMAND DOES NOT EXIST"):
            role.angle()
