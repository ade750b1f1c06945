"""Current-voltage curves against the single-diode equation, solved with Lambert's function."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import sweeps
from scipy.optimize import brentq
from scipy.special import lambertw
from scipy.stats import t as student

from hil.analysis import IvConditions, IvFacts, IvSweep, curve_difference, iv_curve, reference_irradiance
from hil.model.figure import Figure, FigureStatus

LIGHT, WARMTH = 1367.0, 28.0
OHMS, SHUNT = 0.12, 900.0
KELVIN = 8.617333262e-5
KEYS = ("short_circuit_current", "open_circuit_voltage", "maximum_power", "fill_factor", "series_resistance")


def diode(light=LIGHT, warmth=WARMTH, ohms=OHMS, shunt=SHUNT):
    """Return photocurrent, saturation current, thermal voltage, series and shunt resistance of three junctions."""
    unit, kelvin = 3.6 * KELVIN, warmth + 273.15
    grown = (kelvin / 301.15) ** 2.5 * math.exp(4.2 / unit * (1 / 301.15 - 1 / kelvin))
    saturation = 0.4 / math.expm1(2.7 / (unit * 301.15)) * grown
    return (0.4 + 2.4e-4 * (warmth - WARMTH)) * light / LIGHT, saturation, unit * kelvin, ohms, shunt


def current_of(voltage, parts):
    """Return the current at these voltages in closed form (A. Jain and A. Kapoor, 2004)."""
    photo, saturation, thermal, ohms, shunt = parts
    total = photo + saturation
    exponent = shunt * (ohms * total + voltage) / (thermal * (ohms + shunt))
    argument = ohms * saturation * shunt / (thermal * (ohms + shunt)) * np.exp(exponent)
    return (shunt * total - voltage) / (ohms + shunt) - thermal / ohms * lambertw(argument).real


def truth(parts):
    """Return the figures of `KEYS` by root finding."""
    short = float(current_of(0.0, parts))
    opened = brentq(lambda volts: float(current_of(volts, parts)), 0.1, 3.0, xtol=1e-13)
    slope = brentq(
        lambda volts: float(volts * current_of(volts, parts) - (volts - 1e-6) * current_of(volts - 1e-6, parts)),
        0.5 * opened,
        opened,
        xtol=1e-9,
    )
    power = slope * float(current_of(slope, parts))
    return dict(zip(KEYS, (short, opened, power, power / short / opened, parts[3]), strict=True))


def points(parts, count=40, lowest=0.03):
    """Return voltages and currents as the plan measures them: closer towards open circuit, which is the last one."""
    opened = truth(parts)["open_circuit_voltage"]
    voltage = np.maximum(opened * (1 - (1 - np.linspace(0, 1, count)) ** 2), lowest)
    return voltage, np.maximum(current_of(voltage, parts), 0.0)


def sweep(voltage, current, light=LIGHT, warmth=WARMTH):
    """Return a sweep under constant conditions."""
    return IvSweep(
        voltage=voltage,
        current=current,
        irradiance=np.full(len(voltage), light),
        temperature=np.full(len(voltage), warmth),
    )


def exact(value):
    """Return a coefficient that is known exactly."""
    return Figure(value=value, unit="1", uncertainty=0.0)


@pytest.mark.parametrize("ohms", [0.02, 0.12, 0.6])
@pytest.mark.parametrize("shunt", [60.0, 900.0])
def test_figures_of_a_curve_without_noise(ohms, shunt):
    """Open voltage and resistances are those of the equation; the polynomial leaves 1e-4 of the power at most."""
    parts = diode(ohms=ohms, shunt=shunt)
    found, true = iv_curve(sweep(*points(parts))).figures, truth(parts)
    assert found["short_circuit_current"].value == pytest.approx(true["short_circuit_current"], rel=1e-6)
    assert found["open_circuit_voltage"].value == pytest.approx(true["open_circuit_voltage"], rel=1e-6)
    assert found["maximum_power"].value == pytest.approx(true["maximum_power"], rel=1e-4)
    assert found["fill_factor"].value == pytest.approx(true["fill_factor"], rel=1e-4)
    assert found["series_resistance"].value == pytest.approx(ohms, rel=3e-3, abs=2e-5)
    assert found["shunt_conductance"].value == pytest.approx(1 / shunt, rel=1e-2)
    both = found["voltage_at_maximum"].value * found["current_at_maximum"].value
    assert both == pytest.approx(found["maximum_power"].value, rel=1e-8)


def test_order_of_the_points_does_not_count_and_the_scale_does():
    """Shuffled points give the same; twice the current gives twice the power and the same fill factor."""
    voltage, current = points(diode())
    shuffled = np.random.default_rng(3).permutation(voltage.size)
    first, other = (iv_curve(sweep(voltage, current)), iv_curve(sweep(voltage[shuffled], current[shuffled])))
    twice = iv_curve(sweep(voltage, 2.0 * current))
    for name, figure in first.figures.items():
        assert other.figures[name].value == pytest.approx(figure.value, rel=1e-8)
    assert twice.figures["maximum_power"].value == pytest.approx(2 * first.figures["maximum_power"].value)
    assert twice.figures["fill_factor"].value == pytest.approx(first.figures["fill_factor"].value)


def coefficients(procedure):
    """Return those of the equation's own parameters, at the conditions: differences over 1 K and 5 % of light."""
    here, warmer, darker = (truth(diode(**each)) for each in ({}, {"warmth": 29.0}, {"light": 0.95 * LIGHT}))
    alpha, beta = (warmer[name] - here[name] for name in KEYS[:2])
    by = (1.0, 1.0) if procedure == 1 else (here[KEYS[0]], here[KEYS[1]])
    bend = (here[KEYS[1]] / darker[KEYS[1]] - 1.0) / math.log(1 / 0.95)
    return IvConditions(
        irradiance=LIGHT,
        temperature=WARMTH,
        procedure=procedure,
        alpha=exact(alpha / by[0]),
        beta=exact(beta / by[1]),
        resistance=exact(OHMS),
        kappa=exact(0.0028),
        light=exact(bend),
    )


@pytest.mark.parametrize(("procedure", "light", "off"), [(1, 1290.0, 4e-4), (2, 1290.0, 4e-4), (2, 1100.0, 3e-3)])
def test_correction_gives_the_curve_of_the_stated_conditions(procedure, light, off):
    """From 39 degC and less light to 28 degC and 1367 W/m^2; without correction the power is 8 % off."""
    measured = sweep(*points(diode(light, 39.0)), light, 39.0)
    found, true = iv_curve(measured, coefficients(procedure)), truth(diode())
    assert found.doubts == ()
    for name in KEYS[:4]:
        assert found.figures[name].value == pytest.approx(true[name], rel=off), name
    assert found.figures["series_resistance"].value == pytest.approx(OHMS, rel=1e-3)
    raw = iv_curve(measured).figures["maximum_power"].value
    assert raw < 0.93 * true["maximum_power"]


def test_the_equations_are_those_of_the_standard():
    """By hand, for the point at 2 V and 0.35 A of a sweep that has its short circuit at 0.4 A."""
    voltage = np.array([0.0, 0.1, 0.2, 0.3, 2.0])
    current = np.array([0.4, 0.4, 0.4, 0.4, 0.35])
    first = IvConditions(
        irradiance=1200.0,
        temperature=25.0,
        procedure=1,
        alpha=exact(3e-4),
        beta=exact(-6e-3),
        resistance=exact(0.1),
        kappa=exact(2e-3),
    )
    shown = iv_curve(sweep(voltage, current, 1000.0, 35.0), first)
    raised = 0.35 + 0.4 * 0.2 + 3e-4 * -10
    assert shown.current[-1] == pytest.approx(raised, rel=1e-8)
    lowered = 2.0 - 0.1 * (raised - 0.35) - 2e-3 * raised * -10 + -6e-3 * -10
    assert shown.voltage[-1] == pytest.approx(lowered, rel=1e-8)
    shown = iv_curve(sweep(voltage, current, 1000.0, 35.0), replace(first, procedure=2, alpha=exact(1e-3)))
    assert shown.current[-1] == pytest.approx(0.35 * 1.2 / 1.01, rel=1e-8)


def test_each_point_is_corrected_by_its_own_light():
    """A lamp that falls by 1 % along the sweep leaves no trace in the corrected figures."""
    true = truth(diode())
    light = np.linspace(1300.0, 1287.0, 40)
    voltage, _ = points(diode(1293.0))
    current = np.array([max(0.0, float(current_of(v, diode(g)))) for v, g in zip(voltage, light, strict=True)])
    measured = IvSweep(voltage=voltage, current=current, irradiance=light, temperature=np.full(40, WARMTH))
    for procedure in (1, 2):
        found = iv_curve(measured, coefficients(procedure)).figures
        assert found["maximum_power"].value == pytest.approx(true["maximum_power"], rel=5e-4)


def test_figures_do_not_depend_on_the_order_of_sums():
    """Rounding of the last digits, as another machine or another place in memory makes it, changes no figure."""
    voltage, current = points(diode(1290.0, 39.0))
    rng = np.random.default_rng(11)
    voltage, current = voltage + 2e-4 * rng.normal(size=40), current + 2e-5 * rng.normal(size=40)
    conditions = replace(coefficients(2), beta=Figure(value=-2.1e-3, unit="1/K", uncertainty=1e-4))
    told = []
    for factor in (1.0, 1.0 + 2e-16):
        turned = np.array([each * factor for each in voltage])
        told.append(iv_curve(sweep(certified(turned, "V", 1e-3), current, 1290.0, 39.0), conditions).figures)
    assert told[0] == told[1]


def test_intervals_cover_as_they_claim():
    """95 % intervals from the scatter, over seeds, without and with correction; and none is far too wide."""
    count = sweeps.chosen(25, 500)
    parts = diode(1290.0, 39.0)
    voltage, current = points(parts)
    true = truth(parts)
    inside, claimed, spread = [], [], []
    for seed in range(count):
        rng = np.random.default_rng([17, seed])
        noisy = sweep(voltage + 2e-4 * rng.normal(size=40), current + 2e-5 * rng.normal(size=40))
        found = iv_curve(noisy).figures
        for name in KEYS:
            reach = student.ppf(0.975, found[name].dof) * found[name].uncertainty
            inside.append(abs(found[name].value - true[name]) <= reach)
        claimed.append([found[name].uncertainty for name in KEYS])
        spread.append([found[name].value for name in KEYS])
    share = np.mean(inside)
    band = 4.0 * math.sqrt(0.95 * 0.05 / count)  # the figures of one sweep hang together
    assert 0.95 - band < share <= min(1.0, 0.95 + band), share
    ratio = np.sqrt(np.square(claimed).mean(axis=0)) / np.std(spread, axis=0)
    assert (ratio < 2.0).all(), dict(zip(KEYS, ratio, strict=True))
    assert (ratio > 0.6).all(), dict(zip(KEYS, ratio, strict=True))


def certified(values, unit, relative):
    """Return readings of one instrument with a relative uncertainty."""
    return [Figure(value=float(each), unit=unit, uncertainty=abs(float(each)) * relative) for each in values]


def test_a_gain_that_all_points_share_cancels_in_the_fill_factor():
    """1 % of voltage and 0.5 % of current are 1.1 % of the power, and nothing of the fill factor."""
    voltage, current = points(diode())
    found = iv_curve(
        IvSweep(
            voltage=certified(voltage, "V", 0.01),
            current=certified(current, "A", 0.005),
            irradiance=certified(np.full(40, LIGHT), "W/m^2", 0.0),
            temperature=certified(np.full(40, WARMTH), "degC", 0.0),
        )
    ).figures
    power, ratio = found["maximum_power"], found["fill_factor"]
    assert power.uncertainty / power.value == pytest.approx(math.hypot(0.01, 0.005), rel=0.02)
    assert ratio.uncertainty / ratio.value < 1e-3
    assert found["short_circuit_current"].uncertainty == pytest.approx(0.005 * 0.4, rel=0.01)


def test_uncertainty_of_light_and_coefficients_is_carried():
    """1 % of irradiance is 1 % of the current; an unknown uncertainty leaves all unknown."""
    voltage, current = points(diode(1290.0, 39.0))
    measured = IvSweep(
        voltage=voltage,
        current=current,
        irradiance=certified(np.full(40, 1290.0), "W/m^2", 0.01),
        temperature=certified(np.full(40, 39.0), "degC", 0.0),
    )
    conditions = coefficients(2)
    found = iv_curve(measured, conditions).figures
    assert found["short_circuit_current"].uncertainty == pytest.approx(0.004, rel=0.02)
    wider = replace(conditions, beta=Figure(value=conditions.beta.value, unit="1/K", uncertainty=1e-4))
    assert iv_curve(measured, wider).figures["open_circuit_voltage"].uncertainty == pytest.approx(2.7e-4 * 11, rel=0.1)
    unknown = replace(conditions, beta=Figure(value=conditions.beta.value, unit="1/K"))
    assert {each.uncertainty for each in iv_curve(measured, unknown).figures.values()} == {None}


def doubted(measured, conditions=None, **facts):
    """Return the names of the gates that trip."""
    return {gate.name for gate in iv_curve(measured, conditions, IvFacts(**facts)).gates if gate.ok is False}


def test_every_defect_has_its_gate():
    """And a good sweep trips none."""
    voltage, current = points(diode())
    good = {"current": 0.4, "voltage": 2.7, "irradiance": 1367.0}
    assert doubted(sweep(voltage, current), coefficients(2), **good) == set()
    assert "polarity" in doubted(sweep(voltage, -current))
    assert "polarity" in doubted(sweep(-voltage, current))
    assert doubted(sweep(voltage * 1e3, current), **good) == {"unit"}
    assert doubted(sweep(voltage, current * 1e3), **good) == {"unit"}
    assert "saturated" in doubted(sweep(voltage, np.minimum(current, 0.3)))
    assert "short circuit" in doubted(sweep(voltage[voltage > 0.8], current[voltage > 0.8]))
    assert "open circuit" in doubted(sweep(voltage[current > 0.1], current[current > 0.1]))
    assert "knee" in doubted(sweep(voltage[::6], current[::6]))
    stepped = np.where(voltage > 2.3, 0.97, 1.0) * current
    assert "smooth" in doubted(sweep(voltage, stepped))
    assert "survey" in doubted(sweep(voltage, current, 1200.0), irradiance=1367.0)
    assert "correction" in doubted(sweep(voltage, current, 800.0), coefficients(2))
    assert "correction" in doubted(sweep(voltage, current, LIGHT, 80.0), coefficients(2))
    fading = IvSweep(
        voltage=voltage, current=current, irradiance=np.linspace(1367, 1250, 40), temperature=np.full(40, 28.0)
    )
    assert doubted(fading) == {"lamp"}
    assert {"lamp", "polarity"} <= doubted(sweep(voltage, np.zeros(40), 0.0))
    holed = np.where(np.arange(40) == 5, math.nan, current)
    assert doubted(sweep(voltage, holed)) == {"finite"}


def test_what_a_sweep_does_not_show_is_not_observable():
    """Without points near short circuit there is no short-circuit current, and no fill factor."""
    voltage, current = points(diode())
    found = iv_curve(sweep(voltage[voltage > 0.8], current[voltage > 0.8])).figures
    for name in ("short_circuit_current", "fill_factor", "shunt_conductance"):
        assert found[name].status is FigureStatus.NOT_OBSERVABLE, name
    assert found["maximum_power"].value == pytest.approx(truth(diode())["maximum_power"], rel=1e-4)
    with pytest.raises(ValueError, match="at least two points"):
        iv_curve(sweep([1.0], [0.1]))


def test_how_far_the_current_is_extrapolated():
    """The lowest point at 0.12 V is 4.4 % of the open voltage away; the shunt makes 0.13 mA of that."""
    found = iv_curve(sweep(*points(diode(), lowest=0.12)))
    assert found.reach == pytest.approx(0.12 / 2.6993, rel=1e-3)
    assert found.extrapolated == pytest.approx(0.12 / SHUNT, rel=0.02)


def test_sweeps_are_compared_without_what_they_share():
    """1 % less power is found to the scatter's uncertainty, whatever the certificates say."""
    voltage, current = points(diode())
    rng = np.random.default_rng(5)
    first, other = (
        iv_curve(sweep(certified(voltage, "V", 0.02), current * factor + 2e-5 * rng.normal(size=40)))
        for factor in (1.0, 0.99)
    )
    found = curve_difference(first, other, "maximum_power")
    assert found.value == pytest.approx(-0.01005, abs=4 * found.uncertainty)
    assert 1e-5 < found.uncertainty < 5e-4
    dark = iv_curve(sweep(voltage, np.zeros(40)))
    assert curve_difference(first, dark, "maximum_power").status is FigureStatus.NOT_OBSERVABLE


def test_irradiance_of_a_reference_cell():
    """By hand; its uncertainty against moving each argument by its own."""
    given = {
        "current": Figure(value=0.0259, unit="A", uncertainty=1e-5),
        "temperature": Figure(value=31.0, unit="degC", uncertainty=0.3),
        "sensitivity": Figure(value=2e-5, unit="A.m^2/W", uncertainty=2e-7),
        "coefficient": Figure(value=5e-4, unit="1/K", uncertainty=1e-4),
    }
    found = reference_irradiance(**given)
    assert found.value == pytest.approx(0.0259 / (2e-5 * 1.003))
    moved = [
        reference_irradiance(**{**given, name: replace(each, value=each.value + each.uncertainty)}).value - found.value
        for name, each in given.items()
    ]
    assert found.uncertainty == pytest.approx(math.hypot(*moved), rel=1e-2)
    unknown = reference_irradiance(**{**given, "current": Figure(value=0.0259, unit="A")})
    assert unknown.uncertainty is None
