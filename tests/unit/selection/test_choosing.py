"""A selection from the figures of packages: places, ties, probabilities, and everything that does not count."""

from __future__ import annotations

import math

import pytest
from selected import criteria, package, taken

from hil.model.errors import EvidenceError
from hil.selection.choosing import choose
from hil.selection.confidence import Known, best
from hil.selection.figures import CALCULATED

_TWO = """
    title: Two sensors
    candidates:
      A: {roles: [gyroscope], instances: [a]}
      B: {roles: [gyroscope], instances: [b]}
    criteria:
      Noise: {parameter: white_noise, units: {gyroscope: deg/s/sqrt(Hz)}, axes: [x, y], unaliased: true}
"""
_A = {"gyroscope.a.x": 1.0, "gyroscope.a.y": 1.1}
_B = {"gyroscope.b.x": 2.0, "gyroscope.b.y": 1.0}


@pytest.fixture
def selected(tmp_path):
    """Return the selection from packages by a criteria file."""

    def made(*packages, text=_TWO, **changed):
        return choose(criteria(tmp_path, text), packages, content="c", version="0", **changed)

    return made


def _cell(document):
    (cell,) = document.cells
    return cell


def test_the_worst_axis_counts_and_its_probability_is_told(selected):
    """Two units of a thing are apart by many uncertainties; the value is in the unit that was asked for."""
    cell = _cell(selected(package(1, _A), package(2, _B)))
    first, second = cell.standings
    assert (cell.best, cell.unjudged) == (("A",), ())
    assert (first.candidate, first.rank, first.value, first.of, first.probability) == ("A", 1, 1.1, "gyroscope.a.y", 1)
    assert (second.rank, second.value, second.of) == (2, 2.0, "gyroscope.b.x")
    assert first.expanded == pytest.approx(1.96 * 0.011, rel=1e-3)
    assert cell.notes == ("Aliasing of noise cannot be judged for A, B: rate or bandwidth is not recorded",)


def test_who_cannot_be_told_apart_shares_a_place_and_both_are_named(selected):
    """10 % of uncertainty does not tell 1.0 from 1.1, and the probability says so."""
    figures = [taken(of, value, 0.1) for of, value in (_A | {"gyroscope.b.x": 1.0, "gyroscope.b.y": 1.0}).items()]
    cell = _cell(selected(package(1, figures)))
    assert cell.best == ("B", "A")
    assert [(each.rank, each.last, each.ties) for each in cell.standings] == [(1, 2, ("A",)), (1, 2, ("B",))]
    assert 0.5 < cell.standings[0].probability < 0.9


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"problem": "its data are in DOUBT: stuck of x"}, "its data are in DOUBT: stuck of x"),
        ({"unit": "uT/sqrt(Hz)"}, "it is in uT/sqrt(Hz), which does not convert to deg/s/sqrt(Hz)"),
        ({"unit": "count"}, "it is in count, which does not convert to deg/s/sqrt(Hz)"),
        (
            {"rate": 10.0, "bandwidth": 32.0},
            "its noise is aliased: 10 samples per second, and the filter passes noise up to 32 Hz",
        ),
    ],
)
def test_a_figure_that_does_not_count_takes_its_candidate_out_and_says_why(selected, changed, reason):
    """The other axis is not enough, or a sensor would be the better for an axis that could not be judged."""
    figures = [taken("gyroscope.a.x", 1.0), taken("gyroscope.a.y", 0.5, **changed)]
    document = selected(package(1, figures), package(2, _B))
    cell = _cell(document)
    assert (cell.best, cell.unjudged[0].candidate) == (("B",), "A")
    assert cell.unjudged[0].reasons == (f"gyroscope.a.y: {reason}",)
    (excluded,) = document.excluded
    assert (excluded.run, excluded.candidate, excluded.what) == ("run-1", "A", "white_noise of gyroscope.a.y")
    assert excluded.reason == reason


def test_an_axis_without_a_figure_is_named(selected):
    """Nothing was excluded: nobody measured it, because no plan asks for it or because a run did not get there."""
    cell = _cell(selected(package(1, {"gyroscope.a.x": 1.0}), package(2, _B)))
    assert cell.unjudged[0].reasons == ("gyroscope.a.y: no package has a figure, and no requirement asks for one",)

    asked = package(1, {"gyroscope.a.x": 1.0}, asked=frozenset({("white_noise", "gyroscope.a.y")}))
    cell = _cell(selected(asked, package(2, _B)))
    reason = "no package has a figure, though a requirement of run-1 asks for one"
    assert cell.unjudged[0].reasons == (f"gyroscope.a.y: {reason}",)


def test_noise_behind_a_narrow_filter_counts_and_nothing_is_left_to_say(selected):
    """Twice the bandwidth is enough."""
    figures = [taken(of, value, rate=64.0, bandwidth=32.0) for of, value in (_A | _B).items()]
    assert _cell(selected(package(1, figures))).notes == ()


def test_units_that_convert_are_brought_to_one(selected):
    """Radians are degrees of another size."""
    figures = [taken(of, math.radians(value), unit="rad/s/sqrt(Hz)") for of, value in _A.items()]
    cell = _cell(selected(package(1, figures), package(2, _B)))
    assert cell.standings[0].value == pytest.approx(1.1)


def test_a_figure_for_another_revision_of_its_requirement_does_not_count(selected):
    """The newest run says which one counts, whatever the order of the packages."""
    old = package(1, [taken(of, value, rev=1, fingerprint="e") for of, value in _A.items()])
    new = package(2, [taken(of, value, rev=2) for of, value in _B.items()])
    document = selected(new, old)
    assert _cell(document).best == ("B",)
    reason = "it was measured for revision 1 of IMU-010, and run-2 for revision 2"
    assert {each.reason for each in document.excluded} == {reason}
    assert document == selected(old, new)


def test_several_runs_of_an_axis_are_one_figure_with_the_scatter_between_them(selected):
    """By hand: 1.0 and 1.4 have the mean 1.2 and s / sqrt(2) = 0.2, far above their own uncertainties."""
    again = package(3, {"gyroscope.a.x": 1.4, "gyroscope.a.y": 1.1})
    document = selected(package(1, _A), package(2, _B), again)
    axis, other = next(each for each in _cell(document).standings if each.candidate == "A").axes
    assert (axis.value, axis.uncertainty, axis.dof) == (pytest.approx(1.2), pytest.approx(0.2), 1.0)
    assert (other.value, other.uncertainty) == (pytest.approx(1.1), pytest.approx(0.011 / math.sqrt(2)))
    near = package(3, {"gyroscope.a.x": 1.02, "gyroscope.a.y": 1.1})
    axis, _ = next(each for each in _cell(selected(package(1, _A), package(2, _B), near)).standings).axes
    assert (axis.uncertainty, axis.dof) == (pytest.approx(0.01), None)  # within the uncertainties: by chance
    axis, _ = next(each for each in _cell(document).standings if each.candidate == "A").axes
    assert axis.packages == (package(1, {}).digest, again.digest)


def test_a_package_that_does_not_verify_and_an_attempt_that_was_superseded_are_told(selected):
    """Nothing of the one counts, and of the other only the last attempt is in the results."""
    bad = package(1, {}, digest="", problem="it does not verify: data/journal.jsonl: changed after the seal")
    again = package(2, _A | _B, superseded=("attempt 1 of test_noise is superseded by attempt 2",))
    document = selected(bad, again)
    assert [(each.run, each.what, each.reason) for each in document.excluded] == [
        ("run-1", "the whole package", bad.problem),
        ("run-2", "attempt", again.superseded[0]),
    ]
    assert [(each.run, each.used) for each in document.packages] == [("run-1", 0), ("run-2", 4)]


def test_a_copy_of_a_package_is_one_package_and_two_contents_of_one_run_are_refused(selected):
    """Who gives a package twice does not make its figures surer."""
    assert selected(package(1, _A | _B), package(1, _A | _B)) == selected(package(1, _A | _B))
    with pytest.raises(EvidenceError, match="both the run run-1"):
        selected(package(1, _A), package(1, _B, digest="d" * 64))


def test_what_a_reader_has_to_know_stands_first(selected):
    """Simulated and replayed runs, deviations, what was not given, and what is gone."""
    document = selected(
        package(
            1,
            [taken(*each, unproven=("its value was replaced by hand",)) for each in _A.items()],
            source="simulated",
            deviates=True,
        ),
        package(2, [taken(*each, unproven=(CALCULATED,)) for each in _B.items()], source="replayed"),
        left_out=["run-3"],
        missing=["run-4"],
    )
    assert document.warnings == (
        "SIMULATED: 1 of 2 packages that count is simulated; this says nothing about real sensors",
        "REPLAYED: 1 of 2 packages that count is replayed; this says nothing about real sensors",
        "CALCULATED: white_noise: from parameters of the plan, as in a simulation; no sensor was read for it",
        "UNPROVEN: white_noise: its value was replaced by hand",
        "1 of 2 packages that count deviates from the plan",
        "Not given, though it has such figures: run-3",
        "The ledger names runs that are missing here and may have such figures: run-4",
    )
    assert document.excluded[0].reason == "it was not given"


def test_a_calculation_that_is_repeated_is_no_second_figure(selected):
    """The same parameters and seed give the same number, which two packages make no surer; two measurements are two."""
    once, again = (package(day, [taken(*each, unproven=(CALCULATED,)) for each in _A.items()]) for day in (1, 3))
    (axis, _) = next(each for each in _cell(selected(once, again, package(2, _B))).standings).axes
    assert (axis.uncertainty, axis.packages) == (pytest.approx(0.01), (once.digest,))
    (axis, _) = next(each for each in _cell(selected(package(1, _A), package(3, _A), package(2, _B))).standings).axes
    assert axis.uncertainty == pytest.approx(0.01 / math.sqrt(2))


def test_candidates_by_serial_number_and_part_have_runs_of_their_own(selected):
    """Their checks name the axis alone."""
    text = """
        title: Two units
        candidates:
          A: {roles: [gyroscope], duts: [SN1]}
          B: {roles: [gyroscope], part: P2}
        criteria: {Noise: {parameter: white_noise, units: {gyroscope: deg/s/sqrt(Hz)}, axes: [x]}}
    """
    runs = package(1, {"x": 1.0}, serial="SN1"), package(2, {"x": 2.0}, serial="SN2", part="P2")
    assert [each.value for each in _cell(selected(*runs, text=text)).standings] == [1.0, 2.0]


def test_shares_of_the_weights_have_a_range_where_somebody_was_not_judged(selected):
    """By hand: A wins a criterion of weight 3 for certain; in that of weight 1 only B was judged."""
    text = _TWO + "      Drift: {parameter: drift, units: {gyroscope: deg/s/K}, axes: [x], weight: '1'}\n"
    text = text.replace("unaliased: true", "weight: '3'")
    drift = taken("gyroscope.b.x", 1.0, parameter="drift", unit="deg/s/K")
    document = selected(package(1, _A | _B), package(2, [drift]), text=text)
    shares = [(each.candidate, each.low, each.share, each.high) for each in document.shares if each.role]
    assert shares == [("A", 0.75, 0.75, 1.0), ("B", 0.0, 0.25, 0.25)]


def test_probabilities_are_those_of_closed_forms_and_of_drawing():
    """Two normal numbers have the integral of the normal distribution; others were drawn a million times, seed 1."""
    one, two = best([[Known(1.0, 0.1, math.inf)], [Known(1.1, 0.1, math.inf)]])
    assert (one, two) == (pytest.approx(0.76025, abs=2e-4), pytest.approx(1 - 0.76025, abs=2e-4))
    assert best([[Known(1.0, 0.0, math.inf)], [Known(1.1, 0.0, math.inf)]]) == pytest.approx([1.0, 0.0])
    assert best([[Known(1.0, 0.1, 5.0)]] * 4) == pytest.approx([0.25] * 4)
    drawn = [
        [Known(1.0, 0.2, 4.0), Known(0.9, 0.1, math.inf)],
        [Known(-1.1, 0.1, 30.0)],
        [Known(0.05, 0.8, math.inf), Known(0.9, 0.3, 10.0)],
    ]
    assert best(drawn) == pytest.approx([0.3413, 0.1707, 0.4880], abs=0.002)
