"""The model of a photodiode against SciPy's solution of the circuit, and its calibration as statistics."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from photodiode_readings import FULL_SCALE, LOADS, TRUTH, campaign, solved
from scipy.differentiate import derivative
from scipy.optimize import curve_fit

from hil.analysis.photodiode.calibrate import calibrate_photodiode
from hil.analysis.photodiode.diode import Diode
from hil.analysis.photodiode.readings import Known

REAL = {"shunt": 2e-7, "series": 60.0}
DIODE = Diode(**TRUTH, **REAL)
WARMTH = np.linspace(-20.0, 60.0, 9)
UNCERTAIN = Known(full_scale=FULL_SCALE, reference=2e-4, offset=1e-4, load=5e-4, temperature=0.1)


@pytest.mark.parametrize("load", [*LOADS, 1e5])
@pytest.mark.parametrize("light", [1e-3, 1.0, 3.0])
def test_voltage_and_light_are_those_of_the_circuit(load, light):
    """Newton's solution against Lambert's function, and equation 1 turned round against what was put in."""
    volts = DIODE.voltage_of(light, WARMTH, load)
    assert volts == pytest.approx(solved(light, WARMTH, load, **REAL), rel=1e-9)
    assert DIODE.light_of(volts, WARMTH, load) == pytest.approx(45e-6 * light, rel=1e-9)


@pytest.mark.parametrize("load", LOADS)
def test_sensitivity_is_the_derivative_of_the_circuit(load):
    """Equation 6 against SciPy's numeric derivative of Lambert's solution: 2.7 mV/K down, and up at a small load."""
    found = derivative(lambda celsius: solved(1.0, celsius, load, **REAL), WARMTH, initial_step=0.5)
    assert found.success.all()
    assert DIODE.sensitivity(1.0, WARMTH, load) == pytest.approx(found.df, rel=1e-7, abs=1e-12)
    assert math.copysign(1.0, DIODE.sensitivity(1.0, 25.0, load)) == (1.0 if load == LOADS[2] else -1.0)


def test_the_coefficient_at_constant_voltage_is_nine_percent():
    """Equation 5 at 0.5 V for n = 1, against a derivative; the source's data reading would double in eight kelvin."""
    ideal = Diode(photocurrent=1e-5, coefficient=0.0, saturation=1e-12, ideality=1.0)

    def log_current(celsius):
        return np.log(ideal.light_of(0.5, celsius, 1e30))  # without a load and light, all of it is the diode's

    slope = derivative(log_current, 27.0, initial_step=0.5).df
    assert ideal.diode_coefficient(0.5, 27.0) == pytest.approx(slope, rel=1e-8)
    assert ideal.diode_coefficient(0.5, 27.0) == pytest.approx(0.0898, abs=2e-4)


def test_an_independent_fit_finds_the_same():
    """SciPy's Levenberg and Marquardt on Lambert's function, numeric derivatives: the same numbers and spreads."""
    volts, degrees, loads, light, _ = campaign(1, count=400)
    report = calibrate_photodiode(volts, degrees, loads, light=light, known=Known(gap_uncertainty=0.0))
    report_light = light / light.mean()

    def model(_, photocurrent, coefficient, saturation, ideality):
        given = {"coefficient": coefficient, "ideality": ideality}
        return solved(
            report_light, degrees, loads, photocurrent=math.exp(photocurrent), saturation=math.exp(saturation), **given
        )

    start = (math.log(4e-5), 0.0, math.log(2e-9), 1.3)
    best, spread = curve_fit(model, degrees, volts, start)
    found = report.diode
    assert [math.log(found.photocurrent), found.coefficient, math.log(found.saturation), found.ideality] == (
        pytest.approx(best, abs=1e-5)
    )
    ratio = np.sqrt(np.diag(report.covariance)[:4] / np.diag(spread))
    assert (ratio > 0.99).all()  # residuals that hang together widen ours
    assert (ratio < 1.5).all()


def test_stated_uncertainties_cover_the_truth():
    """Pulls of all five figures over readings with errors of every declared kind, at 68 and 95 %."""
    seeds = sweeps.sample(range(500), 12)
    pulls = []
    for seed in seeds:
        chance = np.random.default_rng(10_000 + seed)
        errors = (
            UNCERTAIN.reference * chance.standard_normal(),
            UNCERTAIN.offset * chance.standard_normal(),
            UNCERTAIN.load * chance.standard_normal(3),
            UNCERTAIN.temperature * chance.standard_normal(),
        )
        gap = 1.12 + UNCERTAIN.gap_uncertainty * chance.standard_normal()
        volts, degrees, loads, light, fitted = campaign(seed, count=600, errors=errors, gap=gap)
        report = calibrate_photodiode(volts, degrees, loads, light=light, fitted=fitted, known=UNCERTAIN)
        assert report.conclusive, report.doubts
        mean = {**TRUTH, "gap": gap, "photocurrent": TRUTH["photocurrent"] * light.mean()}
        pulls.append([(report.figures[name].value - mean[name]) / report.figures[name].uncertainty for name in TRUTH])
    for level, limit in ((0.68, 0.994), (0.95, 1.96)):
        inside = np.mean(np.abs(pulls) <= limit, axis=0)
        # Of one recording the five figures share its errors, so that each is counted by itself.
        assert inside == pytest.approx(level, abs=3.5 * math.sqrt(level * (1.0 - level) / len(seeds)))


def test_a_shunt_is_found_where_there_is_one():
    """A leak of 100 kilohm is told from none, and fitted; without one a bound is stated."""
    volts, degrees, loads, light, _ = campaign(3, shunt=1e-5)
    report = calibrate_photodiode(volts, degrees, loads, light=light)
    shunt = report.figures["shunt"]
    assert (shunt.status.value, report.covariance.shape) == ("measured", (6, 6))
    assert abs(shunt.value - 1e-5) < 4.0 * shunt.uncertainty < 1e-5
    none = calibrate_photodiode(*campaign(3)[:3], light=light).figures["shunt"]
    assert (none.status.value, none.value < 1e-5) == ("upper limit", True)


def test_one_load_in_constant_light_shows_no_ideality():
    """All ideality factors give one curve: with I_d constant dV/dT is (V - E_g - 3 k T/q)/T, whatever n is."""
    volts, degrees, loads, light, _ = campaign(4, count=300)
    alone = loads == LOADS[0]
    report = calibrate_photodiode(volts[alone], degrees[alone], LOADS[0], light=light[alone])
    assert "identified" in [gate.name for gate in report.gates if gate.ok is False]
    assert {figure.status.value for figure in report.figures.values()} == {"not observable"}
    assert "one load in constant light" in report.identifiability
    kelvin = 298.15
    open_circuit = Diode(**{**TRUTH, "coefficient": 0.0})
    volt = float(open_circuit.voltage_of(1.0, 25.0, 1e12))
    slope = float(open_circuit.sensitivity(1.0, 25.0, 1e12))
    assert slope == pytest.approx((volt - 1.12 - 3 * 8.617333e-5 * kelvin) / kelvin, rel=1e-4)


def test_a_small_load_at_two_temperatures_tells_the_coefficient_from_the_gap():
    """With loads in the cold alone, 0.01 eV of the gap are 0.07 %/K; with loads in the warmth the readings decide."""
    volts, degrees, loads, light, fitted = campaign(5, count=400)
    cold = fitted & ~((degrees > 34.0) & (loads != LOADS[0]))
    moved = []
    for which in (cold, fitted):
        low, high = (
            calibrate_photodiode(
                volts, degrees, loads, light=light, fitted=which, known=Known(gap=gap)
            ).diode.coefficient
            for gap in (1.11, 1.13)
        )
        moved.append(high - low)
    assert moved[0] > 20.0 * abs(moved[1])
    assert abs(moved[1]) < 1e-5


@pytest.mark.parametrize(("ideality", "kelvin"), [(1.0, 4.5), (2.0, 9.0)])
def test_the_saturation_current_doubles_as_published(ideality, kelvin):
    """In 4.5 K for n = 1, and in 9 K for n = 2, as silicon's generation current does: "twice in 10 K" of textbooks."""
    diode = Diode(photocurrent=1e-5, coefficient=0.0, saturation=1e-9, ideality=ideality)
    assert diode.saturation_at(25.0) == pytest.approx(1e-9)
    warmer = 25.0 + kelvin
    assert diode.saturation_at(warmer) == pytest.approx(2e-9, rel=0.03)
    spice = (math.log(diode.saturation_at(warmer) / 1e-9)) * ideality  # XTI = 3 and EG, both over n
    ratio = (warmer + 273.15) / 298.15
    assert spice == pytest.approx(3.0 * math.log(ratio) + (ratio - 1.0) * 1.12 / (8.617333262e-5 * (warmer + 273.15)))


def test_silicon_loses_two_millivolts_per_kelvin():
    """At 0.6 V in constant light and without a load: -2 mV/K, as published of silicon cells and diodes."""
    diode = Diode(photocurrent=1e-3, coefficient=0.0, saturation=1e-3 / math.expm1(0.6 / 0.0256926), ideality=1.0)
    assert diode.voltage_of(1.0, 25.0, 1e12) == pytest.approx(0.6, abs=1e-5)
    assert diode.sensitivity(1.0, 25.0, 1e12) == pytest.approx(-2.0e-3, abs=5e-5)
