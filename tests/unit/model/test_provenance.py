"""A value knows where it comes from, as long as nobody changed it by hand."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest

from hil.model.figure import Figure, FigureStatus, encoded
from hil.model.provenance import BY_ITSELF, TIMES_ZERO, Count, Number, Provenance, Word, merged, provenance_of, stamped

SUPPLY = Provenance(instruments=("psu1",), sources=("supply.load.voltage",))
METER = Provenance(instruments=("dmm1",), sources=("meter.current",))
VOLTAGE = Figure(value=5.0, unit="V", uncertainty=0.03).with_provenance(SUPPLY)
CURRENT = Figure(value=0.05, unit="A", uncertainty=0.0004).with_provenance(METER)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"uncertainty": 1e-9}, "its uncertainty was replaced by hand"),
        ({"value": 4.0}, "its value was replaced by hand"),
        ({"unit": "mV"}, "its unit was replaced by hand"),
        ({"dof": 3.0}, "its degrees of freedom were replaced by hand"),
        ({"status": FigureStatus.UPPER_LIMIT}, "its status was replaced by hand"),
    ],
)
def test_a_changed_copy_says_what_was_changed(changes, sentence):
    """`replace(reading, uncertainty=1e-9)` is no reading any more, nor is what is computed of it."""
    changed = replace(VOLTAGE, **changes)
    assert changed.provenance.unproven == (sentence,)
    assert sentence in (changed * 2).provenance.unproven
    assert sentence in replace(changed, value=5.0, unit="V", uncertainty=0.03).provenance.unproven
    assert replace(VOLTAGE).provenance.unproven == ()


def test_a_figure_built_by_hand_comes_from_nowhere():
    """Also of a reading's own number, and with a reading's provenance put into it."""
    assert Figure(value=VOLTAGE.value, unit="V", uncertainty=0.03).provenance is None
    forged = Figure(value=1.0, unit="V", uncertainty=0.03, provenance=SUPPLY)
    assert forged.provenance.unproven == ("its value was written by hand",)
    stolen = Figure(value=1.0, unit="V", uncertainty=0.03, provenance=VOLTAGE.provenance)
    assert stolen.provenance.unproven == ("its value was replaced by hand",)


def test_arithmetic_keeps_the_provenance_of_both():
    """A ratio of two readings comes from both, with its uncertainty to first order."""
    ratio = VOLTAGE / CURRENT
    assert (ratio.value, ratio.unit) == (pytest.approx(100.0), "V/A")
    assert ratio.uncertainty == pytest.approx(100 * math.hypot(0.03 / 5, 0.0004 / 0.05))
    assert ratio.provenance.instruments == ("dmm1", "psu1")
    assert ratio.provenance.unproven == ()


def test_what_the_plan_wrote_stands_behind_a_result():
    """A figure made up by the plan does not become measured by arithmetic with a reading."""
    made_up = VOLTAGE / Figure(value=0.05, unit="A", uncertainty=1e-4)
    assert made_up.provenance.unproven == ("the plan itself wrote the figure 0.05 A, which stands behind it",)


def test_errors_of_one_instrument_add_up_and_never_cancel():
    """Two readings of one instrument: a sum has the sum of the uncertainties, a difference as independent."""
    assert (VOLTAGE + VOLTAGE).uncertainty == pytest.approx(0.06)
    assert (VOLTAGE - VOLTAGE).uncertainty == pytest.approx(math.hypot(0.03, 0.03))
    other = Figure(value=5.0, unit="V", uncertainty=0.04).with_provenance(METER)
    assert (VOLTAGE + other).uncertainty == pytest.approx(0.05)
    with pytest.raises(ValueError, match="figures in 'V' and 'A' cannot be added"):
        VOLTAGE + CURRENT


@pytest.mark.parametrize(
    ("computed", "value", "unit", "uncertainty"),
    [
        (-VOLTAGE, -5.0, "V", 0.03),
        (2 * VOLTAGE, 10.0, "V", 0.06),
        (VOLTAGE / 2, 2.5, "V", 0.015),
        (abs(-VOLTAGE), 5.0, "V", 0.03),
        (1 / CURRENT, 20.0, "1/A", 0.16),
        (VOLTAGE * CURRENT, 0.25, "V.A", math.hypot(0.05 * 0.03, 5 * 0.0004)),
        (1 - VOLTAGE / VOLTAGE, 0.0, "1", math.hypot(0.006, 0.006)),
    ],
)
def test_operators_are_first_order(computed, value, unit, uncertainty):
    """Value, unit and uncertainty of every operator; plain numbers count as exact."""
    assert (computed.value, computed.unit) == (pytest.approx(value), unit)
    assert computed.uncertainty == pytest.approx(uncertainty)
    assert computed.provenance.measured


def test_unknown_stays_unknown():
    """An uncertainty that nobody knows is not known after arithmetic, and what is not observable is not, either."""
    assert (VOLTAGE + replace(VOLTAGE, uncertainty=None)).uncertainty is None
    poor = Figure(value=math.nan, unit="V", status=FigureStatus.NOT_OBSERVABLE)
    assert (VOLTAGE + poor).status is FigureStatus.NOT_OBSERVABLE
    bound = replace(CURRENT, status=FigureStatus.UPPER_LIMIT)
    assert (VOLTAGE / bound).status is FigureStatus.NOT_OBSERVABLE


def test_numbers_of_the_library_keep_it_and_make_figures():
    """Sums and quotients of traced numbers are traced; a figure of them needs an uncertainty that is traced, too."""
    number = Number(7200.0, SUPPLY)
    hours = sum([number, number]) / 3600
    assert hours == 4.0
    assert hours.provenance.by == ("arithmetic of the plan",)
    known = Figure(value=hours, unit="h", uncertainty=Number(0.1, METER))
    assert (known.provenance.instruments, known.provenance.unproven) == (("dmm1", "psu1"), ())
    assert (type(known.value), type(known.uncertainty)) == (float, float)
    guessed = Figure(value=hours, unit="h", uncertainty=0.1)
    assert guessed.provenance.unproven == ("its uncertainty was written by hand",)
    assert getattr(float(hours), "provenance", None) is None


def test_only_a_parameter_is_exact_because_the_plan_says_so():
    """It is what it is; of what was read an uncertainty of zero is as made up as any other."""
    given = Provenance(sources=("parameter white",))
    assert Figure(value=Number(1.5, given), unit="V", uncertainty=0.0).provenance.unproven == ()
    written = ("its uncertainty was written by hand",)
    assert Figure(value=Number(1.5, given), unit="V", uncertainty=0.1).provenance.unproven == written
    assert Figure(value=Number(1.5, SUPPLY), unit="V", uncertainty=0.0).provenance.unproven == written


@pytest.mark.parametrize("value", [Number(1.5, SUPPLY), Count(3, SUPPLY), Word("ended", SUPPLY)])
def test_traced_values_are_plain_in_json_and_copies_keep_them(value):
    """The journal holds what it always held."""
    assert type(encoded([value])[0]) in {float, int, str}
    for copied in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):  # noqa: S301 - our own
        assert copied == value
        assert copied.provenance == SUPPLY


@dataclass(frozen=True, slots=True)
class _Result:
    figure: Figure
    numbers: tuple[float, ...]
    name: str


def test_it_is_found_and_given_however_deep():
    """Lists, mappings and dataclasses are looked into; the original of what is stamped stays as it was."""
    result = _Result(VOLTAGE, (1.0, math.nan), "x")
    made = stamped({"found": [result]}, METER)
    assert provenance_of(made) == METER
    assert provenance_of({"a": [(made,)]}, CURRENT, 5.0, "x") == METER
    assert provenance_of([result]).instruments == ("psu1",)
    assert provenance_of([1.0, {"a": None}]) is None
    assert merged(None, SUPPLY, SUPPLY) is SUPPLY


def test_parameters_measure_nothing():
    """Only an instrument or a person finds something out."""
    assert not Provenance(sources=("parameter side_a",)).measured
    assert Provenance(sources=("answer to voltmeter",)).measured
    assert SUPPLY.measured


def test_what_goes_behind_a_figures_back_is_told():
    """A value that was set past the frozen object stays told, also through arithmetic and the library."""
    swapped = Figure(value=120.0, unit="ohm", uncertainty=0.1).with_provenance(SUPPLY)
    object.__setattr__(swapped, "value", 100.0)
    reason = "its value was replaced by hand"
    assert swapped.replaced == (reason,)
    assert reason in (swapped * 1.0).provenance.unproven
    assert reason in provenance_of([swapped]).unproven
    assert VOLTAGE.replaced == ()


@pytest.mark.parametrize("vanished", [VOLTAGE * 0, 0.0 * VOLTAGE, Number(5.0, SUPPLY) * 0, Number(5.0, SUPPLY) ** 0])
def test_nothing_of_a_reading_is_left_times_zero(vanished):
    """A reading that is multiplied by zero stands behind nothing, whatever is added then."""
    assert vanished.provenance.unproven == (TIMES_ZERO,)
    if type(vanished) is Number:
        assert (vanished + 100).provenance.unproven == (TIMES_ZERO,)


def test_numbers_of_the_plan_are_told_where_they_took_part():
    """A factor that turns any reading into the value that was wanted stands in the check."""
    scaled = VOLTAGE * (6 / VOLTAGE.value)
    assert scaled.provenance.told[-1] == "numbers of the plan: 1.2"
    assert (VOLTAGE / CURRENT).provenance.told == ("supply.load.voltage", "meter.current", "arithmetic of figures")
    assert (Number(5.0, SUPPLY) + 95).provenance.told[-1] == "numbers of the plan: 95"
    many = VOLTAGE
    for factor in range(2, 30):
        many = many * factor
    assert many.provenance.told[-1] == "numbers of the plan: 2, 3, 4, 5, 6, 7, 8, 9 and more"


def test_a_number_divided_by_itself_has_nothing_left():
    """Of a reading's own ratio and difference nothing depends on what was read; of two readings it does."""
    number = Number(5.0, SUPPLY)
    for vanished in (VOLTAGE / VOLTAGE, VOLTAGE - VOLTAGE, number / number, number - number):
        assert vanished.provenance.unproven == (BY_ITSELF,)
    assert (VOLTAGE / replace(VOLTAGE)).provenance.unproven == ()
    assert (number - Number(5.0, SUPPLY)).provenance.unproven == ()


def test_numpys_numbers_of_the_plan_are_told():
    """A factor of NumPy is a number like another, and so many that nobody reads them are a reason."""
    assert (Number(5.0, SUPPLY) * np.float64(1.25)).provenance.numbers == (1.25,)
    assert (VOLTAGE * np.float64(1.25)).provenance.numbers == (1.25,)
    many = Number(5.0, SUPPLY)
    for factor in range(2, 80):
        many = many + factor
    assert len(many.provenance.numbers) == 64
    (sentence,) = many.provenance.unproven
    assert sentence.startswith("it was computed with more than 64 different numbers of the plan")


def test_a_difference_of_temperatures_is_in_kelvin():
    """With the uncertainties of both readings, which no certificate in K has to cover."""
    warm, cold = (Figure(value=value, unit="degC", uncertainty=0.3).with_provenance(METER) for value in (41.97, 40.0))
    found = warm - cold
    assert (found.value, found.unit) == (pytest.approx(1.97), "K")
    assert found.uncertainty == pytest.approx(math.hypot(0.3, 0.3))
    assert found.provenance.unproven == found.provenance.uncovered == ()


@pytest.mark.parametrize("unit", ["K", "delta_degC"])
def test_a_temperature_is_changed_by_a_difference(unit):
    """A setpoint above a reading is a temperature, in whatever order it is written; a difference less one is none."""
    start = Figure(value=20.0, unit="degC", uncertainty=0.3).with_provenance(METER)
    rise = Figure(value=15.0, unit=unit, uncertainty=0.4)
    assert [(made.value, made.unit) for made in (start + rise, rise + start, start - rise)] == [
        (35.0, "degC"), (35.0, "degC"), (5.0, "degC"),
    ]  # fmt: skip
    assert (start + rise).uncertainty == pytest.approx(0.5)
    assert (start + rise).provenance.instruments == start.provenance.instruments
    for wrong in (lambda: rise - start, lambda: start + VOLTAGE):
        with pytest.raises(ValueError, match="cannot be added"):
            wrong()
