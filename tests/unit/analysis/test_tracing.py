"""Functions of the library hand on where their arguments come from."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import (
    charge,
    crossing,
    fade,
    magnitude,
    mean,
    observed,
    peak,
    resistance,
    share_known,
    standard_deviation,
    widened,
)
from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.interchange import as_json, from_json
from hil.analysis.gyroscope.readings import reading
from hil.analysis.gyroscope.self_check import reproduction
from hil.analysis.tracing import Samples, samples
from hil.model.errors import Misused
from hil.model.figure import Figure
from hil.model.provenance import BY_ITSELF, TIMES_ZERO, Number, Provenance, RecordedUnit, stamped
from hil.requirements.units import same

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


def written():
    """Return a copy of a recording whose first half a view of it filled with one number."""
    copied = X.copy()
    copied[:2][:] = 100.0
    return copied


def filled():
    """Return a copy of a recording that NumPy filled."""
    copied = X.copy()
    np.copyto(copied, np.full(4, 100.0))
    return copied


def put_out():
    """Return a copy of a recording that took the result of numbers of the plan."""
    copied = X.copy()
    np.add(np.full(4, 50.0), 50.0, out=copied)
    return copied


LONG = samples(np.linspace(1.0, 2.0, 100), FIELD)
WROTE = "the plan wrote values into the samples"
OWN_ARRAY = "the plan itself made an array that stands behind it"
SHAPE_ONLY = "only the shape of a recording is left: its samples were filled by the plan"


@pytest.mark.parametrize(
    ("made", "reason"),
    [
        (X * 0 + 100, TIMES_ZERO),
        (np.zeros(4) * X, TIMES_ZERO),
        (X**0 * 100, TIMES_ZERO),
        (X - X[:] + 100, BY_ITSELF),
        (X / X * 100, BY_ITSELF),
        (np.full_like(X, 100.0), SHAPE_ONLY),
        (np.ones_like(X) * 100, SHAPE_ONLY),
        (LONG + (100.0 - np.asarray(LONG)), OWN_ARRAY),
        (np.where(LONG > 0.0, np.full(100, 100.0), LONG), OWN_ARRAY),
        (np.concatenate([LONG[:1], np.full(99, 100.0)]), OWN_ARRAY),
        (mean([*np.full(100, 100.0), X[0]], "uT").provenance.numbers == (100.0,) and X * 0, TIMES_ZERO),
        (written(), WROTE),
        (filled(), WROTE),
        (put_out(), WROTE),
        (written().reshape(2, 2).mean(), WROTE),
    ],
)
def test_samples_that_the_plan_made_prove_nothing(made, reason):
    """Whatever way NumPy offers to leave nothing of a recording in an array but its origin."""
    assert reason in made.provenance.unproven


def test_honest_arithmetic_on_samples_proves():
    """Conversions, offsets of their own, grids, samples left out: numbers of the plan are told, and nothing else."""
    zeros = samples(np.zeros(4), FIELD)
    left_out = X.copy()
    left_out[left_out > 3.5] = np.nan
    grid = np.interp(np.arange(1.0, 2.0, 0.05), LONG, LONG)
    for made in (X - X.mean(), zeros * 3.0, X * LONG[:4], left_out, grid, X * np.array([1.0, 1.01, 0.99, 1.0])):
        assert made.provenance.unproven == ()
    assert (X * 1e3 + 2).provenance.numbers == (1000.0, 2.0)
    assert np.clip(X, 2, 3).provenance.numbers == (2.0, 3.0)
    assert np.diff(X, n=1).provenance.numbers == ()
    assert X.std(ddof=1).provenance.numbers == ()


def plate(unit="degC", values=(40.1, 41.0, 41.97, 41.2, 40.3)):
    """Return what an instrument recorded in this unit."""
    known = Provenance(instruments=("daq1",), sources=("recording warm",), recorded=RecordedUnit(unit, same))
    return samples(np.array(values), known)


TIME = samples(np.arange(5.0), Provenance(instruments=("daq1",), sources=("recording warm",)))
SETPOINT = stamped(40.0, Provenance(sources=("parameter setpoint",)))


@pytest.mark.parametrize(
    ("compute", "unit"),
    [
        (lambda x: peak(TIME, x - 40, "mK"), "mK"),
        (lambda x: peak(TIME, x - SETPOINT, "mK"), "mK"),
        (lambda x: peak(TIME, x, "K"), "K"),
        (lambda x: mean(np.sort(x[1:] - x.mean()), "mK"), "mK"),
        (lambda x: mean(list(x), unit="V"), "V"),
        (lambda x: standard_deviation(x, "mK"), "mK"),
        (lambda x: charge(TIME, x, "A"), "A"),
        (lambda x: observed(x.max(), "mK"), "mK"),
        (lambda x: fade([1, 2, 3, 4, 5], x, "Wh"), "Wh"),
        (lambda x: peak(TIME, x * 1e3, "mK", resolution=x[0] - x[1]), "mK"),
        (lambda x: Figure(value=x.mean(), unit="mK"), "mK"),
        (lambda x: Figure(value=np.median(x) - 40, unit="mK"), "mK"),
        (lambda x: Figure(value=x[0] * 1e3, unit="mK", uncertainty=x.std()), "mK"),
        (lambda x: crossing(TIME, x, plate("V")[2]), "degC"),
    ],
)
def test_what_was_recorded_in_one_unit_is_not_called_another(compute, unit):
    """While numbers were only added to it or subtracted from it, parts of it taken, and averages."""
    with pytest.raises(Misused, match=rf"^the values are in (degC|V) as recorded, not in {unit}; state "):
        compute(plate())


@pytest.mark.parametrize(
    "compute",
    [
        lambda x: peak(TIME, x, "degC"),
        lambda x: peak(TIME, x, "°C"),
        lambda x: peak(TIME, x - 40, "K"),
        lambda x: peak(TIME, x - SETPOINT, "delta_degC"),
        lambda x: peak(TIME, (x - 40) * 1e3, "mK"),
        lambda x: standard_deviation(x, "K"),
        lambda x: charge(TIME, x, "K"),
        lambda x: mean(np.column_stack([TIME, x])[:, 1], "V"),
        lambda x: mean(np.square(x), "K²"),
        lambda x: Figure(value=x.std(), unit="K"),
        lambda x: Figure(value=x.max() - x.min(), unit="K", uncertainty=x.std()),
        lambda x: Figure(value=x[0] / 2, unit="V"),
        lambda x: Figure(value=peak(TIME, x, "degC").value, unit="V"),
        lambda x: mean(x.copy().__imul__(1e3), "mK"),
        lambda x: mean(plate("uT", x), "µT"),
        lambda x: mean(plate("a unit of its own", x), "V"),
    ],
)
def test_the_unit_as_recorded_a_difference_in_kelvin_and_what_was_converted(compute):
    """All of it passes: the same unit spelled otherwise, differences, and products, which may be in any unit."""
    assert compute(plate()).value == pytest.approx(compute(plate()).value)
