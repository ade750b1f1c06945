"""Functions of the library hand on where their arguments come from."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import magnitude, mean, resistance, share_known, standard_deviation, widened
from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.interchange import as_json, from_json
from hil.analysis.gyroscope.readings import reading
from hil.analysis.gyroscope.self_check import reproduction
from hil.analysis.tracing import Samples, samples
from hil.model.figure import Figure
from hil.model.provenance import Number, Provenance

FIELD = Provenance(instruments=("mag1",), sources=("recording field, x",))
SUPPLY = Provenance(instruments=("psu1",), sources=("supply.load.current",))
X = samples(np.array([1.0, 2.0, 4.0, 3.0]), FIELD)


@pytest.mark.parametrize(
    "compute",
    [
        lambda x: x[1:],
        lambda x: x[x > 1.5],
        lambda x: 2 * x + 1,
        np.abs,
        lambda x: np.column_stack([x, np.zeros(4)]),
        lambda x: np.concatenate([np.zeros(2), x]),
        lambda x: x.reshape(2, 2).mean(axis=0),
        lambda x: x.copy(),
    ],
)
def test_arrays_keep_it(compute):
    """Parts and what NumPy computes of them, with the same numbers as plain arrays."""
    found, plain = compute(X), compute(np.asarray(X))
    assert isinstance(found, Samples)
    assert found.provenance.instruments == ("mag1",)
    assert type(plain) is np.ndarray
    assert np.array_equal(found, plain)


@pytest.mark.parametrize(
    "compute", [lambda x: x[2], np.max, np.std, lambda x: x.mean(), lambda x: x.std(ddof=1), np.sum]
)
def test_single_numbers_keep_it(compute):
    """One sample, and what an array is reduced to, are numbers of the same origin."""
    found = compute(X)
    assert type(found) is Number
    assert found.provenance.instruments == ("mag1",)
    assert found == compute(np.asarray(X))


def test_a_function_stamps_what_it_returns():
    """Of figures in lists and of arrays beside; without any provenance nothing is added."""
    assert mean(X, "uT").provenance.by == ("mean",)
    volts = [Figure(value=5.0, unit="V", uncertainty=0.01).with_provenance(FIELD)]
    amperes = [Figure(value=0.05, unit="A", uncertainty=1e-4).with_provenance(SUPPLY)]
    found = resistance(volts, amperes)
    assert found.provenance.instruments == ("mag1", "psu1")
    assert found.provenance.unproven == ()
    assert mean(np.asarray(X), "uT").provenance is None
    assert mean(np.asarray(X), "uT") == mean(X, "uT")


def test_a_number_that_the_plan_wrote_is_named():
    """A voltage made up beside a measured current does not give a measured resistance."""
    amperes = [Figure(value=0.05, unit="A", uncertainty=1e-4).with_provenance(SUPPLY)]
    found = resistance([Figure(value=5.0, unit="V", uncertainty=1e-4)], amperes)
    assert found.provenance.unproven == ("the plan itself wrote the figure 5 V, which stands behind it",)


def test_small_functions_for_plans():
    """What plans would else compute with bare numbers."""
    spread = standard_deviation(X, "uT")
    assert spread.value == pytest.approx(np.std([1, 2, 4, 3], ddof=1))
    assert (spread.uncertainty, spread.dof) == (pytest.approx(spread.value / np.sqrt(6)), 3)
    sides = [Figure(value=side, unit="uT", uncertainty=0.1).with_provenance(FIELD) for side in (3.0, 4.0)]
    assert magnitude(sides).value == pytest.approx(5.0)
    assert magnitude(sides).uncertainty == pytest.approx(0.1)
    assert magnitude([Figure(value=0.0, unit="uT")]).status == "not observable"
    wide = widened(sides[0], absolute=0.1, relative=0.1)
    assert wide.uncertainty == pytest.approx(np.sqrt(0.1**2 + 0.1**2 + 0.3**2))
    assert wide.provenance.unproven == ()
    assert widened(Figure(value=1.0, unit="V"), absolute=1.0).uncertainty is None
    assert share_known([Number(1.0, FIELD), float("nan")]).value == 0.5
    assert share_known([Number(1.0, FIELD), float("nan")]).provenance.instruments == ("mag1",)


def test_a_reading_of_a_gyroscope_and_its_reproduction_keep_it():
    """What is calibrated has sensor and table behind it, and so has the word that the export gives it back."""
    table = Provenance(instruments=("table1",), sources=("rotation_table.rate",))
    rates, means = {}, {}
    taken = []
    for temperature in (10.0, 25.0, 40.0):
        for rate in (0.0, 10.0, -10.0):
            means = {"x": Figure(value=0.1 + rate / 1.05, unit="deg/s", uncertainty=0.01).with_provenance(FIELD)}
            rates = {"x": Figure(value=rate, unit="deg/s", uncertainty=0.001).with_provenance(table)} if rate else None
            taken.append(reading(temperature, means, rates))
    assert taken[1].means["x"].provenance.instruments == ("mag1", "table1")
    report = calibrate(taken)
    found = reproduction(from_json(as_json(report.calibration)), report)
    assert found == "reproduced"
    assert found.provenance.instruments == ("mag1", "table1")
    assert {"reading", "reproduction"} <= set(found.provenance.by)
