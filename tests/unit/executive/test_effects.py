"""Effects: keyed, written down, and compared with a record where there is one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from case_parts import Written
from hypothesis import given
from hypothesis import strategies as st
from typed_events import event_of

from hil.documents.canonical import canonical
from hil.executive.cases.effects import Effects, Recall
from hil.executive.cases.steps import Steps
from hil.model.errors import Diverged, NoReply
from hil.model.figure import Figure, FigureStatus, decoded, encoded

CASE = "plan/test_x.py::test_x"
ASKS = frozenset({"asks"})


def made(recall=None):
    """Return effects, the steps they happen in, and what was written."""
    written = Written()
    steps = Steps(CASE, written, lambda: 0.0)
    return Effects(written, steps, recall), steps, written


def recorded():
    """Return the record of two readings and an answer."""
    effects, steps, written = made()
    with steps("Read"):
        effects.perform("supply.voltage", "reads", {}, lambda: Figure(value=5.0, unit="V"))
        effects.perform("supply.voltage", "reads", {}, lambda: Figure(value=5.1, unit="V"))
    effects.perform("operator.jig", "asks", {"text": "Closed?"}, lambda: True)
    return [event_of(**event) for event in written.of("effect")]


def test_an_effect_is_keyed_by_case_step_name_and_ordinal():
    """Equal calls in one step are told apart by their ordinal, which starts again in the next step."""
    effects, steps, written = made()
    with steps("One"):
        effects.perform("supply.enable", "drives", {}, lambda: None)
        effects.perform("supply.enable", "drives", {}, lambda: None)
    with steps("Two"):
        effects.perform("supply.enable", "drives", {}, lambda: None)
    keys = [(each["case"], each["step"], each["name"], each["ordinal"]) for each in written.of("effect")]
    assert keys == [(CASE, "1", "supply.enable", 1), (CASE, "1", "supply.enable", 2), (CASE, "2", "supply.enable", 1)]


def test_an_effect_is_written_with_arguments_and_result():
    """What was asked and what came back are both evidence."""
    effects, _, written = made()
    assert effects.perform("supply.configure", "drives", {"voltage": 5.0, "current": 0.1}, lambda: (1, "a")) == (1, "a")
    (effect,) = written.of("effect")
    assert (effect["effect"], effect["arguments"]) == ("drives", {"voltage": 5.0, "current": 0.1})
    assert effect["result"] == [1, "a"]


def test_what_an_effect_raises_is_written_and_goes_on():
    """Silence is a result, too."""
    effects, _, written = made()

    def silent():
        raise NoReply("psu1", "nothing came")

    with pytest.raises(NoReply):
        effects.perform("supply.voltage", "reads", {}, silent)
    assert [(each["raised"], each["result"]) for each in written.of("effect")] == [("NoReply", None)]


def test_effects_are_performed_undisturbed():
    """Requests to stop wait while an effect is on its way."""
    inside = []

    class Quiet:
        def __enter__(self):
            inside.append("in")

        def __exit__(self, *_):
            inside.append("out")

    effects = Effects(Written(), Steps(CASE, Written(), lambda: 0.0), None, Quiet)
    effects.perform("supply.enable", "drives", {}, lambda: inside.append("act"))
    assert inside == ["in", "act", "out"]


def test_the_same_case_agrees_with_its_record():
    """Answers come from the record, everything else is performed again."""
    effects, steps, written = made(Recall(recorded(), ASKS))
    performed = []

    def reading(value):
        performed.append(value)
        return Figure(value=value, unit="V")

    with steps("Read"):
        effects.perform("supply.voltage", "reads", {}, lambda: reading(5.0))
        effects.perform("supply.voltage", "reads", {}, lambda: reading(5.1))
    assert effects.perform("operator.jig", "asks", {"text": "Closed?"}, lambda: pytest.fail("asked again")) is True
    effects.end()
    assert performed == [5.0, 5.1]
    assert effects.diverged == ""
    assert [event_of(**event) for event in written.of("effect")] == recorded()


@pytest.mark.parametrize(
    ("title", "name", "arguments", "value"),
    [
        ("Read", "supply.current", {}, 5.0),
        ("Read", "supply.voltage", {"range": 1}, 5.0),
        ("Read", "supply.voltage", {}, 5.2),
        (None, "supply.voltage", {}, 5.0),
    ],
    ids=["another name", "other arguments", "another result", "another step"],
)
def test_another_effect_than_the_recorded_one_diverges(title, name, arguments, value):
    """Name, arguments, result and step must all be those of the record, and the difference stays known."""
    effects, steps, _ = made(Recall(recorded(), ASKS))

    def act():
        with pytest.raises(Diverged, match="but the record holds"):
            effects.perform(name, "reads", arguments, lambda: Figure(value=value, unit="V"))

    if title:
        with steps(title):
            act()
    else:
        act()
    assert "but the record holds" in effects.diverged


def test_another_order_diverges():
    """The record is followed strictly."""
    effects, _, _ = made(Recall(recorded(), ASKS))
    with pytest.raises(Diverged, match=r"step none: operator.jig .* but the record holds .* step 1: supply.voltage"):
        effects.perform("operator.jig", "asks", {"text": "Closed?"}, lambda: True)


def test_an_effect_beyond_the_record_diverges():
    """A case that does more than it did is not the same case."""
    effects, _, _ = made(Recall([], ASKS))
    with pytest.raises(Diverged, match="the record of this case has ended"):
        effects.perform("supply.enable", "drives", {}, lambda: None)


def test_a_case_that_ends_before_its_record_diverges():
    """A case that does less than it did is not the same case, either."""
    effects, _, _ = made(Recall(recorded(), ASKS))
    effects.end()
    assert effects.diverged.startswith("the case has ended, but its record goes on with")


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**40), 2**40)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4).map(tuple),
    max_leaves=8,
)
FIGURES = st.builds(
    Figure,
    value=st.floats(allow_infinity=False),
    unit=st.sampled_from(["V", "deg/s", "1"]),
    uncertainty=st.none() | st.floats(0, 1e6),
    dof=st.floats(0.5, 1e6) | st.just(math.inf),
    status=st.sampled_from(FigureStatus),
)


@given(JSON | FIGURES)
def test_values_survive_the_journal(value):
    """What a case was told comes back the same, figures included, and always has canonical JSON."""
    canonical({"result": encoded(value)})
    found = decoded(encoded(value))
    assert encoded(found) == encoded(value)
    if isinstance(value, Figure):
        assert (found.unit, found.uncertainty, found.dof, found.status) == (
            value.unit, value.uncertainty, value.dof, value.status,
        )  # fmt: skip
        assert found.value == value.value or (math.isnan(found.value) and math.isnan(value.value))
    else:
        assert found == value


@pytest.mark.parametrize(
    ("value", "told"),
    [
        (np.float64(1.5), 1.5),
        (np.float32(0.5), 0.5),
        (np.int64(3), 3),
        (True, True),
        (math.inf, None),
        (np.nan, None),
        ({"a": (np.int32(1), 2.0)}, {"a": [1, 2.0]}),
    ],
)
def test_numbers_of_numpy_are_plain_numbers_in_the_journal(value, told):
    """A setting that was computed is as good as one that was typed."""
    found = encoded(value)
    canonical({"value": found})
    assert found == told
    assert type(found) is type(told)


def test_an_infinite_uncertainty_is_unknown():
    """Canonical JSON has no infinity; nobody can tell an infinite uncertainty from none."""
    assert decoded(encoded(Figure(value=1.0, unit="V", uncertainty=math.inf))) == Figure(value=1.0, unit="V")
