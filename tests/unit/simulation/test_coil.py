"""The coil's plant: reverser, boards, regulation, field."""

from __future__ import annotations

import pytest
from twin import COIL

from hil.simulation.plants.coil import build
from hil.simulation.truth import Truth, TruthError


def coil(**truth):
    """Return the plant with `truth` besides the usual one."""
    return build("coil", 10_000_000, Truth({**COIL, **truth}, ("plants", "coil", "truth")))


def driven(board="y_plus", *, a=False, b=False, volts=5.0, limit=0.016, **truth):
    """Return the plant with a board fed for 0.1 s."""
    plant = coil(**truth)
    plant.command(board=board, contact_a=a, contact_b=b, supply_voltage=volts, supply_current=limit)
    plant.advance(100_000_000)
    return plant


def test_current_limit_holds_the_current_and_lowers_the_voltage():
    """5 V with a limit of 16 mA on 40 ohm is 16 mA and 0.64 V."""
    plant = driven()
    assert plant.observe("current") == pytest.approx(0.016, rel=1e-12)
    assert plant.observe("voltage") == pytest.approx(0.64, rel=1e-4)


def test_voltage_holds_when_the_limit_is_out_of_reach():
    """0.4 V on 40 ohm is 10 mA at 0.4 V."""
    plant = driven(volts=0.4, limit=0.1)
    assert plant.observe("current") == pytest.approx(0.01, rel=1e-4)
    assert plant.observe("voltage") == 0.4


@pytest.mark.parametrize(("a", "b", "sign"), [(False, False, 1), (True, True, -1), (True, False, 0), (False, True, 0)])
def test_reverser(a, b, sign):
    """Both contacts released is forward, both energised reverse, one energised no current; the supply sees no sign."""
    plant = driven(a=a, b=b)
    assert plant.observe("winding_current") == pytest.approx(sign * 0.016, rel=1e-9, abs=1e-15)
    assert plant.observe("current") == pytest.approx(abs(sign) * 0.016, rel=1e-9, abs=1e-15)
    assert plant.observe("outward") == pytest.approx(sign * 12.5827, rel=1e-4, abs=1e-12)


def test_limited_supply_shows_the_same_voltage_in_both_directions():
    """In reverse the supply limits as it does forward; it does not see the reverser."""
    reverse, forward = driven(a=True, b=True), driven()
    assert reverse.observe("voltage") == pytest.approx(forward.observe("voltage"), rel=1e-12)
    assert forward.observe("voltage") < 1


def test_shorted_reverser_shows_the_supply_its_own_voltage():
    """With one contact energised nothing is connected to the supply."""
    assert driven(a=True).observe("voltage") == 5.0


@pytest.mark.parametrize("truth", [{}, {"broken": True}])
def test_open_circuit(truth):
    """Without a board, or with a broken winding, the supply sees its voltage and no current."""
    plant = driven("y_plus" if truth else "", **truth)
    assert (plant.observe("voltage"), plant.observe("current")) == (5.0, 0.0)


def test_boards_differ_from_the_usual_coil():
    """A board wound left turns the field over; its other truths are the usual ones."""
    assert driven("x_plus").observe("outward") == pytest.approx(-driven("y_plus").observe("outward"), rel=1e-12)


def test_changing_the_board_starts_afresh():
    """The next board has no current yet, and the temperature of the air."""
    plant = driven(volts=6.0, limit=1.0, resistance="5", thermal_resistance="50", heat_capacity="0.1")
    assert plant.observe("temperature") > 24
    plant.command(board="x_plus")
    assert (plant.observe("winding_current"), plant.observe("temperature")) == (0.0, 20.0)


def test_copper_warms_and_draws_less():
    """At constant voltage the current falls as the copper warms, by 0.393 %/K."""
    plant = driven(volts=4.0, limit=5.0, resistance="4", thermal_resistance="10", heat_capacity="0.5")
    plant.advance(60_000_000_000)
    warmer = plant.observe("temperature") - 20
    assert warmer > 20
    assert plant.observe("current") == pytest.approx(1 / (1 + 0.00393 * warmer), rel=1e-3)


def test_field_is_earth_drift_and_coil():
    """The three add up; the drift goes on with the bench's time."""
    plant = driven(earth_drift=["0.1", "0", "0"])
    plant.advance(10_000_000_000)
    assert plant.observe("field.x") == pytest.approx(23.0, abs=1e-6)
    assert plant.observe("field.y") == pytest.approx(5.0, abs=1e-6)
    assert plant.observe("field.z") == pytest.approx(-38 + plant.observe("outward"), abs=1e-9)


def test_misaligned_sensor_sees_the_field_in_its_own_frame():
    """A sensor turned by 90 degrees about z reads the jig's y as its x; the length stays."""
    plant = coil(misalignment=["0", "0", "1.5707963267948966"])
    assert [plant.observe(f"field.{axis}") for axis in "xyz"] == pytest.approx([5.0, -22.0, -38.0])
    plant = coil(misalignment=["1.5707963267948966", "0", "0"])
    assert [plant.observe(f"field.{axis}") for axis in "xyz"] == pytest.approx([22.0, -38.0, -5.0])


def test_sensor_power():
    """The sensor draws its current from 1.9 V on; a limit below lets the voltage collapse."""
    plant = coil()
    plant.command(sensor_power_voltage=3.3, sensor_power_current=0.1)
    assert (plant.observe("sensor_power.voltage"), plant.observe("sensor_power.current")) == (3.3, 4e-4)
    plant.command(sensor_power_current=1e-4)
    assert plant.observe("sensor_power.voltage") == 0.0
    plant.command(sensor_power_voltage=1.0)
    assert plant.observe("sensor_power.current") == 0.0


def test_boards_are_the_choices():
    """Only boards of the truth can be attached; without any listed every name can."""
    assert coil().choices("board") == ("", "x_plus", "y_plus")
    assert coil(boards={}).choices("board") == ()
    assert driven("anything", boards={}).observe("outward") > 0


def test_wrong_truth_is_told_with_its_place():
    """Every wrong value of the section comes, those of boards too; what boards only inherit is told once."""
    with pytest.raises(TruthError) as caught:
        coil(turns="0", sides=["0.1", "-0.1"], boards={"x_plus": {"windng": "left"}}, attached="z_plus")
    found = [error.path[3:] for error in (caught.value, *caught.value.others)]
    assert found[0] == ("turns",)
    assert set(found) == {
        ("turns",),
        ("sides", 1),
        ("boards", "x_plus", "windng"),
        ("attached",),
    }
