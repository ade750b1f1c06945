"""What a calibration refuses, exports, and says of what it does not know."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from hil.analysis.allan.averaging import MovingAverage, best_average, rest_mean
from hil.analysis.allan.deviation import deviation
from hil.analysis.allan.noise import characterise
from hil.analysis.gyroscope.calibrate import calibrate
from hil.analysis.gyroscope.calibration import ALIGNED, CalibratedRate, Polynomial
from hil.analysis.gyroscope.fitting import fit
from hil.analysis.gyroscope.interchange import (
    as_c_header,
    as_document,
    as_json,
    fingerprint,
    from_document,
    from_json,
    printed,
)
from hil.analysis.gyroscope.readings import Reading, Response, Slow, implausible, responses
from hil.analysis.gyroscope.self_check import export_disagreements
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

TEMPERATURES = (-16.0, 10.0, 25.0, 40.0)


def figure(value, uncertainty=0.01):
    """A mean in deg/s."""
    return Figure(value=value, unit="deg/s", uncertainty=uncertainty)


def readings(axes="xyz", temperatures=TEMPERATURES, rate=10.0, turning="xyz"):
    """Exact readings: bias 0.1 + 0.01 (T - 25), gain 1 / (1.05 + 0.001 (T - 25)), for every axis."""
    result = []
    for temperature in temperatures:
        offset = temperature - 25.0
        for axis, sign in (("", 0.0), *((axis, sign) for axis in turning for sign in (1.0, -1.0))):
            means = {
                each: figure(0.1 + 0.01 * offset + (sign * rate / (1.05 + 0.001 * offset) if each == axis else 0.0))
                for each in axes
            }
            result.append(Reading(temperature=temperature, means=means, rates={axis: sign * rate} if axis else {}))
    return result


def test_exact_readings_give_the_exact_calibration():
    """Bias and scale at the reference, their slopes, no misalignment, and rates that come back."""
    report = calibrate(readings())
    for axis in report.calibration.axes.values():
        assert axis.bias.coefficients == pytest.approx((0.1, 0.01), abs=1e-12)
        assert axis.scale.coefficients == pytest.approx((1.05, 0.001), abs=1e-12)
    measured = {axis: np.array([0.1 + 10.0 / 1.05]) for axis in "xyz"}
    assert report.calibration.correct(measured, 25.0)["y"] == pytest.approx([10.0])
    assert report.remarks == ()
    assert (report.calibration.low, report.calibration.high) == (-16.0, 40.0)


@pytest.mark.parametrize("temperature", [-16.1, 40.1, math.nan])
def test_nothing_is_extrapolated(temperature):
    """Outside the measured temperatures a calibration is refused, also for one sample of many."""
    axis = calibrate(readings()).calibration.axes["x"]
    with pytest.raises(Refused, match="outside the calibration, which holds from -16 to 40"):
        axis.correct([1.0, 1.0], [20.0, temperature])
    with pytest.raises(Refused, match="outside the calibration"):
        axis.figure(figure(1.0), temperature)


def test_the_range_is_that_of_the_readings_and_a_margin_that_was_asked_for():
    """Pairs measured a little apart span their own temperatures; a margin widens the range, once."""
    shifted = [
        replace(each, temperature=each.temperature + 0.3) if max(each.rates.values(), default=0.0) > 0.0 else each
        for each in readings()
    ]
    assert calibrate(shifted).calibration.axes["x"].scale.high == pytest.approx(40.3)
    wide = calibrate(shifted, margin=2.0).calibration
    assert (wide.low, wide.high) == (-18.0, 42.0)


def test_the_uncertainty_of_a_rate_has_four_parts():
    """Reading, bias, scale and temperature, each with its sensitivity."""
    axis = CalibratedRate(
        bias=Polynomial(
            coefficients=(0.5, 0.1), unit="deg/s", reference=25.0, low=0.0, high=50.0,
            covariance=((0.0004, 0.0), (0.0, 0.0)), dof=5.0,
        ),
        scale=Polynomial(
            coefficients=(2.0, 0.01), unit="1", reference=25.0, low=0.0, high=50.0,
            covariance=((0.0009, 0.0), (0.0, 0.0)), dof=7.0,
        ),
    )  # fmt: skip
    rate = axis.figure(figure(1.5, 0.01), 25.0, 0.5)
    assert rate.value == pytest.approx(2.0)
    parts = (2.0 * 0.01, 2.0 * 0.02, 1.0 * 0.03, (0.01 * 1.0 - 2.0 * 0.1) * 0.5)
    assert rate.uncertainty == pytest.approx(math.sqrt(sum(part**2 for part in parts)))
    assert 5.0 < rate.dof < math.inf
    assert axis.figure(Figure(value=1.5, unit="deg/s"), 25.0).uncertainty is None


def test_scale_that_was_not_measured_has_no_uncertainty():
    """Rest alone calibrates the bias; rates are corrected, and no guarded check can pass on them."""
    report = calibrate(readings(turning=""))
    assert report.calibration.axes["x"].figure(figure(1.1), 25.0).uncertainty is None
    assert "scale of axis x, y, z: not measured" in report.remarks[0]
    assert "alignment: not measured" in report.remarks[1]


def test_the_uncertainty_of_the_tables_rates_is_shared_by_all():
    """A relative uncertainty of 1 % of the rates adds 1 % to the scale everywhere."""
    alone = calibrate(readings()).calibration.axes["x"].scale.figure(0.0)
    shared = calibrate(readings(), rate_uncertainty=0.01).calibration.axes["x"].scale.figure(0.0)
    assert shared.uncertainty == pytest.approx(math.hypot(alone.uncertainty, 0.01 * shared.value))


def test_two_axes_are_calibrated_without_alignment():
    """Alignment needs three axes; two keep theirs."""
    calibration = calibrate(readings(axes="xy", turning="xy")).calibration
    assert calibration.alignment == ((1.0, 0.0), (0.0, 1.0))
    assert calibration.correct({"x": 0.1, "y": 0.1}, 25.0)["x"] == pytest.approx(0.0, abs=1e-12)


def one_way(warmer=0.0):
    """Readings about y in one direction only, by so many kelvin above those at rest."""
    turned = (each for each in readings(turning="y") if each.rates.get("y", 0.0) > 0.0)
    return [replace(each, temperature=each.temperature + warmer) for each in turned]


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ([], "there is no reading"),
        (readings(temperatures=(25.0,)), "bias of axis x: 1 temperature does not tell a dependence"),
        (readings(turning="")[:2] + readings(turning="x", temperatures=(25.0,)), "scale of axis x: 1 temperature"),
        ([*readings(turning=""), *one_way(5.0)], "axis y turned in one direction only near"),
        ([*readings(), *readings(axes="xy", turning="")], "do not have the same axes"),
        ([*readings(), replace(readings()[0], rates={"w": 1.0})], "the table turns about w"),
        ([*readings(), replace(readings()[0], rates={"x": 1.0, "y": 1.0})], "turns about x and y"),
        ([*readings(), replace(readings()[0], means=dict.fromkeys("xyz", figure(math.nan)))], "not a finite number"),
    ],
)
def test_readings_that_cannot_calibrate_are_refused(given, why):
    """The message names axis and temperature, and says what to measure."""
    with pytest.raises(Refused, match=why):
        calibrate(given)


def test_readings_at_nearly_one_temperature_belong_together():
    """Rates measured at 24.6 and 25.3 degC are one response at their mean."""
    pair = [
        Reading(temperature=24.6, means={"x": figure(10.5)}, rates={"x": 10.0}),
        Reading(temperature=25.3, means={"x": figure(-9.5)}, rates={"x": -10.0}),
    ]
    (response,) = responses(pair)
    assert response.temperature == pytest.approx(24.95)
    assert response.gains["x"].value == pytest.approx(1.0)
    assert response.gains["x"].uncertainty == pytest.approx(0.01 * math.sqrt(2.0) / 20.0)


def test_the_degree_is_chosen_by_evidence():
    """Strong curvature takes the second degree, also where four temperatures leave AICc nothing to say."""
    curve = [figure(0.002 * (where - 25.0) ** 2) for where in TEMPERATURES]
    found = fit(TEMPERATURES, curve)
    assert len(found.polynomial.coefficients) == 3
    assert [candidate.degree for candidate in found.candidates] == [1, 2]
    assert math.isinf(found.candidates[1].aicc)


def test_points_that_scatter_too_much_widen_the_uncertainty():
    """Residuals of ten uncertainties scale the covariance up, and the remark says so."""
    values = [figure(value) for value in (0.1, -0.1, 0.1, -0.1, 0.1, -0.1)]
    found = fit((-20.0, -10.0, 0.0, 10.0, 20.0, 30.0), values)
    assert not found.consistent
    assert "scatter more than their uncertainties say" in found.remark
    assert found.polynomial.figure(0.0).uncertainty > 0.03


def test_json_brings_back_the_same_calibration():
    """Export and import: the printed numbers, the range, covariance and fingerprint."""
    calibration = printed(calibrate(readings()).calibration)
    again = from_json(as_json(calibration))
    assert again == calibration
    assert fingerprint(again) == fingerprint(calibration)
    assert len(fingerprint(again)) == 64


def test_a_changed_export_is_refused():
    """One digit changed by hand, and the fingerprint tells."""
    text = as_json(calibrate(readings()).calibration)
    with pytest.raises(Refused, match="changed after it was exported"):
        from_json(text.replace("1.05", "1.06", 1))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"schema": "hil/gyroscope-calibration/2"}', '{"a": NaN}'])
def test_what_is_no_calibration_is_refused(text):
    """Other JSON, other formats, and no JSON at all."""
    with pytest.raises(Refused, match="this is no calibration"):
        from_json(text)


def test_an_incomplete_document_is_refused():
    """A document with a true fingerprint and a missing part is still no calibration."""
    from hil.documents.canonical import digest  # noqa: PLC0415 - only here

    document = as_document(calibrate(readings()).calibration)
    del document["axes"], document["fingerprint"]
    document["fingerprint"] = digest(document)
    with pytest.raises(Refused, match="incomplete"):
        from_document(document)


def test_the_c_header_holds_the_numbers_of_the_json():
    """Units, range, fingerprint and coefficients, padded with zeros."""
    report = calibrate(readings())
    header, document = as_c_header(report.calibration), json.loads(as_json(report.calibration))
    assert f'#define GYROSCOPE_FINGERPRINT "{document["fingerprint"]}"' in header
    assert '#define GYROSCOPE_UNIT "deg/s"' in header
    assert "#define GYROSCOPE_LOW_DEGC -16.0" in header
    rows = re.findall(r"^    \{(.+)\}, /\* (\w+) \*/$", header, re.MULTILINE)
    numbers = [[float(each) for each in row.split(", ")] for row, _ in rows]
    assert [name for _, name in rows] == list("xyz") * 3
    assert numbers[:3] == [document["axes"][name]["bias"]["coefficients"] for name in "xyz"]
    assert numbers[3:6] == [document["axes"][name]["scale"]["coefficients"] for name in "xyz"]
    assert numbers[6:] == document["alignment"]


def test_a_name_that_would_end_a_comment_is_refused_in_c():
    """Axis names come from files."""
    calibration = replace(calibrate(readings()).calibration, unit="deg/s */")
    with pytest.raises(Refused, match="is not allowed in a C header"):
        as_c_header(calibration)


def test_an_export_is_checked_against_its_own_table():
    """The printed numbers give the table back; a turned sign in them is found, and the axis named."""
    report = calibrate(readings())
    exported = from_json(as_json(report.calibration))
    assert export_disagreements(exported, report) == ()
    x = exported.axes["x"]
    wrong = replace(x, scale=replace(x.scale, coefficients=(x.scale.coefficients[0], -x.scale.coefficients[1])))
    (rejected,) = export_disagreements(replace(exported, axes={**exported.axes, "x": wrong}), report)
    assert rejected.axis == "scale of axis x"


@pytest.mark.parametrize("samples", [[], [1.0] * 100, [1.0, 2.0, 3.0]])
def test_a_record_that_shows_no_noise_has_no_mean_with_uncertainty(samples):
    """Nothing, stuck, or too short."""
    assert rest_mean(samples, 1.0, "deg/s").status is FigureStatus.NOT_OBSERVABLE


def test_missing_samples_do_not_move_the_mean():
    """NaN is left out of the mean, and the uncertainty stays about the same."""
    data = np.random.default_rng(1).standard_normal(4000)
    whole = rest_mean(data, 10.0, "deg/s")
    data[::500] = math.nan
    holed = rest_mean(data, 10.0, "deg/s", systematic=0.1)
    assert holed.value == pytest.approx(whole.value, abs=0.01)
    assert holed.uncertainty == pytest.approx(math.hypot(whole.uncertainty, 0.1), rel=0.05)


def test_the_best_average_is_at_the_minimum_of_the_deviation():
    """White noise over a random walk: the queue holds the samples of the best averaging time."""
    generator = np.random.default_rng(4)
    data = generator.standard_normal(50_000) + np.cumsum(0.03 * generator.standard_normal(50_000))
    model = characterise(data, 10.0, "deg/s")
    average = best_average(model)
    assert average.samples == round(model.averaging_window.value * 10.0)
    assert average.noise(model.curve) == pytest.approx(model.curve.deviation.min())
    assert average.noise(model.curve) < 0.3


def test_queues_that_cannot_be_are_refused():
    """No sample, no minimum, and no curve that long."""
    with pytest.raises(Refused, match="a queue of 0 samples"):
        MovingAverage(samples=0, rate=10.0)
    with pytest.raises(Refused, match="no averaging time is known to be best"):
        best_average(characterise(np.zeros(100), 10.0, "deg/s"))
    curve = deviation(np.random.default_rng(5).standard_normal(100), 1.0)
    with pytest.raises(Refused, match="the curve ends at 16 s"):
        MovingAverage(samples=50, rate=1.0).noise(curve)


def test_rates_of_all_axes_carry_the_uncertainty_of_the_alignment():
    """Readings through scale and matrix: parts add in squares; one unknown makes its rates unknown."""
    calibration = replace(calibrate(readings()).calibration, alignment=ALIGNED, alignment_uncertainty=None)
    crossed = replace(
        calibration,
        alignment=((1.0, 0.1, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        alignment_uncertainty=((0.0, 0.02, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    )
    given = {axis: figure(value) for axis, value in zip("xyz", (1.1, 2.1, 3.1), strict=True)}
    plain, found = calibration.figures(given, 25.0), crossed.figures(given, 25.0)
    assert found["x"].value == pytest.approx(1.05 * 1.0 + 0.1 * 1.05 * 2.0)
    expected = math.hypot(plain["x"].uncertainty, 0.1 * plain["y"].uncertainty, 0.02 * plain["y"].value)
    assert found["x"].uncertainty == pytest.approx(expected)
    assert found["z"] == plain["z"]
    assert crossed.figures({**given, "y": Figure(value=2.1, unit="deg/s")}, 25.0)["x"].uncertainty is None
    invalid = Figure(value=math.nan, unit="deg/s", status=FigureStatus.NOT_OBSERVABLE)
    assert crossed.figures({**given, "y": invalid}, 25.0)["x"].status is FigureStatus.NOT_OBSERVABLE
    with pytest.raises(Refused, match="no readings of axis z"):
        calibration.figures({axis: given[axis] for axis in "xy"}, 25.0)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_c_header_compiles_and_computes_the_same_rates(tmp_path):
    """A C99 program with the header's own formula gives the rates that Python gives."""
    calibration = printed(calibrate(readings(rate=13.6)).calibration)
    (tmp_path / "calibration.h").write_text(as_c_header(calibration), encoding="utf-8")
    (tmp_path / "rates.c").write_text(PROGRAM, encoding="utf-8")
    program = tmp_path / "rates"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    subprocess.run(["cc", *flags, str(tmp_path / "rates.c"), "-o", str(program)], check=True, timeout=50)
    done = subprocess.run([str(program)], check=True, capture_output=True, text=True, timeout=10)
    expected = calibration.correct({"x": 1.0, "y": -2.0, "z": 3.0}, 31.5)
    assert [float(line) for line in done.stdout.split()] == pytest.approx([float(each) for each in expected.values()])


PROGRAM = """
#include <stdio.h>
#include "calibration.h"
static double at(const double *terms, int count, double offset)
{
    double sum = 0.0;
    while (count-- > 0) sum = sum * offset + terms[count];
    return sum;
}
int main(void)
{
    const double measured[GYROSCOPE_AXES] = {1.0, -2.0, 3.0}, offset = 31.5 - GYROSCOPE_REFERENCE_DEGC;
    for (int i = 0; i < GYROSCOPE_AXES; i++) {
        double rate = 0.0;
        for (int j = 0; j < GYROSCOPE_AXES; j++)
            rate += gyroscope_alignment[i][j] * at(gyroscope_scale[j], GYROSCOPE_SCALE_TERMS, offset)
                * (measured[j] - at(gyroscope_bias[j], GYROSCOPE_BIAS_TERMS, offset));
        printf("%.17g\\n", rate);
    }
    return 0;
}
"""


def test_rates_in_one_direction_give_a_scale_with_the_bias_of_rest():
    """The same scale as both directions give, less sure, and the assumption is said."""
    both = calibrate(readings(turning="y"))
    found = calibrate([*readings(turning=""), *one_way()])
    own, wide = (each.calibration.axes["y"].scale.figure(25.0) for each in (both, found))
    assert wide.value == pytest.approx(own.value, rel=1e-9)
    assert wide.uncertainty > 1.5 * own.uncertainty
    assert any("from one direction and readings at rest" in remark for remark in found.remarks)


@pytest.mark.parametrize(
    ("factor", "other", "said"),
    [
        (1.0, 0.01, ""),
        (math.pi / 180.0, 0.0, "near 1/57.3"),
        (180.0 / math.pi, 0.0, "near 57.3"),
        (-1.0, 0.0, "the sign of its rates, or of its readings, is wrong"),
        (2e-28, 0.0, "it does not move as it was turned"),
        (0.01, 0.98, "0.98 by y: the axis does not move, or is another one"),
    ],
)
def test_a_gain_that_no_sensor_has_is_told(factor, other, said):
    """Of its own rate, in the same unit, with the same sign; else what may have happened."""
    gains = {"x": Figure(value=factor, unit="1"), "y": Figure(value=other, unit="1")}
    (gate,) = implausible([Response(axis="x", temperature=25.0, low=25.0, high=25.0, gains=gains)])
    assert gate.ok is (not said)
    assert said in gate.reason


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_a_degree_that_is_given_is_used(degree):
    """Up to one below the number of temperatures; how it was chosen is told."""
    found = fit(TEMPERATURES, [figure(0.1 * place) for place in range(4)], degree=degree)
    assert (found.polynomial.degree, found.chosen) == (degree, "given")
    with pytest.raises(Refused, match="is not between 1 and 2 for 3 temperatures"):
        fit(TEMPERATURES[:3], [figure(0.1)] * 3, degree=3)


def test_an_outlier_is_named_and_a_point_that_decides_alone():
    """One of twenty points by 50 uncertainties; and one that is far from all others."""
    noise = 0.01 * np.random.default_rng(5).standard_normal(20)
    where = np.repeat(np.linspace(0.0, 40.0, 5), 4)
    values = [figure(value) for value in (0.01 * where + noise).tolist()]
    assert fit(where, values).outliers == ()
    values[7] = figure(values[7].value + 0.5)
    found = fit(where, values)
    assert found.outliers == (7,)
    assert "outlier at 10 degC (point 8)" in found.remark
    far = fit([0.0, 0.1, 0.2, 0.3, 40.0], [figure(0.1 + 0.001 * place) for place in (1, -1, 1, -1, 3)])
    assert "the point at 40 degC decides the polynomial there alone" in far.remark
    assert far.leverage[-1] > 0.99


def test_residuals_that_follow_the_temperature_are_told():
    """A parabola, fitted by a line with too generous uncertainties: chi-square says nothing, the runs do."""
    where = np.linspace(-20.0, 40.0, 24)
    found = fit(where, [figure(1e-5 * (each - 10.0) ** 2) for each in where.tolist()], degree=1)
    assert found.consistent
    assert found.runs < 1e-4
    assert "the residuals still follow the temperature" in found.remark
    alternating = fit(where, [figure(0.01 * (-1) ** place) for place in range(24)], degree=1)
    assert alternating.runs > 0.5


def test_what_readings_share_is_in_the_bias_and_nowhere_else():
    """The Earth along the table's axis is common to a mounting; a walk is certain at its start; flicker falls off."""
    given = [
        Reading(temperature=25.0, means={}, at=at, mounting=mounting)
        for at, mounting in ((0.0, "x"), (100.0, "x"), (400.0, "y"))
    ]
    assert Slow(earth=2.0).covariance(given, "x").tolist() == [[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 4.0]]
    walk = Slow(random_walk=0.1).covariance(given, "x")
    assert walk == pytest.approx(np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 1.0], [0.0, 1.0, 4.0]]))
    flicker = Slow(flicker=0.1).covariance(given, "x")
    assert flicker[0, 0] > flicker[0, 1] > flicker[0, 2] > 0.0
    assert np.linalg.eigvalsh(flicker).min() > 0.0
