"""The driver of the ESP301 against its peer and the table's physics, under the virtual clock."""

from __future__ import annotations

import dataclasses

import pytest
from by_bytes import BY_BYTES, rig
from rotation import WIRE, plant, table

from hil.instruments.driver import Outlet
from hil.model.errors import ClampExceeded, Refused, Rejected
from hil.model.identity import Identity


def test_the_whole_role_on_a_healthy_table():
    """Both ways, stopped, at rest; every number is the encoder's."""
    with table() as (role, physics, clock, _):
        assert role.at_rest()
        for rate in (50.0, -25.0):
            role.set_rate(rate)
            shown = role.rate()
            assert shown.unit == "deg/s"
            assert abs(shown.value - rate) < 4 * shown.uncertainty
            assert physics.observe("table_rate") == rate
            assert not role.at_rest()
        role.stop()
        assert role.at_rest()
        assert role.rate().value == pytest.approx(0.0, abs=1e-3)
        assert role.angle().value == pytest.approx(physics.observe("angle"), abs=2e-4)
        assert clock.now() < 25


def test_identity_is_controller_and_stage():
    """Version of the controller, serial number of the stage."""
    with table(truth={"serial": "SN77"}) as (_, _, _, driver):
        assert driver.identify() == Identity(model="ESP301", serial="SN77", firmware="SIM.1 6/1/99")


def test_a_table_found_on_is_told():
    """A motor that is on, and a table that runs out, are outlets that are on; a stopped one is off."""
    with table() as (role, _, _, driver):
        assert driver.outlets() == (Outlet(1, on=False), Outlet(2, on=False), Outlet(3, on=False))
        role.set_rate(20.0)
        assert driver.outlets()[0] == Outlet(1, on=True)
        role.stop()
        assert driver.outlets()[0] == Outlet(1, on=False)


def test_rate_zero_stops():
    """`set_rate(0)` is `stop`, motor power included."""
    with table() as (role, _, _, driver):
        role.set_rate(20.0)
        role.set_rate(0.0)
        assert role.at_rest()
        assert not driver.outlets()[0].on


def test_a_rate_beyond_its_clamp_never_leaves():
    """No byte of it is sent: the motor stays off."""
    with table() as (role, physics, _, driver):
        for rate in (61.0, -61.0):
            with pytest.raises(ClampExceeded, match="rate"):
                role.set_rate(rate)
        assert not driver.outlets()[0].on
        assert physics.observe("angle") == 0


@pytest.mark.parametrize(("rate", "match"), [(float("nan"), "not a rate"), (float("inf"), "not a rate")])
def test_what_is_no_rate_is_refused(rate, match):
    """NaN and infinity are no rates."""
    with table() as (role, _, _, _), pytest.raises(Refused, match=match):
        role.set_rate(rate)


def test_what_the_stage_cannot_do_is_refused():
    """Above its maximum velocity, or with a ramp that nobody can wait for."""
    with table(truth={"maximum_velocity": "30"}) as (role, _, _, _), pytest.raises(Refused, match="30 deg/s"):
        role.set_rate(40.0)
    slow = dataclasses.replace(WIRE, settings={"acceleration": "2"})
    with table(wire=slow) as (role, _, _, _), pytest.raises(Refused, match="acceleration"):
        role.set_rate(40.0)


def test_the_harness_is_counted_from_arm():
    """A movement that would leave the clamp's turns is refused before anything moves; the other way is free."""
    with table(angle="720") as (role, physics, clock, _):
        assert role.turns().value == 0
        role.set_rate(50.0)
        clock.sleep(30)
        assert role.turns().value == pytest.approx((physics.observe("angle") - 720) / 360, abs=1e-3)
        role.stop()
        before = physics.observe("angle")
        with pytest.raises(ClampExceeded, match="turns"):
            role.set_rate(50.0)
        assert physics.observe("angle") == before
        role.set_rate(-50.0)
        assert physics.observe("table_rate") == -50


@pytest.mark.parametrize("rate", [50.0, -50.0])
def test_the_longest_time_at_a_rate_stays_within_the_harness(rate):
    """As long as it says, the table stays inside the clamp; its whole turns are nearly used up."""
    with table() as (role, physics, clock, _):
        longest = role.longest(rate)
        assert longest.unit == "s"
        role.set_rate(rate)
        clock.sleep(longest.value - 2)
        role.stop()
        assert 4.5 < abs(physics.observe("turns")) < 5


def test_whoever_reads_the_encoder_stops_a_table_at_the_end_of_its_harness():
    """A case that forgets the table finds it stopped within its turns by the next reading."""
    with table() as (role, physics, clock, driver):
        role.set_rate(50.0)
        with pytest.raises(ClampExceeded, match="turns"):
            while True:
                clock.sleep(0.5)
                role.turns()
        assert 4.7 < physics.observe("turns") < 5.1
        assert physics.observe("table_rate") == 0
        assert not driver.outlets()[0].on


def test_what_the_table_turned_over_a_minute_is_its_rate():
    """Angle and instant before and after give the mean rate, with ripple, far better than a tenth of a percent."""
    free = ()
    with table(ripple="0.001", clamps=free) as (role, _, clock, _):
        role.set_rate(30.0)
        (first, begun), (last, ended) = role.reading(), (clock.sleep(60), role.reading())[1]
        rate = (last.value - first.value) / (ended.value - begun.value)
        assert rate == pytest.approx(30.0, rel=1e-4)
        assert 0 < begun.uncertainty < 2e-3
        assert first.uncertainty == pytest.approx(0.0002 / 12**0.5)


def test_uncertainty_of_the_rate_covers_encoder_and_instants():
    """The certificate's accuracy of an angle makes the rate over a short window worse."""
    accurate = dataclasses.replace(WIRE, settings={"accuracy": "0.01 deg"})
    with table(wire=accurate) as (role, _, _, _):
        role.set_rate(10.0)
        assert role.rate().uncertainty > 0.01 * 2**0.5 / 0.21


def test_settings_of_the_wire_are_read_strictly():
    """A typing error, an axis that does not exist, and an acceleration of nothing are refused."""
    with table() as (_, _, _, driver):
        for change, match in (
            ({"settings": {"acceleratoin": "3"}}, "did you mean 'acceleration'"),
            ({"settings": {"tolerance": "0"}}, "above 0"),
            ({"channel": 4}, "no channel 4; it has 1, 2, 3"),
            ({"role": "supply"}, "does not fill the role supply"),
        ):
            with pytest.raises(Refused, match=match):
                driver.role(dataclasses.replace(WIRE, **change))


def test_a_stage_that_counts_something_else_is_not_believed():
    """Millimetres are not degrees."""
    with table(truth={"unit": "2"}) as (role, _, _, _), pytest.raises(Rejected, match="unit 2"):
        role.set_rate(10.0)


def test_travel_limits_of_the_controller_are_respected():
    """A movement that leaves the controller's own limits is refused."""
    narrow = {"limits": ["-10", "10"]}
    with table(truth=narrow) as (role, _, _, _), pytest.raises(Refused, match="-10 to 10 deg"):
        role.set_rate(50.0)


def test_the_commands_echo_is_never_asked():
    """The driver asks for positions only: neither `TV?` nor `DV?` is in what it sends."""
    sent = []
    with table() as (role, _, _, driver):
        port = driver._connection.port
        write = port.write
        port.write = lambda data: sent.append(data) or write(data)
        role.set_rate(20.0)
        role.rate()
        role.stop()
    assert sent
    assert not any(b"TV" in data or b"DV" in data for data in sent)


def test_the_plant_is_not_disturbed_by_being_read():
    """A table that is watched turns as one that is not."""
    quiet = plant()
    quiet.command(rate_command=10.0, acceleration=20.0)
    quiet.advance(3_000_000_000)
    assert quiet.observe("angle") == pytest.approx(10 * 3 - 10 * 10 / 40, abs=1e-9)


@pytest.mark.parametrize(
    ("truth", "identity"),
    [
        ({"controller": "ESP301-3N", "firmware": "3.1.2 8/2/12"}, ("ESP301-3N", "SN0001", "SIM.2 8/2/12")),
        ({"controller": "ESP300", "firmware": "3.08 09/09/02"}, ("ESP300", "SN0001", "SIM8 09/09/02")),
        ({"controller": "ESP300", "firmware": "3.03"}, ("ESP300", "SN0001", "SIM3")),
        ({"identifies": "unknown"}, ("ESP301", "", "SIM.1 6/1/99")),
        ({"identifies": "empty"}, ("ESP301", "", "SIM.1 6/1/99")),
        ({"identifies": "not"}, ("ESP301", "", "SIM.1 6/1/99")),
    ],
)
def test_controllers_and_stages_identify_themselves_as_they_can(truth, identity):
    """A stage without data has no serial number; nothing else of the table differs, nor do the bytes that stop it."""
    kind = BY_BYTES["newport-esp301"]
    with rig(kind, truth=truth) as found:
        model, serial, firmware = identity
        assert found.driver.identify() == Identity(model=model, serial=serial, firmware=firmware)
        kind.drive(found)
        assert not found.proven(found.code(kind.proof))
        assert found.make_safe(found.code(kind.proof))
        assert not found.on()


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_controller_has_the_axes_that_it_has(axes):
    """An axis out of its range is no outlet, and leaves no error that the next command would be told of."""
    with table(truth={"axes": f"{axes}"}) as (role, _, _, driver):
        assert driver.outlets() == tuple(Outlet(axis, on=False) for axis in range(1, axes + 1))
        role.set_rate(10.0)
        assert [outlet.on for outlet in driver.outlets()] == [True, False, False][:axes]
        role.stop()


def test_an_axis_of_a_wire_that_is_not_there_is_told():
    """Nobody takes a table that should turn for one that there is not."""
    with table(truth={"axes": "1"}) as (_, _, _, driver):
        driver.role(dataclasses.replace(WIRE, channel=2))
        with pytest.raises(Rejected, match="AXIS NUMBER OUT OF RANGE"):
            driver.outlets()
