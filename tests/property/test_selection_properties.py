"""Properties of a selection: the order of packages plays no part, and what is taken away makes nobody surer."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from selected import criteria, package, taken

from hil.selection.choosing import choose
from hil.selection.page import as_html
from hil.selection.tables import as_csv, as_json

with tempfile.TemporaryDirectory() as _folder:
    CRITERIA = criteria(
        Path(_folder),
        """
        title: Three sensors
        candidates:
          A: {roles: [gyroscope], instances: [a]}
          B: {roles: [gyroscope], instances: [b]}
          C: {roles: [gyroscope], instances: [c]}
        criteria:
          Noise: {parameter: white_noise, units: {gyroscope: deg/s/sqrt(Hz)}, axes: [x, y]}
          Drift: {parameter: drift, units: {gyroscope: deg/s/K}, axes: [x], weight: "2"}
        """,
    )

_UNITS = {"white_noise": "deg/s/sqrt(Hz)", "drift": "deg/s/K"}
_AXES = [("white_noise", f"gyroscope.{name}.{axis}") for name in "abc" for axis in "xy"]
_AXES += [("drift", f"gyroscope.{name}.x") for name in "abc"]
_VALUES = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))
_PROBLEMS = st.sampled_from(["", "", "", "", "its data are in DOUBT: stuck"])


@st.composite
def figures(draw):
    """Return one figure of every axis, a few of which do not count."""
    return [
        taken(
            of, draw(_VALUES), draw(st.floats(0.001, 0.5)), parameter=name, unit=_UNITS[name], problem=draw(_PROBLEMS)
        )
        for name, of in _AXES
    ]


def chosen(packages, **changed):
    """Return the selection."""
    return choose(CRITERIA, packages, content="c", version="0", **changed)


@given(figures(), st.randoms(use_true_random=False))
@settings(max_examples=6)
def test_the_order_of_packages_plays_no_part(held, chance):
    """Page, CSV and JSON are the same bytes."""
    packages = [package(number, held[number::4]) for number in range(4)] + [package(9, held[:5])]
    first = chosen(packages)
    chance.shuffle(packages)
    again = chosen(packages)
    assert as_json(again) == as_json(first)
    assert as_csv(again) == as_csv(first)
    assert as_html(again) == as_html(first)


@given(figures(), st.sets(st.sampled_from(range(9))))
@settings(max_examples=12)
def test_taking_evidence_away_makes_no_candidate_surer(held, away):
    """What a candidate wins for certain only falls, and every package that is gone is named."""
    packages = [package(number, [figure]) for number, figure in enumerate(held)]
    gone = sorted(packages[number].run for number in away)
    before = chosen(packages)
    after = chosen([each for each in packages if each.run not in gone], left_out=gone)
    low = {(each.role, each.candidate): each.low for each in before.shares}
    assert all(each.low <= low[each.role, each.candidate] + 1e-4 for each in after.shares)
    assert {each.run for each in after.excluded if each.reason == "it was not given"} == set(gone)


@given(figures())
@settings(max_examples=8)
def test_probabilities_add_up_and_follow_the_places(held):
    """Among those that were judged somebody is the best, and nobody below all others has a share of half."""
    for cell in chosen([package(1, held)]).cells:
        sure = [each.probability for each in cell.standings]
        assert not sure or abs(sum(sure) - 1.0) < 1e-3
        assert all(each.probability <= 0.5 for each in cell.standings if each.rank > 1)
        assert {each.candidate for each in cell.standings} | {each.candidate for each in cell.unjudged} == {
            "A",
            "B",
            "C",
        }
