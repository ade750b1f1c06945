"""What a plan allows its parameters to be."""

from __future__ import annotations

import pytest

from hil.model.errors import ConfigurationError, Refused
from hil.requirements.parameters import load_parameters

_HEAD = "schema: hil/parameters/1\nparameters:\n"
_TEXT = """\
- {name: cycles, value: "10", unit: "1", min: "1", max: "10", whole: true}
- {name: rest, value: "1800", unit: s, min: "60"}
- {name: current, value: "-1", unit: mA, max: "0"}
- {name: span, values: ["3.4", "3.95"], unit: V, min: "2.5", max: "4.2", count: 2, rising: true}
"""


@pytest.fixture
def load(tmp_path):
    """Loads a plan with these entries as its parameters."""

    def load(text=_TEXT):
        plan = tmp_path / "testplans" / "small"
        plan.mkdir(parents=True, exist_ok=True)
        (plan / "parameters.yaml").write_text(_HEAD + text)
        return load_parameters(tmp_path, plan)

    return load


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("cycles", "11", "parameter 'cycles' is 11, allowed is a whole number from 1 to 10; the plan has 10"),
        ("cycles", "0", "parameter 'cycles' is 0, allowed is a whole number from 1 to 10"),
        ("cycles", "-1", "parameter 'cycles' is -1, allowed is a whole number from 1 to 10"),
        ("cycles", "1.5", "parameter 'cycles' is 1.5, allowed is a whole number from 1 to 10"),
        ("rest", "-100", "parameter 'rest' is -100 s, allowed is a number of at least 60 s; the plan has 1800 s"),
        ("rest", "0.5 min", "parameter 'rest' is 30 s, allowed is a number of at least 60 s"),
        ("current", "1 uA", "parameter 'current' is 0.001 mA, allowed is a number of at most 0 mA"),
        (
            "span",
            "3.4",
            "parameter 'span' is 3.4 V, allowed is 2 numbers from 2.5 V to 4.2 V, each above",
        ),
        ("span", "3.9, 3.4", "parameter 'span' is 3.9, 3.4 V, allowed is 2 numbers from 2.5 V to 4.2 V"),
        ("span", "3.4, 3.4", "each above the one before"),
        ("span", "3.4, 4.3", "parameter 'span' is 3.4, 4.3 V"),
    ],
)
def test_a_value_that_the_plan_does_not_allow_is_refused(load, name, text, message):
    """With the parameter, the value in the plan's unit, what is allowed, and what the plan has."""
    with pytest.raises(Refused) as refused:
        load().override(name, text)
    assert message in str(refused.value)


def test_a_value_at_a_bound_is_allowed(load):
    """Bounds belong to what is allowed, in whatever unit a value is written."""
    parameters = load().override("cycles", "1").override("rest", "1 min").override("span", "2.5, 4.2")
    assert (parameters.cycles, parameters.rest, parameters.span) == (1.0, 60.0, (2.5, 4.2))


def test_bounds_are_no_part_of_a_value(load):
    """A plan that gets bounds has the same parameters as before."""
    without = load('- {name: rest, value: "1800", unit: s}\n')
    assert load('- {name: rest, value: "1800", unit: s, min: "60"}\n').digest == without.digest


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ('{name: a, value: "0", unit: s, min: "1"}', "parameter 'a' is 0 s, allowed is a number of at least 1 s"),
        ('{name: a, values: ["2", "1"], unit: s, rising: true}', "parameter 'a' is 2, 1 s, allowed is a number, each"),
        ('{name: a, value: "1", unit: s, min: "3", max: "2"}', "min 3 is above max 2"),
        ('{name: a, value: "1", unit: s, min: 1}', "'min' must be a number in quotes"),
        ('{name: a, value: "1", unit: s, whole: "yes"}', "'whole' must be true or false"),
        ('{name: a, values: ["1"], unit: s, count: 0}', "'count' must be at least 1"),
        ('{name: a, value: "1", unit: s, count: 1}', "'count' applies to a list, and this parameter has no values"),
        (
            '{name: a, value: "1", unit: s, rising: true}',
            "'rising' applies to a list, and this parameter has no values",
        ),
        ('{name: a, value: up, max: "1"}', "a text has no 'max', only a number with a unit has"),
        ('{name: a, value: "1", unit: s, minimum: "1"}', "unknown key 'minimum', did you mean 'min'?"),
    ],
)
def test_wrong_bounds_are_errors_at_load(load, entry, expected):
    """With file, line and column, a value of the plan itself included."""
    with pytest.raises(ConfigurationError) as error:
        load(f"- {entry}\n")
    assert expected in str(error.value)
    assert str(error.value).startswith("testplans/small/parameters.yaml:3:")


def test_a_value_that_cannot_be_read_is_told_once(load):
    """What stands in for it is held against nothing."""
    with pytest.raises(ConfigurationError) as error:
        load('- {name: a, value: x, unit: s, min: "1"}\n')
    assert len(error.value.findings) == 1
