"""`check`: what the catalogue holds is evaluated and written down, everything else is refused."""

from __future__ import annotations

import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from case_parts import REQUIREMENTS, Case
from typed_events import event_of

from hil.documents.node import Place
from hil.evidence.package.judging import judge_again
from hil.evidence.results.facts import entries_of
from hil.executive.cases.checks import CheckFailed, Checks
from hil.model.errors import Misused
from hil.model.figure import Figure, FigureStatus
from hil.requirements.units import UnitError


def volts(value, **more):
    """Return a voltage."""
    return Figure(value=value, unit="V", **more)


@pytest.mark.parametrize(
    ("arguments", "of", "message"),
    [
        (("T-011", "ratio"), None, "this case is not marked with requirement 'T-011', did you mean 'T-010'?"),
        (("T-010", "rati"), None, "T-010 has no parameter 'rati', did you mean 'ratio'?"),
        (("T-020", "rate"), "w", "T-020 rate is evaluated of x, y, not of 'w'"),
        (("T-020", "rate"), None, "T-020 rate is evaluated of x, y, not of"),
        (("T-010", "ratio"), "x", "T-010 ratio is evaluated of nothing in particular, not of 'x'"),
    ],
)
def test_what_the_catalogue_does_not_hold_is_refused(tmp_path, arguments, of, message):
    """Requirement, parameter and `of` are all compared, and nothing is written."""
    case = Case(tmp_path, "T-010", "T-020")
    with pytest.raises(Misused) as caught:
        case.run.check(*arguments, 1.0, of=of)
    assert message in str(caught.value)
    assert case.written.events == []


@pytest.mark.parametrize("value", [5.0, 5, np.float64(5.0), np.int64(5)])
def test_a_bare_number_has_no_unit(tmp_path, value):
    """Where a limit has a unit, a number without one is refused."""
    case = Case(tmp_path, "T-050", "T-010")
    with pytest.raises(
        Misused, match="expected a number in V, found 5 without a unit; give a Figure of one number and its unit"
    ):
        case.run.check("T-050", "voltage", value)


def test_a_plain_number_may_be_bare(tmp_path):
    """Where the unit is 1 a number is enough; true and false are no numbers."""
    case = Case(tmp_path, "T-010")
    assert case.run.check("T-010", "ratio", np.float32(1.0)) == "PASS"
    with pytest.raises(Misused):
        case.run.check("T-010", "ratio", True)


@pytest.mark.parametrize(
    ("requirement", "parameter", "value", "verdict"),
    [
        ("T-010", "ratio", 1.0, "PASS"),
        ("T-010", "ratio", 2.0, "FAIL"),
        ("T-010", "ratio", math.nan, "INCONCLUSIVE"),
        ("T-010", "ratio", math.inf, "INCONCLUSIVE"),
        ("T-050", "voltage", volts(5.0), "INCONCLUSIVE"),
        ("T-050", "voltage", volts(5.0, uncertainty=0.01), "PASS"),
        ("T-050", "voltage", volts(5.0, uncertainty=0.01, status=FigureStatus.MODEL_REJECTED), "INCONCLUSIVE"),
        ("T-040", "answers", "yes", "PASS"),
        ("T-040", "answers", "no", "FAIL"),
        ("T-040", "answers", volts(1.0), "INCONCLUSIVE"),
        ("T-080", "noise", volts(0.1), "RECORDED"),
    ],
)
def test_a_check_returns_and_writes_its_verdict(tmp_path, requirement, parameter, value, verdict):
    """The case goes on whatever the verdict is, and the journal has it with its limit."""
    case = Case(tmp_path, requirement)
    assert case.run.check(requirement, parameter, value) == verdict
    (check,) = case.written.of("check")
    assert (check["verdict"], check["requirement"], check["parameter"]) == (verdict, requirement, parameter)
    assert (check["reason"] == "") == (verdict in {"PASS", "RECORDED"})
    if isinstance(value, float) and not math.isfinite(value):
        assert check["value"] is None


def test_a_figure_in_another_unit_is_converted_or_refused(tmp_path):
    """Millivolts are volts; seconds are not."""
    case = Case(tmp_path, "T-050")
    assert case.run.check("T-050", "voltage", Figure(value=5000.0, unit="mV", uncertainty=5.0)) == "PASS"
    (check,) = case.written.of("check")
    assert (check["value"], check["unit"], check["uncertainty"]) == (5.0, "V", 0.005)
    with pytest.raises(UnitError):
        case.run.check("T-050", "voltage", Figure(value=5.0, unit="s"))


def test_a_poor_test_uncertainty_ratio_says_where_it_is_asked_for(tmp_path):
    """The reason names the requirement's file and line; a failure and a pass do not."""
    case = Case(tmp_path, "T-050")
    asked = case.requirements["T-050"]
    limits = (replace(asked.limits[0], min_tur="4"),)
    place = Place(path="testplans/t/requirements.yaml", line=14, column=3)
    case.requirements["T-050"] = replace(asked, limits=limits, place=place)
    assert case.run.check("T-050", "voltage", volts(5.0, uncertainty=0.02)) == "INCONCLUSIVE"
    assert case.run.check("T-050", "voltage", volts(7.0, uncertainty=0.02)) == "FAIL"
    assert case.run.check("T-050", "voltage", volts(5.0, uncertainty=0.001)) == "PASS"
    first, second, third = (event["reason"] for event in case.written.events)
    assert first == "the test uncertainty ratio is 2.55, at least 4 is required (testplans/t/requirements.yaml:14)"
    assert ".yaml" not in second + third


def test_an_instrument_adds_its_certificate_in_quadrature(tmp_path):
    """What the case computed and what its instrument adds are one uncertainty; the journal names the instrument."""
    case = Case(tmp_path, "T-050")
    case.coil.voltage()
    case.run.check("T-050", "voltage", volts(5.0, uncertainty=0.01), instrument=case.coil)
    (check,) = case.written.of("check")
    assert check["uncertainty"] == pytest.approx(math.hypot(0.01, 0.026))
    assert check["instruments"] == ("psu1",)


def test_require_stops_what_does_not_pass(tmp_path):
    """A required check that passes goes on; one that does not ends the case, and is written all the same."""
    case = Case(tmp_path, "T-010")
    case.run.check.require("T-010", "ratio", 1.0)
    with pytest.raises(CheckFailed, match="T-010 ratio is FAIL: 2 is above the maximum of 1.5"):
        case.run.check.require("T-010", "ratio", 2.0)
    assert [check["verdict"] for check in case.written.of("check")] == ["PASS", "FAIL"]


def test_an_empty_member_is_none(tmp_path):
    """A check of nothing in particular counts as the one that is due."""
    case = Case(tmp_path, "T-010")
    case.run.check("T-010", "ratio", 1.0, of="")
    assert case.run.outcome().verdict == "PASS"


def test_what_is_written_is_what_was_judged(tmp_path):
    """The digits in the journal are those of the verdict, so that anybody judges the same again."""
    case = Case(tmp_path, "T-010")
    assert case.run.check("T-010", "ratio", 1.5 + 1e-13) == "PASS"
    assert case.written.of("check")[0]["value"] == 1.5


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.True_, "expected a number in 1, found a bool"),
        (True, "found True (bool)"),
        (b"1.0", "found b'1.0' (bytes)"),
        (1 + 0j, "found (1+0j) (complex)"),
        (np.complex128(1.0), "expected a number in 1, found"),
        (np.array([1.0, 1.0]), "found a ndarray of shape (2,)"),
        (None, "found None (NoneType)"),
        ("1.0", "expected a number in 1, found the text '1.0'"),
        (Figure(value=np.True_, unit="1"), "the value of a figure is one real number, found a bool"),
        (Figure(value="1.0", unit="1"), "the value of a figure is one real number, found '1.0' (str)"),
        (Figure(value=np.ones(2), unit="1"), "the value of a figure is one real number, found a ndarray of shape (2,)"),
        (Figure(value=1.0, unit="1", uncertainty=True), "the uncertainty of a figure is one real number"),
        (Figure(value=1.0, unit="1", dof=True), "the dof of a figure is one real number"),
        (Figure(value=1.0, unit=1), "the unit of a figure is a text"),
        (Figure(value=1.0, unit="1", status="fine"), "'fine' (str) is not a status of a figure"),
    ],
)
def test_what_is_no_figure_is_refused(tmp_path, value, message):
    """Flags, texts, bytes, arrays and complex numbers never stand for a number, and nothing is written."""
    case = Case(tmp_path, "T-010")
    with pytest.raises(Misused) as caught:
        case.run.check("T-010", "ratio", value)
    assert message in str(caught.value)
    assert case.written.events == []


@pytest.mark.parametrize(
    "value",
    [
        np.float32(0.1),
        np.int64(1),
        Figure(value=np.float32(0.1), unit="1", uncertainty=np.float32(0.01), dof=np.int64(7)),
        Figure(value=np.int64(1), unit=np.str_("1"), status="measured"),
    ],
)
def test_numpys_numbers_are_written_as_they_were_judged(tmp_path, value):
    """A float32 becomes a float before it is judged, so that the journal's digits give the same margin again."""
    case = Case(tmp_path, "T-010")
    case.run.check("T-010", "ratio", value)
    (check,) = case.written.of("check")
    numbers = [check[name] for name in ("value", "uncertainty", "dof", "expanded", "margin") if check[name] is not None]
    assert {type(number) for number in numbers} == {float}
    assert type(check["status"]) is str
    entries = {item.id: item for item in REQUIREMENTS}
    assert list(judge_again(event_of(**check), entries_of([entries["T-010"]]))) == []


def test_the_worst_of_several_checks_of_one_criterion_counts(tmp_path):
    """A criterion that is evaluated again is a check of its own, and a later pass does not replace a failure."""
    case = Case(tmp_path, "T-010")
    for value in (2.0, 1.0):
        case.run.check("T-010", "ratio", value)
    assert [check["verdict"] for check in case.written.of("check")] == ["FAIL", "PASS"]
    assert case.run.outcome().verdict == "FAIL"


def test_only_a_role_adds_its_uncertainty(tmp_path):
    """Whatever else has a calibration is no instrument of the bench."""
    case = Case(tmp_path, "T-050")
    with pytest.raises(Misused, match="instrument is a role of this case, found a InstrumentSpec"):
        case.run.check("T-050", "voltage", volts(5.0), instrument=case.instrument)


@pytest.mark.parametrize("value", [1.0, 9.0])
def test_doubts_make_a_check_inconclusive_whatever_its_value(tmp_path, value):
    """Data that are not to be trusted neither pass nor fail; the reasons are told and written down."""
    case = Case(tmp_path, "T-010")
    verdict = case.run.check("T-010", "ratio", value, doubts=["stuck of x: all samples are the same"])
    event = case.written.of("check")[0]
    assert (verdict, event["verdict"]) == ("INCONCLUSIVE", "INCONCLUSIVE")
    assert event["reason"] == "stuck of x: all samples are the same"
    assert event["doubts"] == ("stuck of x: all samples are the same",)
    assert case.run.outcome().verdict == "INCONCLUSIVE"


def test_doubts_are_judged_again_and_cannot_be_overruled(tmp_path):
    """Who verifies the package finds a pass that was written in spite of a doubt."""
    case = Case(tmp_path, "T-010")
    case.run.check("T-010", "ratio", 1.0, doubts=["stuck of x: all samples are the same"])
    written = case.written.of("check")[0]
    entries = entries_of([next(item for item in REQUIREMENTS if item.id == "T-010")])
    assert list(judge_again(event_of(**written), entries)) == []
    assert any(
        "gives INCONCLUSIVE" in told for told in judge_again(event_of(**{**written, "verdict": "PASS"}), entries)
    )


def test_no_doubt_is_no_word_of_it(tmp_path):
    """A check without doubts is written as ever."""
    case = Case(tmp_path, "T-010")
    assert case.run.check("T-010", "ratio", 1.0, doubts=[]) == "PASS"
    assert "doubts" not in case.written.of("check")[0]


@pytest.mark.parametrize("doubts", ["stuck", [1], None])
def test_doubts_are_sentences(tmp_path, doubts):
    """A text alone, numbers, or nothing at all are a mistake."""
    case = Case(tmp_path, "T-010")
    with pytest.raises(Misused, match="sentences"):
        case.run.check("T-010", "ratio", 1.0, doubts=doubts)


FROM_NOWHERE = "no reading, recording or answer stands behind this value"


def last(case):
    """Return the event of the last check."""
    return event_of(**case.written.events[-1])


def of_last(case):
    """Return why the value of the last check proves nothing, and what no certificate covers."""
    return last(case).unproven, last(case).uncovered


def test_a_constant_comes_from_nowhere(tmp_path):
    """A bare number, and a figure built of a reading's number, close nothing, whatever was used before."""
    case = Case(tmp_path, "T-010", "T-050")
    reading = case.coil.voltage()
    case.run.check("T-010", "ratio", 1.0)
    assert of_last(case) == ((FROM_NOWHERE,), ())
    case.run.check("T-050", "voltage", volts(reading.value, uncertainty=reading.uncertainty))
    assert of_last(case) == ((FROM_NOWHERE,), ())
    assert last(case).instruments == ()


def test_a_reading_names_its_instrument_and_nothing_else(tmp_path):
    """Not what the case has touched besides."""
    case = Case(tmp_path, "T-050")
    case.field.sample()
    case.run.check("T-050", "voltage", case.coil.voltage())
    check = last(case)
    assert (check.instruments, check.provenance) == (("psu1",), ("supply.coil.voltage",))
    assert of_last(case) == ((), ())


def test_a_word_written_into_the_plan_comes_from_nowhere(tmp_path):
    """As a number does."""
    case = Case(tmp_path, "T-040")
    case.run.check("T-040", "answers", "yes")
    assert of_last(case) == ((FROM_NOWHERE,), ())


def test_an_uncertainty_replaced_by_hand_is_told(tmp_path):
    """`replace(reading, uncertainty=1e-9)` passes a guarded limit, and closes nothing."""
    case = Case(tmp_path, "T-050")
    case.run.check("T-050", "voltage", replace(case.coil.voltage(), uncertainty=1e-9))
    assert of_last(case) == (("its uncertainty was replaced by hand",), ())


def test_an_instrument_without_calibration_shows_nothing(tmp_path):
    """Under a guarded rule it is INCONCLUSIVE, however small the uncertainty is that an analysis found."""
    case = Case(tmp_path, "T-050")
    case.coil.__dict__["instrument"] = replace(case.instrument, calibration=None)
    known = volts(case.coil.voltage().value, uncertainty=0.001).with_provenance(case.coil.voltage().provenance)
    assert case.run.check("T-050", "voltage", known) == "INCONCLUSIVE"
    assert last(case).reason == "psu1 has no calibration record"
    assert of_last(case) == ((), ("psu1 has no calibration record",))


def test_nothing_read_of_the_device_under_test_needs_a_certificate(tmp_path):
    """What it says of itself is what is tested."""
    case = Case(tmp_path, "T-050", dut=True)
    case.coil.__dict__["instrument"] = replace(case.instrument, calibration=None)
    case.run.check("T-050", "voltage", case.coil.voltage())
    assert of_last(case) == ((), ())


def test_a_named_instrument_is_looked_up_in_its_own_unit(tmp_path):
    """Millivolts add what volts add, and what no range covers makes a guarded check INCONCLUSIVE."""
    case = Case(tmp_path, "T-050")
    assert case.run.check("T-050", "voltage", volts(5.0, uncertainty=1e-6), instrument=case.coil) == "PASS"
    in_volts = last(case)
    small = Figure(value=5000.0, unit="mV", uncertainty=1e-3)
    assert case.run.check("T-050", "voltage", small, instrument=case.coil) == "PASS"
    in_millivolts = last(case)
    assert in_millivolts.uncertainty == pytest.approx(in_volts.uncertainty)
    assert in_millivolts.instruments == ("psu1",)
    assert of_last(case) == ((FROM_NOWHERE,), ())
    beyond = Figure(value=1e6, unit="V", uncertainty=1e-3)
    assert case.run.check("T-050", "voltage", beyond, instrument=case.coil) == "INCONCLUSIVE"
    assert of_last(case)[1] == ("no range in the certificate of psu1 covers 1e+06 V",)


def test_what_no_certificate_covers_is_judged_again(tmp_path):
    """Verification finds a PASS written beside such a sentence, where the rule is guarded."""
    case = Case(tmp_path, "T-050")
    case.run.check("T-050", "voltage", volts(5.0, uncertainty=0.001))
    check, entries = last(case), entries_of(case.requirements.values())
    assert list(judge_again(check, entries)) == []
    forged = msgspec.structs.replace(check, uncovered=("psu1 has no calibration record",))
    assert ["field 'verdict' is PASS" in told for told in judge_again(forged, entries)] == [True]


def test_a_value_set_behind_a_figures_back_closes_nothing(tmp_path):
    """The check compares a figure with what it was issued with, however the frozen object was changed."""
    case = Case(tmp_path, "T-050")
    reading = case.coil.voltage()
    object.__setattr__(reading, "value", 12.0)
    case.run.check("T-050", "voltage", reading)
    assert of_last(case) == (("its value was replaced by hand",), ())


def test_a_number_that_stands_nowhere_is_told(tmp_path):
    """`reading * (100 / reading.value)` gives 100 whatever was read; a conversion can be read."""
    case = Case(tmp_path, "T-050")
    check = Checks(case.requirements, case.run.steps, case.written, {1000.0, 0.98}.__contains__)
    reading = case.coil.voltage()
    check("T-050", "voltage", reading * 0.98 / 1000 * 1000)
    assert of_last(case) == ((), ())
    check("T-050", "voltage", reading * (3.0 / reading.value))
    (sentence,) = last(case).unproven
    assert sentence.startswith("computed with ")
    assert sentence.endswith(", which stands neither in the plan's sources nor in its parameters")
