"""The closed form of a coil's field, its resistance and its linearity."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from hil.analysis.coil import copper_at, expected_field, field_ratio, linearity, on_axis_rectangle, resistance
from hil.model.figure import Figure, FigureStatus

MU_0 = 4e-7 * math.pi  # the value before 2019; agrees with today's to 5e-10


def figure(value, unit, uncertainty=0.0, dof=math.inf):
    """Return a measured figure."""
    return Figure(value=value, unit=unit, uncertainty=uncertainty, dof=dof)


def sum_of_current_elements(side_a, side_b, distance, current, pieces=4000):
    """Return the axial field in T of one turn, added up over short straight pieces by Biot and Savart's law."""
    corners = np.array([[1, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]]) / 2 * [side_a, side_b]
    field = np.zeros(3)
    for start, end in itertools.pairwise(corners):
        step = np.append(end - start, 0.0) / pieces
        middles = np.append(start, 0.0) + step * (np.arange(pieces)[:, None] + 0.5)
        reach = np.array([0.0, 0.0, distance]) - middles
        field += (np.cross(step, reach) / np.linalg.norm(reach, axis=1)[:, None] ** 3).sum(axis=0)
    assert abs(field[:2]).max() < 1e-9 * abs(field[2])
    return MU_0 * current / (4 * math.pi) * field[2]


@pytest.mark.parametrize(("side_a", "side_b"), [(0.04, 0.04), (0.09, 0.03), (0.02, 0.2)])
@pytest.mark.parametrize("distance", [0.0, 0.01, -0.05, 0.3])
def test_closed_form_agrees_with_a_sum_of_current_elements(side_a, side_b, distance):
    """The formula gives what many short pieces of wire add up to, on either side of the coil."""
    summed = 25 * sum_of_current_elements(side_a, side_b, distance, 0.016)
    assert on_axis_rectangle(25, side_a, side_b, distance, 0.016) == pytest.approx(summed, rel=1e-6)


def test_square_in_its_own_plane():
    """In the centre of a square the field is 2 sqrt(2) mu0 I / (pi a)."""
    assert on_axis_rectangle(1, 0.05, 0.05, 0.0, 2.0) == pytest.approx(2 * math.sqrt(2) * MU_0 * 2.0 / (math.pi * 0.05))


def test_far_away_it_is_a_dipole():
    """Far away the field is mu0 N I a b / (2 pi z^3)."""
    assert on_axis_rectangle(10, 0.02, 0.03, 10.0, 1.0) == pytest.approx(
        MU_0 * 10 * 0.02 * 0.03 / (2 * math.pi * 10.0**3), rel=1e-4
    )


@pytest.mark.parametrize("side", [0.0, -0.01, math.nan])
def test_coil_without_a_size_is_refused(side):
    """A side that is not above zero is a mistake of the caller, said in a sentence."""
    with pytest.raises(ValueError, match="sides of a coil"):
        on_axis_rectangle(10, side, 0.03, 0.01, 1.0)


def test_geometry_uncertainty_agrees_with_simulation():
    """First-order propagation gives the scatter of fields of coils drawn at random."""
    arguments = [(0.04, 0.0004), (0.03, 0.0003), (0.012, 0.0005), (0.016, 0.0001)]
    generator = np.random.default_rng(51)
    draws = generator.normal(*np.array(arguments).T, (4000, 4))
    fields = [1e6 * on_axis_rectangle(60, *draw) for draw in draws]
    expected = expected_field(60, *(figure(*triple) for triple in _united(arguments)))
    assert expected.unit == "uT"
    assert expected.value == pytest.approx(1e6 * on_axis_rectangle(60, 0.04, 0.03, 0.012, 0.016))
    assert expected.uncertainty == pytest.approx(np.std(fields, ddof=1), rel=0.05)


def _united(arguments):
    return [(value, unit, spread) for (value, spread), unit in zip(arguments, "mmmA", strict=True)]


def test_expected_field_refuses_other_units():
    """Millimetres are refused, not taken for metres."""
    with pytest.raises(ValueError, match="expected figures in 'm', got one in 'mm'"):
        expected_field(10, figure(40, "mm"), figure(0.04, "m"), figure(0.01, "m"), figure(0.1, "A"))


def test_expected_field_of_an_unknown_side_is_of_unknown_uncertainty():
    """One geometry figure without uncertainty leaves the expectation without one."""
    side = Figure(value=0.04, unit="m")
    assert expected_field(10, side, side, figure(0.01, "m"), figure(0.1, "A")).uncertainty is None


def test_ratio_carries_both_uncertainties_and_the_gain():
    """Measured, expected and gain each add their relative part."""
    ratio = field_ratio(figure(9.0, "uT", 0.09), figure(10.0, "uT", 0.2), gain=0.02)
    assert ratio.value == pytest.approx(0.9)
    assert ratio.unit == "1"
    assert ratio.uncertainty == pytest.approx(0.9 * math.sqrt(0.01**2 + 0.02**2 + 0.02**2))


def test_ratio_of_a_coil_wound_the_other_way_is_negative():
    """The ratio keeps the sign, so a limit around 1 refuses the wrong polarity."""
    assert field_ratio(figure(-9.0, "uT", 0.1), figure(10.0, "uT", 0.1)).value == pytest.approx(-0.9)


@pytest.mark.parametrize(
    ("measured", "expected"),
    [
        (figure(1.0, "uT"), figure(0.0, "uT")),
        (figure(math.nan, "uT"), figure(1.0, "uT")),
        (Figure(value=1.0, unit="uT", status=FigureStatus.NOT_OBSERVABLE), figure(1.0, "uT")),
    ],
)
def test_ratio_of_nothing_is_not_observable(measured, expected):
    """Zero expectation, NaN, or a field that was not observable have no ratio."""
    assert field_ratio(measured, expected).status is FigureStatus.NOT_OBSERVABLE


def test_resistance_is_the_slope_and_ignores_zero_current():
    """A reading without current neither divides by zero nor moves the result."""
    volts = [figure(value, "V", 0.001) for value in (1.6, 0.0, -1.6)]
    amperes = [figure(value, "A", 0.0001) for value in (0.016, 0.0, -0.016)]
    assert resistance(volts, amperes).value == pytest.approx(100.0)
    assert resistance(volts[:1], amperes[:1]).value == pytest.approx(100.0)


def test_opposite_currents_cancel_a_constant_voltage():
    """An offset of the voltmeter drops out between the two signs of the current, and shows as scatter."""
    volts = [figure(value + 0.05, "V", 0.0) for value in (1.6, -1.6)]
    found = resistance(volts, [figure(0.016, "A"), figure(-0.016, "A")])
    assert found.value == pytest.approx(100.0)
    assert found.uncertainty > 1.0


def test_resistance_of_one_reading_propagates_both_uncertainties():
    """Relative uncertainties of voltage and current add in quadrature."""
    found = resistance([figure(1.6, "V", 0.016)], [figure(0.016, "A", 0.00032)])
    assert found.uncertainty == pytest.approx(100 * math.hypot(0.01, 0.02))


def test_repeating_a_reading_does_not_improve_the_instrument():
    """The error of an instrument is common to its readings, so a hundred of them are as good as one."""
    one = resistance([figure(1.6, "V", 0.016)], [figure(0.016, "A", 0.0002)])
    many = resistance([figure(1.6, "V", 0.016)] * 100, [figure(0.016, "A", 0.0002)] * 100)
    assert many.uncertainty == pytest.approx(one.uncertainty)


@pytest.mark.parametrize(
    ("volts", "amperes"), [([], []), ([1.0], [0.0]), ([math.nan], [1.0]), ([0.0, 0.0], [0.0, 0.0])]
)
def test_resistance_without_current_is_not_observable(volts, amperes):
    """Nothing, zero current or NaN give no resistance."""
    found = resistance([figure(value, "V") for value in volts], [figure(value, "A") for value in amperes])
    assert found.status is FigureStatus.NOT_OBSERVABLE
    assert math.isnan(found.value)


def test_resistance_of_unknown_uncertainty_says_so():
    """A reading of unknown uncertainty gives a resistance of unknown uncertainty."""
    found = resistance([Figure(value=1.6, unit="V")], [figure(0.016, "A", 0.0001)])
    assert found.value == pytest.approx(100.0)
    assert found.uncertainty is None


def test_unpaired_readings_are_told_in_a_sentence():
    """Lists of different length are a mistake of the caller."""
    with pytest.raises(ValueError, match="2 voltages need as many currents, got 1"):
        resistance([figure(1.0, "V")] * 2, [figure(1.0, "A")])
    with pytest.raises(ValueError, match="1 currents need as many fields, got 0"):
        linearity([figure(1.0, "A")], [])


def test_copper_is_brought_to_twenty_degrees():
    """A coil of 100 ohm at 20 degC has 119.65 ohm at 70 degC, and its temperature's uncertainty counts."""
    cold = copper_at(figure(119.65, "ohm", 0.1), figure(70.0, "degC", 0.5))
    assert cold.value == pytest.approx(100.0)
    assert cold.uncertainty == pytest.approx(math.hypot(0.1, 100 * 0.00393 * 0.5) / 1.1965)


def test_copper_at_an_unknown_temperature_is_not_observable():
    """A temperature that is NaN gives no resistance."""
    assert copper_at(figure(100.0, "ohm"), figure(math.nan, "degC")).status is FigureStatus.NOT_OBSERVABLE
    assert copper_at(figure(100.0, "ohm"), figure(20 - 1 / 0.00393, "degC")).status is FigureStatus.NOT_OBSERVABLE


def test_straight_line_is_linear_whatever_its_offset():
    """An offset is no departure from a straight line."""
    currents = [figure(value, "A") for value in (-0.016, 0.0, 0.008, 0.016)]
    fields = [figure(2.0 + 500 * current.value, "uT", 0.01) for current in currents]
    assert linearity(currents, fields).value == pytest.approx(0.0, abs=1e-12)


def test_departure_is_relative_to_full_scale():
    """Three equally weighted points, the middle one 0.3 off: the line takes a third, the middle keeps 0.2."""
    currents = [figure(value, "A") for value in (-1.0, 0.0, 1.0)]
    found = linearity(currents, [figure(value, "uT", 0.06) for value in (-10.0, 0.3, 10.0)])
    assert found.value == pytest.approx(0.02)
    assert found.unit == "1"
    assert found.uncertainty == pytest.approx(0.06 * math.sqrt(2 / 3) / 10, rel=0.01)


def test_uncertainty_of_the_full_scale_counts():
    """Where the departure is large, so is the part of the uncertainty that comes from the full scale."""
    currents = [figure(value, "A") for value in (0.0, 1.0, 2.0)]
    found = linearity(currents, [figure(value, "uT", 0.1) for value in (0.0, 10.0, 0.0)])
    assert found.value == pytest.approx(2 / 3)
    assert found.uncertainty == pytest.approx(0.01 * math.sqrt(2 / 3 + (2 / 3) ** 2))


def test_poor_points_weigh_less():
    """A point that is known badly bends the line little."""
    currents = [figure(value, "A") for value in (0.0, 1.0, 2.0, 3.0)]
    fields = [figure(0.0, "uT", 0.01), figure(1.0, "uT", 0.01), figure(2.0, "uT", 0.01), figure(4.0, "uT", 10.0)]
    assert linearity(currents, fields).value == pytest.approx(1.0 / 4.0, rel=1e-3)


def test_uncertainty_of_the_current_counts():
    """What is not known of the current is carried to the field by the slope."""
    fields = [figure(value, "uT", 0.06) for value in (-10.0, 0.3, 10.0)]
    sure = linearity([figure(value, "A") for value in (-1.0, 0.0, 1.0)], fields)
    unsure = linearity([figure(value, "A", 0.01) for value in (-1.0, 0.0, 1.0)], fields)
    assert unsure.uncertainty > 1.5 * sure.uncertainty


@pytest.mark.parametrize(
    ("amperes", "fields"),
    [((0.0, 1.0), (0.0, 1.0)), ((1.0, 1.0, 2.0), (1.0, 1.0, 2.0)), ((0.0, 1.0, 2.0), (0.0,) * 3), ((), ())],
)
def test_linearity_needs_three_currents_and_a_field(amperes, fields):
    """Two different currents, or no field at all, show no linearity."""
    found = linearity([figure(value, "A") for value in amperes], [figure(value, "uT", 0.1) for value in fields])
    assert found.status is FigureStatus.NOT_OBSERVABLE


@pytest.mark.parametrize(
    ("uncertainty", "status"), [(0.0004, FigureStatus.MEASURED), (0.0009, FigureStatus.NOT_OBSERVABLE)]
)
def test_currents_that_differ_by_noise_carry_no_line(uncertainty, status):
    """Three currents 4 mA apart, known to 0.4 mA or 0.9 mA; five standard uncertainties are asked."""
    currents = [figure(value, "A", uncertainty) for value in (0.008, 0.010, 0.012)]
    assert linearity(currents, [figure(value, "uT", 0.1) for value in (2.7, 4.1, 5.5)]).status is status


def test_linearity_of_unknown_uncertainty_says_so():
    """A field of unknown uncertainty leaves the departure without one."""
    currents = [figure(value, "A") for value in (0.0, 1.0, 2.0)]
    assert linearity(currents, [Figure(value=value, unit="uT") for value in (0.0, 1.0, 2.0)]).uncertainty is None
