"""Phases of flight logs whose truth is known: found to a window, judged, and never made up."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from flights import BIAS, FIELD, made, turning

from hil.analysis.flight import flight_phases
from hil.analysis.gates import Facts
from hil.analysis.motion import Kind
from hil.model.errors import Refused
from hil.model.figure import FigureStatus

RATE = 10.0
STILL = turning(60, RATE)
SPIN = turning(120, RATE, (0.0, 0.0, 12.0))
SHAKEN = 3.0 * np.random.default_rng(9).standard_normal((300, 3))


def found(rates, field=None, **more):
    """Find the phases of rates in deg/s."""
    more = {"still": 1.0, "radians": math.pi / 180.0} | more
    return flight_phases(rates, RATE, "deg/s", field=field, **more)


def told(its):
    """Return kind, beginning and end of each phase."""
    return [(phase.kind.value, phase.begin, phase.end) for phase in its.phases]


def tripped(its):
    """Return number of the phase and name of each gate that speaks against it."""
    return {(number, gate.name) for number, each in enumerate(its.phases) for gate in each.gates if gate.ok is False}


def test_phases_are_found_to_a_window():
    """Rest, spin, shaking, rest: kinds as they were, ends within two windows, bias within its noise."""
    its = found(*made([STILL, SPIN, SHAKEN, STILL], RATE))
    assert [phase.kind.value for phase in its.phases] == ["rest", "rotation", "unsteady", "rest"]
    assert [phase.begin for phase in its.phases] == pytest.approx([0.0, 60.0, 180.0, 210.0], abs=4.0)
    assert its.phases[-1].end == 270.0
    assert its.bias == pytest.approx(BIAS, abs=0.02)
    assert its.noise == pytest.approx([0.05] * 3, rel=0.1)
    assert tripped(its) == set()
    assert its.remarks == ()


@pytest.mark.parametrize("seed", sweeps.sample(range(20), 2))
def test_at_rest_bias_and_white_noise_are_told(seed):
    """Within four of their uncertainties of what was put in; of a short rest no noise."""
    its = found(*made([STILL, SPIN, turning(30, RATE)], RATE, seed=seed))
    first, _, last = its.phases
    for place in range(3):
        assert abs(first.rates[place].value - BIAS[place]) < 4.0 * first.rates[place].uncertainty
        assert abs(first.white[place].value - 0.05 / math.sqrt(RATE)) < 4.0 * first.white[place].uncertainty
        assert last.white[place].status is FigureStatus.NOT_OBSERVABLE


def test_turns_of_rates_and_field_agree():
    """Four turns of 12 deg/s: the field counts them without the gyroscope, iron of the body included."""
    spin = found(*made([STILL, SPIN, STILL], RATE, iron=(3.0, -2.0, 1.0))).phases[1]
    assert spin.turns.value == pytest.approx(4.0, abs=0.15)
    assert abs(spin.agreement.value) < 4.0 * spin.agreement.uncertainty < 0.02
    assert spin.turning.value == pytest.approx(12.0, abs=0.4)


@pytest.mark.parametrize(
    ("factor", "reason"),
    [
        (math.pi / 180.0, "near 1/57.3, as when degrees and radians are mixed up"),
        (1000.0, "near 1000, as when milli"),
        (0.5, "the rates turn 0.5"),
        (-1.0, "left-handed, or one sign is wrong"),
    ],
)
def test_rates_of_another_unit_range_or_sign_disagree_with_the_field(factor, reason):
    """The one gate that needs no data sheet."""
    rates, field = made([STILL, SPIN, STILL], RATE)
    its = found(rates * factor, field)
    gates = [gate for phase in its.phases for gate in phase.gates if gate.name == "agrees" and gate.ok is False]
    assert len(gates) == 1
    assert reason in gates[0].reason


def test_a_slow_turn_is_seen_by_the_field_and_not_without_it():
    """0.4 deg/s may be a bias; that is said."""
    slow = turning(120, RATE, (0.4, 0.0, 0.0))
    rates, field = made([STILL, slow, STILL], RATE)
    assert [kind for kind, _, _ in told(found(rates, field))] == ["rest", "rotation", "rest"]
    alone = found(rates)
    assert Kind.ROTATION not in {phase.kind for phase in alone.phases}
    assert alone.remarks == ("without a magnetometer a steady turn of less than 1 deg/s is taken for rest",)


def test_a_turn_about_the_field_is_told_as_odd():
    """A bias that drifted looks the same to both sensors."""
    about = turning(60, RATE, 5.0 * np.array([18.0, -4.0, 43.0]) / math.sqrt(18.0**2 + 4.0**2 + 43.0**2))
    its = found(*made([STILL, about, STILL], RATE))
    assert its.phases[1].kind is Kind.ROTATION
    assert its.phases[1].remark == "the field stands still: a turn about it, or a bias that drifted"


def test_a_field_that_is_switched_is_no_rotation():
    """As by a magnetorquer: the rates do not move."""
    rates, field = made([STILL, STILL, STILL], RATE)
    field[600:1200] += 20.0 * np.sin(np.arange(600) / 5.0)[:, None]
    its = found(rates, field)
    assert [phase.kind.value for phase in its.phases] == ["rest", "unsteady", "rest"]


def test_one_turn_ends_where_another_begins():
    """Both are rotations, told apart by their rates."""
    its = found(*made([STILL, SPIN, turning(120, RATE, (25.0, 0.0, 0.0)), STILL], RATE))
    assert [kind for kind, _, _ in told(its)] == ["rest", "rotation", "rotation", "rest"]
    assert its.phases[2].begin == pytest.approx(180.0, abs=4.0)


def test_a_knock_within_a_rest_is_told():
    """It is short, but the rest before it is not that after it."""
    rates, field = made([STILL, STILL], RATE)
    rates[600:610] += 40.0
    assert [kind for kind, _, _ in told(found(rates, field))] == ["rest", "unsteady", "rest"]


def test_what_is_missing_is_a_phase():
    """A power cut of 40 s, and single samples that are missing elsewhere."""
    rates, field = made([STILL, STILL, STILL], RATE)
    rates[600:1000] = field[600:1000] = math.nan
    rates[::97] = math.nan
    its = found(rates, field)
    assert told(its) == [("rest", 0.0, 60.0), ("missing", 60.0, 100.0), ("rest", 100.0, 180.0)]
    assert tripped(its) == set()


def test_gates_name_the_phase_that_they_speak_against():
    """A spin beyond the full scale, a field axis that hangs in it, a spike at rest."""
    rates, field = made([STILL, turning(120, RATE, (0.0, 0.0, 60.0)), STILL], RATE)
    clipped, hung, spiked = rates.clip(-50.0, 50.0), field.copy(), rates.copy()
    hung[700:1700, 1] = 7.0
    spiked[300, 0] += 1.0
    assert (1, "saturated") in tripped(found(clipped, field, facts=Facts(full_scale=50.0)))
    assert (1, "stuck") in tripped(found(rates, hung))
    assert tripped(found(spiked, field)) == {(0, "spikes")}


def test_a_field_that_was_filled_with_zeros_is_told():
    """Attack: a program writes 0 where a slower magnetometer has no reading; every phase would be a rotation."""
    rates, field = made([STILL, SPIN, STILL], RATE)
    assert not {number for number, name in tripped(found(rates, field)) if name == "filled"}
    field[np.arange(len(field)) % 5 != 0] = 0.0
    its = found(rates, field)
    assert {number for number, name in tripped(its) if name == "filled"} == set(range(len(its.phases)))


def test_iron_of_the_body_shows_as_ripple():
    """More than 3 % of the magnitude in a turn asks for a calibration."""
    its = found(*made([STILL, SPIN, STILL], RATE, iron=(12.0, 0.0, 0.0)))
    assert its.phases[1].ripple.value > 0.05
    assert "calibrate the magnetometer" in its.phases[1].remark


def test_a_log_that_never_rests_says_so():
    """No bias is invented."""
    its = found(*made([SPIN, SHAKEN], RATE))
    assert its.bias == (0.0, 0.0, 0.0)
    assert "nothing was at rest: the rates hold the bias" in its.remarks


@pytest.mark.parametrize("seed", sweeps.sample(range(20), 2))
def test_turning_is_told_without_bias_noise_and_ends(seed):
    """12 deg/s to within its doubt although the phase begins and ends in windows at rest; nothing at rest."""
    its = found(*made([STILL, SPIN, turning(60, RATE, (0.5, 0.3, 0.0)), STILL], RATE, seed=seed))
    rest, spin, slow, _ = its.phases
    assert rest.turning.status is FigureStatus.NOT_OBSERVABLE
    assert spin.turning.value == pytest.approx(12.0, abs=0.015)
    assert slow.turning.value == pytest.approx(math.hypot(0.5, 0.3), abs=0.015)


def test_a_steady_fast_spin_is_no_rest():
    """Attack: it turns in every window by more than a turn, so that all of them are alike."""
    its = found(*made([turning(200, RATE, (0.0, 0.0, 200.0))], RATE))
    assert [phase.kind.value for phase in its.phases] == ["rotation"]
    assert "nothing was at rest: the rates hold the bias" in its.remarks


def test_a_steady_spin_about_the_field_has_no_bias():
    """Attack: nothing moves for the magnetometer, and the rates stay: more than a bias is."""
    its = found(*made([turning(120, RATE, tuple(25.0 * FIELD / np.linalg.norm(FIELD)))], RATE))
    assert {name for _, name in tripped(its)} == {"bias"}


def test_a_slow_tumble_near_the_noise_is_no_rest_without_a_word():
    """Attack: 0.2 deg/s about axes that change: what is called rest says that its field turned, if it lasts 12 s."""
    seconds = np.arange(6000) / RATE
    axes = [0.15 * np.sin(seconds / 40.0), 0.15 * np.cos(seconds / 55.0), 0.1 * np.sin(seconds / 23.0)]
    its = found(*made([np.stack(axes, axis=1)], RATE))
    at_rest = [(number, phase) for number, phase in enumerate(its.phases) if phase.kind is Kind.REST]
    resting = {number for number, phase in at_rest if phase.end - phase.begin >= 12.0}
    assert resting
    assert {number for number, name in tripped(its) if name == "stands"} >= resting


def test_a_field_of_another_size_than_the_earths_is_told():
    """Sensors whose columns were taken for each other, or nT called uT; of counts nobody knows."""
    rates, field = made([STILL, SPIN, STILL], RATE)
    assert found(rates, field, microtesla=1.0).remarks == ()
    (told_of,) = found(rates, field * 1000.0, microtesla=1.0).remarks
    assert told_of.startswith("the field has 4.68e+04 uT, the earth's 15 to 75")
    assert found(rates, field * 1000.0).remarks == ()


def test_a_log_of_a_few_windows_is_refused():
    """Nothing could be compared."""
    with pytest.raises(Refused, match=r"15 s are less than 10 windows of 2 s"):
        found(*made([turning(15, RATE)], RATE))


def test_white_noise_is_told_of_the_longest_rests(monkeypatch):
    """A fit takes its time; the others have their bias, and that is said."""
    monkeypatch.setattr("hil.analysis.flight._MOST", 1)
    its = found(*made([STILL, SPIN, turning(80, RATE)], RATE))
    first, _, last = its.phases
    assert {figure.status for figure in first.white} == {FigureStatus.NOT_OBSERVABLE}
    assert all(figure.value > 0.0 for figure in last.white)
    assert all(figure.uncertainty > 0.0 for figure in first.rates)
    assert its.remarks == ("white noise is told of the 1 longest of 2 rests",)


def test_axes_that_are_never_there_together_tell_no_size():
    """Attack: x of the field in every other row, y in the others; no warning, and no number from nothing."""
    rates, field = made([STILL, SPIN, STILL], RATE)
    field[::2, 0] = field[1::2, 1] = math.nan
    its = found(rates, field)
    assert [gate.ok for phase in its.phases for gate in phase.gates if gate.name == "stands"] == [None, None]
    rates[::2, 0] = rates[1::2, 1] = math.nan
    spin = found(rates, field).phases[1]
    assert spin.turning.status is FigureStatus.NOT_OBSERVABLE


@pytest.mark.parametrize("factor", [1e90, 1e-90])
def test_numbers_of_any_size_keep_their_doubt(factor):
    """A unit that is far off is told by gates, not by an overflow."""
    rates, field = made([STILL, SPIN, STILL], RATE)
    its = found(rates * factor, field, still=factor)
    assert its.phases[1].turning.value == pytest.approx(12.0 * factor, rel=2e-3)
    assert 0.0 < its.phases[1].turning.uncertainty < 0.01 * factor
