"""The analysis of batteries against cells of known truth, a real cycler's own sums, and a published table."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from scipy import integrate, stats

from hil.analysis.battery.counted import net
from hil.analysis.battery.cycles import cycles, equivalent_full_cycles
from hil.analysis.battery.fade import fade
from hil.analysis.battery.gates import Declared, Told, judge, tripped
from hil.analysis.battery.half_cycle import Limits, first_fall, first_rise, flow
from hil.analysis.battery.incremental import incremental_capacity
from hil.analysis.battery.integration import cumulative, one_way
from hil.analysis.battery.series import series
from hil.analysis.battery.steps import Segmentation, StepKind, segment
from hil.analysis.battery.summary import summarise
from hil.logs.novonix import read
from hil.model.errors import Refused
from tests.support import cell

NOVONIX = Path(__file__).parents[2] / "docs" / "data" / "battery-novonix.csv"
LIMITS = Limits(upper=4.2, lower=2.7, cut_off=0.05, tolerance=1e-6)

# Published for the battery of a PocketQube: ten cycles at 0.7 A between 4.2 V and 2.7 V, declared as 1.4 Ah, 5.16 Wh.
DISCHARGE_TIME = "2:47:58 2:46:48 2:47:05 2:47:00 2:46:45 2:46:50 2:46:30 2:46:25 2:46:20 2:45:55"
CHARGE_TIME = "4:18:30 4:20:30 4:20:35 4:14:34 4:17:25 4:16:25 4:14:25 4:11:35 4:13:50 4:12:10"
CHARGE_WH = (7.98, 8.04, 8.04, 8.03, 8.03, 8.02, 8.01, 8.00, 7.99, 7.99)
DISCHARGE_WH = (7.07, 7.03, 7.06, 7.06, 7.06, 7.06, 7.04, 7.05, 7.04, 7.02)
NUMBERS = range(1, 11)


def seconds(times):
    """Return times as h:mm:ss in s."""
    return [
        sum(int(part) * unit for part, unit in zip(each.split(":"), (3600, 60, 1), strict=True))
        for each in times.split()
    ]


def published(**changes):
    """The medians of the published table; the discharge charge is current times time."""
    durations = [sum(pair) for pair in zip(seconds(DISCHARGE_TIME), seconds(CHARGE_TIME), strict=True)]
    out = 0.7 * float(np.median(seconds(DISCHARGE_TIME))) / 3600.0
    numbers = {
        "charge_in": out,  # nothing else is known of it: a coulombic efficiency of one
        "charge_out": out,
        "energy_in": float(np.median(CHARGE_WH)),
        "energy_out": float(np.median(DISCHARGE_WH)),
        "duration": float(np.median(durations)),
    }
    return Told(**(numbers | changes))


DECLARED = Declared(capacity=1.4, energy=5.16, upper=4.2, lower=2.7)


def test_the_real_cycler_and_the_trapezoid_agree():
    """Charge and energy from the second row on as the cycler's own sums to 1e-6, with the unsampled start to 3e-5."""
    log = read(NOVONIX)
    (only,) = cycles(series(log.time, log.voltage, log.current, temperature=log.temperature, cycle=log.cycle))
    assert only.charge.charge == pytest.approx(log.own_charge, rel=3e-5)
    assert only.charge.energy == pytest.approx(log.own_energy, rel=3e-5)
    after = slice(1, None)
    part = one_way(log.time[after], log.current[after], 1).sum()
    assert part == pytest.approx(1.70652976 - 0.00013502, rel=1e-6)
    assert not only.complete
    assert only.resistances[0].value == pytest.approx((3.85240349 - 3.84318331) / 0.49989602)
    assert only.resistances[0].delay == pytest.approx(1.28, abs=0.001)


def test_a_count_tells_when_the_current_began():
    """With the cycler's count of the first 1.28 s the charge agrees to 3e-7 and the energy to 2e-6 with its own."""
    log = read(NOVONIX)
    data = series(log.time, log.voltage, log.current, charge=log.charge, energy=log.energy)
    (only,) = cycles(data)
    assert only.charge.charge == pytest.approx(1.70652976, rel=3e-7)
    assert only.charge.energy == pytest.approx(6.84854718, rel=2e-6)
    sums = net(data, segment(data), energy=False)
    assert (sums.edges, sums.counted) == (1, pytest.approx(0.00013502))
    assert abs(sums.counted - (sums.counted + sums.samples - sums.value)) < 2.0 * sums.open


@pytest.mark.parametrize("wrong", [-1.0, 10.0])
def test_a_count_that_cannot_be_is_not_taken(wrong):
    """A counter of the other sign, or one that tells more than the current can have moved, changes nothing."""
    log = read(NOVONIX)
    plain = series(log.time, log.voltage, log.current)
    data = series(log.time, log.voltage, log.current, charge=wrong * log.charge, energy=wrong * log.energy)
    assert cycles(data)[0].charge.charge == cycles(plain)[0].charge.charge
    assert net(data, segment(data), energy=True).edges == 0


def test_sums_are_those_of_scipy():
    """One-way sums of a current without change of sign are the trapezoids of scipy, also on uneven times."""
    time = np.cumsum(np.random.default_rng(3).uniform(1.0, 30.0, 500))
    rate = 0.7 + 0.1 * np.sin(time / 300.0)
    assert np.allclose(
        cumulative(one_way(time, rate, 1)), integrate.cumulative_trapezoid(rate, time, initial=0.0) / 3600.0, rtol=1e-12
    )
    assert one_way(time, -rate, -1).sum() == pytest.approx(integrate.trapezoid(rate, time) / 3600.0)


def test_a_change_of_sign_splits_an_interval():
    """From +1 A to -3 A in 4 s: one second flows in, three out, and nothing cancels."""
    time, rate = np.array([0.0, 4.0]), np.array([1.0, -3.0])
    assert one_way(time, rate, 1).sum() * 3600.0 == pytest.approx(0.5)
    assert one_way(time, rate, -1).sum() * 3600.0 == pytest.approx(4.5)


@pytest.mark.parametrize("interval", [1.0, 5.0, 30.0])
def test_a_cycle_of_known_truth(interval):
    """Capacity, CC and CV parts, both crossing times, rests and resistance come out at 1 to 30 s."""
    charge, to_limit, to_cut_off = cell.truth()
    (only,) = cycles(series(*cell.cycle(interval)), LIMITS)
    assert only.complete
    assert only.charge.charge == pytest.approx(charge, abs=0.7 * interval / 3600.0)
    assert only.discharge.charge == pytest.approx(charge, abs=0.7 * interval / 3600.0)
    assert only.coulombic_efficiency == pytest.approx(1.0, abs=0.005)
    assert only.charge.time_to_limit == pytest.approx(to_limit, abs=interval)
    assert only.charge.time_to_cut_off == pytest.approx(to_cut_off, abs=interval)
    # Constant voltage is seen when the current has fallen by 3 %: after 55 s of these 1800.
    assert only.charge.cc_time == pytest.approx(to_limit - 1800.0 * math.log(0.97), abs=4.0 * interval)
    assert only.charge.cv_charge == pytest.approx(0.35 * (0.97 - 0.05 / 0.7), abs=3e-3 + 0.7 * interval / 1200.0)
    assert [rest.after for rest in only.rests] == [StepKind.CHARGE, StepKind.DISCHARGE]
    assert only.rests[0].voltage == pytest.approx(4.2 - 0.035)
    onset = next(edge for edge in only.resistances if edge.before is StepKind.REST)
    assert onset.value == pytest.approx(cell.RESISTANCE, rel=0.15)
    assert onset.delay == interval


def test_an_edge_at_the_last_sample_is_told():
    """A log that ends with the first sample of a rest: the resistance at the end of the discharge is not lost."""
    time, voltage, current = cell.cycle(1.0)
    end = int(np.flatnonzero(current < 0)[-1]) + 2
    (only,) = cycles(series(time[:end], voltage[:end], current[:end]), LIMITS)
    assert only.resistances[-1].after is StepKind.REST
    assert only.resistances[-1].time == time[end - 1]


@pytest.mark.parametrize("number", [2, 3])
def test_a_row_speaks_against_the_one_cycle_that_holds_it(number):
    """The first row of a cycle is not of the one before it, and the last of all is of the last cycle."""
    time, voltage, current = cell.campaign(3, 30.0)
    starts = [each.start for each in cycles(series(time, voltage, current), LIMITS)]
    warmth = np.full(time.size, 25.0)
    warmth[{2: np.searchsorted(time, starts[1]), 3: -1}[number]] = 300.0
    gates = summarise(series(time, voltage, current, temperature=warmth), limits=LIMITS).gates
    assert next(gate for gate in gates if gate.name == "temperature").cycles == (number,)


def test_mean_voltage_is_energy_over_charge():
    """The discharge falls in a straight line at constant current: its mean is the middle."""
    (only,) = cycles(series(*cell.cycle(1.0)), LIMITS)
    assert only.discharge.mean_voltage == pytest.approx((4.13 + 2.7) / 2.0, abs=1e-3)
    assert only.energy_efficiency == pytest.approx(only.discharge.energy / only.charge.energy)


def test_ripple_makes_no_steps():
    """Ripple of 5 mA on every sample, rests included, leaves the steps of three cycles as they are."""
    data = series(*cell.campaign(3, 5.0, ripple=0.005))
    kinds = [step.kind for step in segment(data, Segmentation(rest_current=0.02))]
    assert kinds == [StepKind.CHARGE, StepKind.REST, StepKind.DISCHARGE, StepKind.REST] * 3


def test_one_lost_reading_of_zero_makes_no_rest():
    """A single zero within a charge is a glitch; two are a rest."""
    time, voltage, current = cell.cycle(5.0)
    current[100] = 0.0
    assert len(segment(series(time, voltage, current))) == 4
    current[101] = 0.0
    assert len(segment(series(time, voltage, current))) == 6


def test_gaps_are_bridged_within_a_step_and_not_across():
    """A gap within a charge is bridged and told; one from charge to discharge makes the cycle incomplete."""
    time, voltage, current = cell.cycle(5.0)
    middle = (time > 1000.0) & (time < 2000.0)
    (only,) = cycles(series(*(each[~middle] for each in (time, voltage, current))), LIMITS)
    assert only.complete
    assert only.charge.gaps == 1
    assert only.charge.bridged_charge == pytest.approx(0.7 * 1000.0 / 3600.0, rel=0.02)
    across = (time > 5000.0) & (time < 13000.0)
    (torn,) = cycles(series(*(each[~across] for each in (time, voltage, current))), LIMITS)
    assert not torn.complete
    assert torn.charge.charge < 1.0


def test_cycles_follow_the_leading_half():
    """Three cycles are three, numbered from one, each as long as the others; throughput over twice the capacity."""
    made = cycles(series(*cell.campaign(3, 5.0)), LIMITS)
    assert [each.number for each in made] == [1, 2, 3]
    assert made[0].duration == pytest.approx(made[1].duration, abs=5.0)
    assert equivalent_full_cycles(made, 1.4) == pytest.approx(3.0 * cell.truth()[0] / 1.4, rel=0.002)


def test_the_numbers_of_the_source_hold():
    """Where the log counts cycles from seven these numbers stand, though a mark comes a sample late."""
    time, voltage, current = cell.campaign(2, 5.0)
    number = np.where(time < time[-1] / 2.0 + 10.0, 7, 8)
    assert [each.number for each in cycles(series(time, voltage, current, cycle=number))] == [7, 8]


def test_temperatures_of_a_half_cycle():
    """Lowest, highest, mean over time and rise; a missing temperature is left out."""
    time, voltage, current = cell.cycle(5.0)
    warmth = 25.0 + 4.0 * time / 5760.0
    warmth[10] = math.nan
    (only,) = cycles(series(time, voltage, current, temperature=warmth), LIMITS)
    end = 25.0 + 4.0 * only.charge.duration / 5760.0
    assert only.charge.temperature_low == 25.0
    assert only.charge.temperature_high == pytest.approx(end)
    assert only.charge.temperature_mean == pytest.approx((25.0 + end) / 2.0, abs=0.01)
    assert only.charge.temperature_rise == pytest.approx(end - 25.0)


def test_crossings_are_the_first_and_lie_between_samples():
    """The first crossing counts, also where noise comes back; what never crosses is NaN."""
    time = np.arange(6.0)
    assert first_rise(time, np.array([0.0, 1.0, 3.0, 1.0, 4.0, 5.0]), 2.0) == 1.5
    assert first_fall(time, np.array([0.0, 4.0, 3.0, 1.0, 4.0, 0.0]), 2.0) == 2.5
    assert math.isnan(first_rise(time, np.zeros(6), 2.0))
    assert math.isnan(first_fall(time, np.zeros(6), 2.0))


def test_peaks_of_dq_dv_are_found_under_noise():
    """Two Gaussian peaks of a known Q(V), with 2 mV of noise and 1 mV of resolution."""
    level = np.linspace(3.0, 4.2, 20001)
    density = 0.5 + 6.0 * stats.norm.pdf(level, 3.65, 0.05) / 8.0 + 4.0 * stats.norm.pdf(level, 3.95, 0.04) / 10.0
    total = integrate.cumulative_trapezoid(density, level, initial=0.0)
    charge = np.linspace(0.0, total[-1], 4000)
    voltage = np.interp(charge, total, level) + 0.002 * np.random.default_rng(5).standard_normal(4000)
    curve = incremental_capacity(np.round(voltage, 3), charge, prominence=0.1)
    assert (curve.drawn(StepKind.DISCHARGE) == -curve.drawn(StepKind.CHARGE)).all()
    assert curve.drawn(StepKind.CHARGE).max() > 0.0
    assert [peak.voltage for peak in curve.peaks] == pytest.approx([3.65, 3.95], abs=0.005)
    assert curve.peaks[0].height == pytest.approx(density[np.argmin(np.abs(level - 3.65))], rel=0.05)
    assert integrate.trapezoid(curve.density, curve.voltage) == pytest.approx(total[-1], rel=0.02)


def test_published_energy_does_not_fade_and_time_does():
    """The published table: -2.97 +- 3.55 mWh a cycle is not significant, -9.6 +- 4.1 s a cycle is."""
    energy = fade(NUMBERS, DISCHARGE_WH, "Wh")
    assert energy.slope.value == pytest.approx(-2.97e-3, abs=5e-6)
    assert (energy.high - energy.low) / 2.0 == pytest.approx(3.55e-3, abs=5e-6)
    assert energy.probability == pytest.approx(0.09, abs=0.005)
    assert not energy.significant
    assert energy.first_significant is None
    assert energy.end_of_life.high == math.inf
    time = fade(NUMBERS, seconds(DISCHARGE_TIME), "s")
    assert time.slope.value == pytest.approx(-9.62, abs=0.005)
    assert (time.high - time.low) / 2.0 == pytest.approx(4.1, abs=0.05)
    assert time.probability == pytest.approx(6.4e-4, abs=0.5e-4)
    assert time.significant
    assert time.first_significant == 7


def test_the_slopes_are_those_of_scipy():
    """Least squares and Theil-Sen against scipy.stats; the probability likewise."""
    values = seconds(DISCHARGE_TIME)
    ours, theirs = fade(NUMBERS, values, "s"), stats.linregress(NUMBERS, values)
    assert ours.slope.value == pytest.approx(theirs.slope)
    assert ours.slope.uncertainty == pytest.approx(theirs.stderr)
    assert ours.probability == pytest.approx(theirs.pvalue)
    assert ours.robust == stats.theilslopes(values, NUMBERS).slope


@pytest.mark.parametrize("size", [3, 7, 115])
def test_the_robust_interval_is_that_of_scipy(size):
    """Cycles and values that come more than once widen or narrow it as scipy.stats has it."""
    rng = np.random.default_rng(size)
    for numbers in (np.arange(size), np.sort(rng.integers(0, size, size))):
        values = np.round(1.4 - 0.001 * numbers + 0.003 * rng.normal(size=size), 3)
        ours, theirs = fade(numbers, values, "Ah"), stats.theilslopes(values, numbers, alpha=0.95)
        assert (ours.robust_low, ours.robust, ours.robust_high) == pytest.approx(
            (theirs.low_slope, theirs.slope, theirs.high_slope)
        )


def test_one_outlier_does_not_move_the_robust_slope():
    """A cycle that a power cut shortened moves least squares by far, and Theil-Sen hardly."""
    values = 1.4 - 0.001 * np.arange(1, 31)
    values[29] = 0.4
    found = fade(np.arange(1, 31), values, "Ah")
    assert found.robust == pytest.approx(-0.001, rel=0.05)
    assert found.slope.value < -0.005


def test_first_cycles_can_be_left_out():
    """Three cycles in which the cell settles tilt the line; without them it is the true one."""
    values = 1.4 - 0.001 * np.arange(1, 31)
    values[:3] += (0.2, 0.1, 0.05)
    assert fade(np.arange(1, 31), values, "Ah", skip=3).slope.value == pytest.approx(-0.001)


@pytest.mark.system
def test_intervals_hold_the_truth_as_often_as_they_say():
    """Over 400 simulated fades 95 % of slopes' and ends' intervals hold the truth, within 3.3 standard deviations."""
    noise, hits, ends = np.random.default_rng(11), 0, 0
    where = np.arange(1.0, 41.0)
    truth = 1.0 + (0.2 * (1.4 - 0.004)) / 0.004
    for _ in range(400):
        found = fade(where, 1.4 - 0.004 * where + 0.01 * noise.standard_normal(40), "Ah", remaining=0.8)
        hits += found.low <= -0.004 <= found.high
        ends += found.end_of_life.low <= truth <= found.end_of_life.high
    band = 3.3 * math.sqrt(400 * 0.95 * 0.05)
    assert abs(hits - 380) <= band
    assert abs(ends - 380) <= band


def test_the_published_anomalies_trip_the_gates():
    """1.95 Ah of a 1.4 Ah cell, 7.05 Wh of 5.16 Wh, a charge at 4.12 V in the mean, 211 cycles in 844 h, 4.3 V."""
    found = {
        gate.name: gate.reason for gate in tripped(published(highest=4.3, count=211, elapsed=844 * 3600.0), DECLARED)
    }
    assert set(found) == {
        "capacity_ratio", "energy_ratio", "mean_charge_voltage", "elapsed_time", "highest_voltage",
    }  # fmt: skip
    assert found["capacity_ratio"].startswith("1.39")
    assert found["energy_ratio"].startswith("1.36")
    assert found["mean_charge_voltage"].startswith("4.119 V")
    assert "hold 119." in found["elapsed_time"] or "hold 120" in found["elapsed_time"]


def test_a_sound_test_trips_nothing_and_missing_numbers_are_said():
    """Plausible numbers pass every gate; without any number no gate passes."""
    sound = Told(
        charge_in=1.4, charge_out=1.395, energy_in=5.46, energy_out=5.08, highest=4.205, lowest=2.695,
        duration=17000.0, count=10, elapsed=171000.0, interval=5.0, swing=8000.0,
    )  # fmt: skip
    assert {gate.ok for gate in judge(sound, DECLARED)} == {True}
    assert {gate.ok for gate in judge(Told(), Declared())} == {None}


def test_a_fading_campaign_is_seen_as_a_whole():
    """Twelve cycles that lose 0.5 % each: the slope of the capacity is the truth, the gates see lithium ion."""
    summary = summarise(
        series(*cell.campaign(12, 5.0, fade=0.005)), limits=LIMITS, declared=Declared(capacity=1.4), counted=12
    )
    change = summary.fades["discharge_capacity"]
    assert change.significant
    assert change.slope.value == pytest.approx(-0.005 * 1.4 * 0.8, rel=0.02)
    gates = {gate.name: gate.ok for gate in summary.gates}
    assert gates["coulombic_efficiency"] is True
    assert gates["elapsed_time"] is True
    assert gates["energy_ratio"] is None


def test_every_interval_is_shared_out_once():
    """Charge in less charge out of all intervals is the plain integral of the current."""
    data = series(*cell.campaign(2, 30.0))
    flows = flow(data, segment(data))
    net = flows.charge[StepKind.CHARGE].sum() - flows.charge[StepKind.DISCHARGE].sum()
    assert net == pytest.approx(integrate.trapezoid(data.current, data.time) / 3600.0, abs=1e-12)


REACHED = Limits(upper=4.2, lower=2.8, cut_off=0.05, tolerance=1e-6)
CERTIFIED = {"voltage": 0.002, "current": 0.002, "temperature": 0.5}


@pytest.mark.parametrize("interval", [1.0, 5.0])
def test_how_fast_a_level_is_come_to(interval):
    """A current that fades with 1800 s moves the cut-off by 36 s per mA, a voltage its limit by what it takes per V."""
    (only,) = cycles(series(*cell.cycle(interval)), REACHED)
    near = 0.01 + 0.005 * interval
    assert only.charge.cut_off_sensitivity == pytest.approx(1800.0 / 0.05, rel=near)
    fell = only.discharge.highest_voltage - only.discharge.lowest_voltage
    assert only.discharge.limit_sensitivity == pytest.approx(only.discharge.duration / fell, rel=near)
    assert math.isnan(only.charge.limit_sensitivity)
    assert math.isnan(only.discharge.cut_off_sensitivity)


def row_of(samples, drift=0.0, certified=CERTIFIED):
    """Return a cycle's row of the charge plan, by a tester with a certificate and a clock that drifts."""
    path = Path(__file__).parents[2] / "testplans/battery_charge/test_charge.py"
    spec = importlib.util.spec_from_file_location("numeric_battery_charge", path)
    plan = importlib.util.module_from_spec(spec)
    with patch.object(pytest, "mark"):  # its markers are known in runs only
        spec.loader.exec_module(plan)
    time, voltage, current = samples
    (only,) = cycles(series(time * (1.0 + drift), voltage, current), REACHED)
    stream = SimpleNamespace(drift=drift, drift_uncertainty=1e-6)
    return plan.row_of(only, plan.certainty_of(SimpleNamespace(uncertainty=certified.get, stream=stream)), 0.05)


def times_of(offsets, drift=0.0):
    """Return the times of a cycle, seen by a tester with offsets [V, A] and a clock that drifts, as the plan does."""
    time, voltage, current = cell.cycle(5.0)
    row = row_of((time, voltage + offsets[0], current + np.where(current != 0.0, offsets[1], 0.0)), drift)
    return row["charge_time"], row["discharge_time"]


def test_times_are_as_uncertain_as_what_the_certificate_leaves_open():
    """A meter that is off by its standard uncertainty moves both times by theirs, within a line."""
    exact, moved = times_of((0.0, 0.0)), times_of((-CERTIFIED["voltage"], -CERTIFIED["current"]))
    for was, now in zip(exact, moved, strict=True):
        assert was.value - now.value == pytest.approx(was.uncertainty, abs=5.0 / 3600.0)
    assert exact[0].uncertainty > 60.0 / 3600.0


def test_times_are_as_uncertain_as_the_clock():
    """A tester whose clock is off by 1 % knows no time better than that."""
    for figure in times_of((0.0, 0.0), drift=0.01):
        assert figure.uncertainty >= 0.01 * figure.value


@pytest.mark.system
def test_the_end_of_a_discharge_is_as_uncertain_as_what_no_line_shows():
    """Wherever the lines of a tester fall, the voltage at the end lies as far below the last as is stated at most."""
    time, voltage, current = cell.cycle(0.1)
    exact = {"voltage": 1e-9, "current": 0.0, "temperature": 0.0}
    apart = []
    for first in range(50):
        ended = row_of((time[first::50], voltage[first::50], current[first::50]), certified=exact)
        figure = ended["end_of_discharge_voltage"]
        apart.append((figure.value - cell.LOWER) / (math.sqrt(3.0) * figure.uncertainty))
    assert min(apart) >= 0.0
    assert 0.9 < max(apart) <= 1.0


def doubted(data, **how):
    """Return the gates that speak against a log, with their reasons."""
    limits = how.pop("limits", LIMITS)
    return {gate.name: gate.reason for gate in summarise(data, limits=limits, **how).gates if gate.ok is False}


def test_a_rest_beyond_the_limits_is_doubted():
    """4.35 V at rest, between two half-cycles that keep to theirs; and a cell in mV."""
    time, voltage, current = cell.campaign(2, 30.0)
    high = np.where((current == 0) & (voltage > 4.0), 4.35, voltage)
    assert "4.35 V, limit 4.2 V" in doubted(series(time, high, current))["highest_voltage"]
    assert "--voltage-unit mV" in doubted(series(time, 1e3 * voltage, current))["highest_voltage"]


def test_a_negative_resistance_is_doubted():
    """The voltage that falls where a charge begins."""
    time, voltage, current = cell.campaign(2, 30.0)
    found = doubted(series(time, voltage + np.where(current == 0, 0.3, 0.0), current))
    assert "rest to charge in cycle 2 -0.379 ohm" in found["resistance"]
    assert "resistance" not in doubted(series(time, voltage, current))


def test_a_current_without_its_sign_is_doubted():
    """A discharge that is logged as a charge shows in a voltage that falls."""
    time, voltage, current = cell.campaign(2, 30.0)
    assert "falls by 1.43 V in the charge from" in doubted(series(time, voltage, np.abs(current)))["direction"]


@pytest.mark.parametrize("interval", [5.0, 60.0, 170.0])
def test_capacity_at_the_cut_off_lies_between_samples(interval):
    """The voltage is a straight line of the charge, so that the capacity at any level is known."""
    time, voltage, current = cell.cycle(interval)
    lower = 3.0
    start = cell.UPPER - 2.0 * cell.CURRENT * cell.RESISTANCE
    share = (start - lower) / (start - cell.LOWER)
    half = cycles(series(time, voltage, current), Limits(lower=lower))[0].discharge
    edge = cell.CURRENT * interval / 3600.0
    assert half.charge_to_limit == pytest.approx(share * cell.truth()[0], abs=0.51 * edge)
    assert half.energy_to_limit == pytest.approx(half.charge_to_limit * (start + lower) / 2.0, abs=2.2 * edge)
    assert math.isnan(cycles(series(time, voltage, current), Limits(lower=1.0))[0].discharge.charge_to_limit)


def test_discharges_alone_fade_if_the_capacity_is_known():
    """Each that begins with a full cell is a cycle; a short one is not taken, and without a capacity none is."""
    rows, start = [], 0.0
    for number in range(5):
        time, voltage, current = cell.cycle(20.0, capacity=1.4 * (1.0 - 0.01 * number))
        first, last = np.flatnonzero(current < 0)[[0, -1]]
        part = slice(first - 3, (3 * first + last) // 4 if number == 3 else last + 20)
        rows.append((time[part] - time[first - 3] + start, voltage[part], current[part]))
        start = rows[-1][0][-1] + 20.0
    time, voltage, current = (np.concatenate(each) for each in zip(*rows, strict=True))
    found = summarise(series(time, voltage, current), limits=LIMITS, declared=Declared(capacity=1.4))
    assert [each.number for each in found.compared] == [1, 2, 3, 5]
    assert found.fades["discharge_capacity"].slope.value == pytest.approx(-0.01 * 0.8 * 1.4, rel=0.1)
    assert "charge_energy" not in found.fades
    assert not summarise(series(time, voltage, current), limits=LIMITS).fades


@pytest.mark.parametrize("column", [0, 1, 2])
def test_numbers_near_the_ends_are_refused(column):
    """1e300 is no time, voltage or current; the row is named."""
    columns = [np.array(each) for each in cell.cycle(60.0)]
    columns[column][-1] = 1e300
    with pytest.raises(Refused, match=rf"1e\+300, in row {columns[0].size}, cannot be"):
        series(*columns)
