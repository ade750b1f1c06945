"""What holds for any figures that are compared."""

from __future__ import annotations

import pytest
import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.analysis import rank, relative_deviation
from hil.model.figure import Figure

steady = settings(derandomize=True, max_examples=sweeps.examples(60))
figures = st.builds(
    lambda value, uncertainty: Figure(value=value, unit="uT", uncertainty=uncertainty),
    st.floats(0.01, 100.0),
    st.floats(1e-3, 10.0),
)
several = st.lists(figures, min_size=1, max_size=8).map(
    lambda many: {f"s{place}": each for place, each in enumerate(many)}
)


@steady
@given(figures, figures, st.floats(1e-3, 1e3))
def test_significance_has_neither_side_nor_unit(one, other, scale):
    """Whoever is the first one, and in whatever unit, the difference is as probable."""
    there, back = relative_deviation(one, other), relative_deviation(other, one)
    scaled = relative_deviation(one * scale, other * scale)
    assert there.significant == back.significant
    assert there.probability == pytest.approx(back.probability, rel=1e-9)
    assert scaled.probability == pytest.approx(there.probability, rel=1e-6, abs=1e-12)
    assert scaled.relative.value == pytest.approx(there.relative.value, rel=1e-9, abs=1e-9, nan_ok=True)


@steady
@given(several)
def test_ranks_follow_from_pairs(given_figures):
    """Who cannot be told apart shares a rank, and who can does not tie; order and names do not matter."""
    ranking = rank(given_figures)
    places = {place.name: place for place in ranking.places}
    assert places.keys() == given_figures.keys()
    assert [place.figure.value for place in ranking.places] == sorted(each.value for each in given_figures.values())
    for name, place in places.items():
        assert 1 <= place.rank <= place.last <= len(places)
        for other, beside in places.items():
            apart = relative_deviation(given_figures[name], given_figures[other]).significant
            assert (other in place.ties) == (not apart and other != name)
            if not apart:
                assert place.rank <= beside.last
                assert beside.rank <= place.last
            elif place.figure.value < beside.figure.value:
                assert place.rank < beside.rank
    assert rank(dict(reversed(given_figures.items()))).places == ranking.places or len(
        {each.value for each in given_figures.values()}
    ) < len(given_figures)
