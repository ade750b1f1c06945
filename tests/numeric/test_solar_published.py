"""Current-voltage curves against published measurements, and against the standard's equations by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import lambertw

from hil.analysis import IvConditions, IvSweep, iv_curve
from hil.model.figure import Figure, FigureStatus

# The silicon cell of 57 mm of R.T.C. France at 33 degC and 1000 W/m^2: T. Easwarakhantham, J. Bottin, I. Bouhouch and
# C. Boutrit, Int. J. Solar Energy 4 (1986) 1-12. Below: the parameters of least squares that many have published
# since, with their rms of 9.8602e-4 A.
VOLTS = """
-0.2057 -0.1291 -0.0588 0.0057 0.0646 0.1185 0.1678 0.2132 0.2545 0.2924 0.3269 0.3585 0.3873
0.4137 0.4373 0.4590 0.4784 0.4960 0.5119 0.5265 0.5398 0.5521 0.5633 0.5736 0.5833 0.5900
"""
AMPERES = """
0.7640 0.7620 0.7605 0.7605 0.7600 0.7590 0.7570 0.7570 0.7555 0.7540 0.7505 0.7465 0.7385
0.7280 0.7065 0.6755 0.6320 0.5730 0.4990 0.4130 0.3165 0.2120 0.1035 -0.0100 -0.1230 -0.2100
"""
PHOTO, SATURATION, IDEALITY, OHMS, SHUNT = 0.76078, 3.2302e-7, 1.48118, 0.036377, 53.7185
THERMAL = IDEALITY * 8.617333e-5 * 306.15
FEW = tuple(np.array([float(each) for each in text.split()]) for text in (VOLTS, AMPERES))


def sweep(voltage, current, light=1000.0, warmth=33.0):
    """Return a sweep under constant conditions."""
    constant = {name: np.full(len(voltage), each) for name, each in (("irradiance", light), ("temperature", warmth))}
    return IvSweep(voltage=voltage, current=current, **constant)


def current_of(voltage):
    """Return the current of the published parameters in closed form."""
    total = PHOTO + SATURATION
    exponent = SHUNT * (OHMS * total + voltage) / (THERMAL * (OHMS + SHUNT))
    argument = OHMS * SATURATION * SHUNT / (THERMAL * (OHMS + SHUNT)) * np.exp(exponent)
    return (SHUNT * total - voltage) / (OHMS + SHUNT) - THERMAL / OHMS * lambertw(argument).real


def test_the_points_are_those_of_the_publication():
    """The published parameters leave the published rms."""
    volts, amperes = FEW
    diode = volts + amperes * OHMS
    left = PHOTO - SATURATION * np.expm1(diode / THERMAL) - diode / SHUNT - amperes
    assert math.sqrt(np.square(left).mean()) == pytest.approx(9.8602e-4, abs=5e-7)


def test_a_published_measurement():
    """26 points show what was published, within their uncertainty; a power they do not show, as six are at the knee."""
    found = iv_curve(sweep(*FEW))
    figures = found.figures
    for name, published in (
        ("short_circuit_current", 0.7603),
        ("open_circuit_voltage", 0.5728),
        ("series_resistance", 0.0364),
        ("shunt_conductance", 1.0 / 53.7),
    ):
        figure = figures[name]
        assert abs(figure.value - published) < 2.0 * figure.uncertainty, name
    assert figures["short_circuit_current"].uncertainty < 5e-4
    assert figures["open_circuit_voltage"].uncertainty < 1e-4
    assert figures["maximum_power"].status is FigureStatus.NOT_OBSERVABLE
    assert [gate.name for gate in found.gates if gate.ok is False] == ["knee"]


def test_the_published_parameters_give_the_published_figures():
    """With the points of the plan: 0.7603 A, 0.5728 V, 0.6894 A at 0.4506 V, and the resistances put in."""
    volts = 0.572785 * (1.0 - (1.0 - np.linspace(0.0, 1.0, 40)) ** 2)
    figures = iv_curve(sweep(volts, current_of(volts))).figures
    for name, published, digits in (
        ("short_circuit_current", 0.7603, 5e-5),
        ("open_circuit_voltage", 0.5728, 5e-5),
        ("voltage_at_maximum", 0.4506, 5e-5),
        ("current_at_maximum", 0.6894, 5e-5),
        ("maximum_power", 0.31065, 5e-6),
        ("series_resistance", OHMS, 5e-5),
        ("shunt_conductance", 1.0 / SHUNT, 2e-4),
    ):
        assert figures[name].value == pytest.approx(published, abs=digits), name


def test_procedure_two_is_that_of_the_standard():
    """IEC 60891:2021, by hand, at a point in the middle of a sweep; Voc2 is that of the corrected curve."""
    given = {"alpha": 6e-4, "beta": -3e-3, "resistance": 0.03, "kappa": 2e-4, "light": 0.05}
    conditions = IvConditions(
        irradiance=1100.0,
        temperature=25.0,
        **{name: Figure(value=value, unit="1", uncertainty=0.0) for name, value in given.items()},
    )
    volts = 0.572785 * (1.0 - (1.0 - np.linspace(0.0, 1.0, 40)) ** 2)
    amperes = current_of(volts)
    found = iv_curve(sweep(volts, amperes), conditions)
    at, kelvin, ratio = 30, 25.0 - 33.0, 1.1
    raised = amperes[at] * ratio / (1.0 + given["alpha"] * -kelvin)
    bent = 1.0 + given["light"] * math.log(ratio)
    opened = found.figures["open_circuit_voltage"].value
    moved = volts[at] - (given["resistance"] + given["kappa"] * -kelvin) * (raised - amperes[at])
    moved += -given["kappa"] * raised * kelvin + opened * (given["beta"] * bent * kelvin + 1.0 - 1.0 / bent)
    assert found.current[at] == pytest.approx(raised, abs=1e-8)
    assert found.voltage[at] == pytest.approx(moved, abs=1e-6)
