"""What holds for any calibration over temperature."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.interchange import as_json, from_json, printed
from hil.analysis.gyroscope.readings import Reading
from hil.analysis.gyroscope.self_check import export_disagreements
from hil.model.figure import Figure

small = st.floats(-0.05, 0.05)
lines = st.tuples(st.floats(-5.0, 5.0), small)
scales = st.tuples(st.floats(0.8, 1.25), st.floats(-0.002, 0.002))
mixing = st.lists(small, min_size=6, max_size=6)


def mixed(cross):
    """A matrix with ones on its diagonal and small cross gains."""
    matrix = np.eye(3)
    matrix[~np.eye(3, dtype=bool)] = cross
    return matrix


def sensed(true, temperature, bias, scale, cross):
    """What a sensor with these parameters reads at a true rate; exact inverse of the model."""
    offset = temperature - 25.0
    factors = np.array([c0 + c1 * offset for c0, c1 in scale])
    biases = np.array([c0 + c1 * offset for c0, c1 in bias])
    return mixed(cross) @ true / factors + biases


def campaign(bias, scale, cross):
    """Rest and both rates about each axis at three temperatures."""
    readings = []
    for temperature in (0.0, 25.0, 45.0):
        for axis, sign in ((0, 0.0), *((axis, sign) for axis in range(3) for sign in (1.0, -1.0))):
            true = np.zeros(3)
            true[axis] = sign * 20.0
            values = sensed(true, temperature, bias, scale, cross).tolist()
            means = {
                name: Figure(value=value, unit="deg/s", uncertainty=0.01)
                for name, value in zip("xyz", values, strict=True)
            }
            readings.append(Reading(temperature=temperature, means=means, rates={"xyz"[axis]: sign * 20.0}))
    return readings


@given(st.tuples(lines, lines, lines), st.tuples(scales, scales, scales), mixing, st.floats(0.0, 45.0))
def test_a_calibration_undoes_the_sensor(bias, scale, cross, temperature):
    """Rates come back for every linear bias and scale and any small misalignment, at any temperature in the range."""
    report = calibrate(campaign(bias, scale, cross))
    true = np.array([3.0, -8.0, 15.0])
    measured = sensed(true, temperature, bias, scale, cross).tolist()
    found = report.calibration.correct(dict(zip("xyz", measured, strict=True)), temperature)
    assert [float(each) for each in found.values()] == pytest.approx(true.tolist(), abs=1e-6)


@given(st.tuples(lines, lines, lines), st.tuples(scales, scales, scales), mixing)
def test_an_export_reads_back_as_it_was_printed(bias, scale, cross):
    """JSON and back is the identity on printed numbers, and the self-check finds nothing."""
    report = calibrate(campaign(bias, scale, cross))
    again = from_json(as_json(report.calibration))
    assert again == printed(report.calibration)
    assert export_disagreements(again, report) == ()


@given(st.floats(0.0, 45.0), st.floats(0.001, 1.0), st.floats(1.01, 10.0))
def test_a_rate_is_known_no_better_than_its_reading(temperature, uncertainty, more):
    """The uncertainty of a corrected rate is at least that of the reading times the scale, and grows with it."""
    axis = calibrate(campaign([(0.1, 0.01)] * 3, [(1.05, 0.001)] * 3, [0.0] * 6)).calibration.axes["x"]
    scale = float(axis.scale.at(temperature))
    one = axis.figure(Figure(value=5.0, unit="deg/s", uncertainty=uncertainty), temperature)
    other = axis.figure(Figure(value=5.0, unit="deg/s", uncertainty=more * uncertainty), temperature)
    assert scale * uncertainty <= one.uncertainty < other.uncertainty
