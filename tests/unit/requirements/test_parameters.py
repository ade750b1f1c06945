from __future__ import annotations

import pytest

from hil.model.errors import ConfigurationError, HilError
from hil.requirements.parameters import Parameters, load_parameters

_TEXT = """\
schema: hil/parameters/1
parameters:
- {name: rest_duration, value: "14400", unit: s, text: How long a rest takes.}
- {name: gain, value: "0.1234567890123", unit: "1"}
- {name: temperatures, values: ["10", "25", "45"], unit: degC}
- {name: direction, value: up}
- {name: boards, values: [x_plus, x_minus]}
"""


@pytest.fixture
def load(tmp_path):
    """Loads a plan with this text as its parameters."""

    def load(text=_TEXT):
        plan = tmp_path / "testplans" / "gyro"
        plan.mkdir(parents=True, exist_ok=True)
        (plan / "parameters.yaml").write_text(text)
        return load_parameters(tmp_path, plan)

    return load


def test_parameters_are_attributes(load):
    """Numbers are floats in their unit, words are texts, lists are tuples."""
    parameters = load()
    assert parameters.rest_duration == 14400.0
    assert parameters.temperatures == (10.0, 25.0, 45.0)
    assert parameters.direction == "up"
    assert parameters.boards == ("x_plus", "x_minus")
    assert "rest_duration" in dir(parameters)
    assert parameters.deviations == ()


def test_an_unknown_parameter_names_the_nearest(load):
    """Asking for it, changing it, and looking for an attribute that may be missing."""
    parameters = load()
    with pytest.raises(HilError, match="no parameter 'rest_durations', did you mean 'rest_duration'"):
        _ = parameters.rest_durations
    with pytest.raises(HilError, match="no parameter 'rest'; it has rest_duration, gain"):
        parameters.override("rest", "1")
    assert not hasattr(parameters, "nothing_like_it")
    assert not hasattr(parameters, "__wrapped__")


def test_a_changed_parameter_is_a_deviation(load):
    """The text says what the plan asks for, also after a second change; the first parameters stay."""
    planned = load()
    changed = planned.override("rest_duration", "60")
    assert planned.rest_duration == 14400.0
    assert changed.rest_duration == 60.0
    assert changed.deviations == ("parameter rest_duration is 60 s instead of 14400 s",)
    assert changed.digest != planned.digest
    again = changed.override("rest_duration", "30").override("temperatures", "20, 30").override("direction", "down")
    assert again.deviations == (
        "parameter rest_duration is 30 s instead of 14400 s",
        "parameter temperatures is 20, 30 degC instead of 10, 25, 45 degC",
        "parameter direction is down instead of up",
    )
    assert again.temperatures == (20.0, 30.0)


def test_the_planned_value_is_no_deviation(load):
    """Another notation of the same number is the same number."""
    planned = load()
    same = planned.override("rest_duration", "60").override("rest_duration", "1.44e4")
    assert same.deviations == ()
    assert same.digest == planned.digest


def test_a_small_change_is_still_a_deviation(load):
    """No digit is rounded away."""
    assert load().override("gain", "0.1234567890124").deviations != ()


@pytest.mark.parametrize("text", ["", "abc", "nan", "inf", "1_0", "1,2"])
def test_what_is_no_value_is_refused(load, text):
    """A number stays a finite number."""
    with pytest.raises(HilError, match=r"is not a value for parameter 'rest_duration'; give a decimal number in s"):
        load().override("rest_duration", text)


def test_an_empty_word_is_refused(load):
    """Words need letters."""
    with pytest.raises(HilError, match="'direction' needs a value; it is up in the plan"):
        load().override("direction", " ")


def test_a_changed_parameter_may_name_its_unit(load):
    """It is converted to the plan's, and a unit of another dimension, or none at all, is refused."""
    planned = load()
    assert planned.override("rest_duration", "4 h").deviations == ()
    assert planned.override("rest_duration", "90 min").rest_duration == 5400.0
    assert planned.override("temperatures", "20, 30 degC").temperatures == (20.0, 30.0)
    for text, message in (
        ("4 kg", "'kg' does not convert to 's'"),
        ("4 K", "'K' does not convert to 's'"),
        ("4 furlong", "'furlong' is not a known unit"),
    ):
        with pytest.raises(HilError, match=f"'{text}' is not a value for parameter 'rest_duration': {message}"):
            planned.override("rest_duration", text)
    with pytest.raises(HilError, match="'K' does not convert to 'degC'"):
        planned.override("temperatures", "20 K, 30 K")


def test_parameters_cannot_be_changed(load):
    """Neither an attribute, nor what holds them."""
    parameters = load()
    for name in ("rest_duration", "_parameters", "anything"):
        with pytest.raises(HilError, match=f"parameter '{name}' cannot be changed by a case"):
            setattr(parameters, name, 1.0)
        with pytest.raises(HilError, match=f"parameter '{name}' cannot be removed"):
            delattr(parameters, name)
    with pytest.raises(TypeError):
        parameters._parameters["rest_duration"] = None


def test_a_number_in_a_unit_with_a_factor_needs_its_unit(load):
    """Ten centimetres are neither ten metres nor an attribute."""
    text = 'schema: hil/parameters/1\nparameters:\n- {name: length, value: "10", unit: cm}\n'
    parameters = load(text + '- {name: rests, values: ["1", "2"], unit: h}\n- {name: word, value: up}\n')
    with pytest.raises(HilError, match="'length' is in cm, say in which unit you want it: parameters.in_unit"):
        _ = parameters.length
    assert parameters.in_unit("length", "m") == pytest.approx(0.1)
    assert parameters.in_unit("length", "m").provenance.sources == ("parameter length",)
    assert parameters.in_unit("length", "cm") == 10.0
    assert parameters.in_unit("rests", "s") == (3600.0, 7200.0)
    with pytest.raises(HilError, match="'cm' does not convert to 's'"):
        parameters.in_unit("length", "s")
    with pytest.raises(HilError, match="parameter 'word' is text and has no unit"):
        parameters.in_unit("word", "m")
    assert parameters.problem_with("length").startswith("parameter 'length' is in cm")
    assert (parameters.problem_with("word"), parameters.problem_with("in_unit")) == ("", "")
    assert parameters.problem_with("wrod") == "the plan has no parameter 'wrod', did you mean 'word'?"


@pytest.mark.parametrize(
    "unit", ["1", "s", "kg", "m", "V", "Hz", "W", "ohm", "degC", "K", "deg", "rad", "deg/s", "LSB"]
)
def test_numbers_in_plain_units_are_attributes(load, unit):
    """SI without a prefix, degrees of angle and of Celsius: what roles and records take."""
    entry = f'- {{name: a, value: "10", unit: "{unit}"}}\n'
    assert load(f"schema: hil/parameters/1\nparameters:\n{entry}").a == 10.0


@pytest.mark.parametrize(
    ("unit", "wanted"),
    [("mV", "V"), ("h", "s"), ("%", "1"), ("G", "uT"), ("rpm", "deg/s"), ("mWh", "W.h"), ("bar", "bar")],
)
def test_what_is_to_be_asked_for_is_what_roles_take(load, unit, wanted):
    """Who follows the message must not set 5000 V where the plan has 5000 mV."""
    entry = f'- {{name: a, value: "10", unit: "{unit}"}}\n'
    told = load(f"schema: hil/parameters/1\nparameters:\n{entry}").problem_with("a")
    assert told.endswith(f"parameters.in_unit('a', '{wanted}')")


@pytest.mark.parametrize("unit", ["g", "mA", "uT", "h", "%", "Ah", "rpm", "kHz", "cm", "G", "deg/h"])
def test_numbers_in_other_units_are_not(load, unit):
    """A factor away from what a reader expects is not what a reader expects."""
    entry = f'- {{name: a, value: "10", unit: "{unit}"}}\n'
    with pytest.raises(HilError, match="say in which unit"):
        _ = load(f"schema: hil/parameters/1\nparameters:\n{entry}").a


def test_rows_serve_the_report(load):
    """Name, value, unit, explanation and deviation, in the order of the file."""
    row = load().override("rest_duration", "60").rows()[0]
    assert (row.name, row.shown, row.unit, row.text) == ("rest_duration", "60 s", "s", "How long a rest takes.")
    assert row.deviation == "parameter rest_duration is 60 s instead of 14400 s"


def test_a_plan_may_have_no_parameters(tmp_path):
    """A missing file is no parameters."""
    assert load_parameters(tmp_path, tmp_path).rows() == ()
    assert Parameters().digest == Parameters().digest


def test_two_names_that_cannot_be_read_are_not_one(load):
    """Each is told as it is; that both are blank is nobody's mistake."""
    with pytest.raises(ConfigurationError) as error:
        load("schema: hil/parameters/1\nparameters:\n- {name: A b, value: b}\n- {name: B c, value: c}\n")
    assert len(error.value.findings) == 2
    assert "duplicate" not in str(error.value)


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ('{name: a, value: "x", unit: s}', "'value' must be a decimal number in quotes"),
        ("{name: a, value: 5, unit: s}", "'value' must be text, found `5`, write it in quotes: \"5\""),
        ("{name: a, value: 5}", "'value' must be text"),
        ('{name: a, value: "5", unit: furlong}', "'furlong' is not a known unit"),
        ('{name: a, values: ["1", x], unit: s}', "'values' with a unit must be decimal numbers in quotes"),
        ("{name: a, unit: s}", "parameter 'a' needs either value or values"),
        ("{name: a, value: b, values: [c]}", "parameter 'a' needs either value or values"),
        ("{name: digest, value: b}", "'digest' cannot be the name of a parameter"),
        ("{name: lambda, value: b}", "'lambda' cannot be the name of a parameter"),
        ("{name: A b, value: b}", "'name' must be lower-case letters, digits"),
        ("{name: a, value: b}\n- {name: a, value: c}", "duplicate parameter 'a'"),
        ("{name: a, value: b, nuit: s}", "unknown key 'nuit', did you mean 'unit'?"),
    ],
)
def test_wrong_parameters_are_errors_at_load(load, entry, expected):
    """With file, line and column."""
    with pytest.raises(ConfigurationError) as error:
        load(f"schema: hil/parameters/1\nparameters:\n- {entry}\n")
    assert expected in str(error.value)
    assert str(error.value).startswith("testplans/gyro/parameters.yaml:")


def test_a_parameter_as_a_figure_is_named_and_measures_nothing(load):
    """Value and uncertainty in the parameter's own unit; what is computed of them names both."""
    entries = '- {name: shunt, value: "100", unit: mohm}\n- {name: shunt_u, value: "0.001", unit: ohm}\n'
    parameters = load(_TEXT + entries)
    figure = parameters.figure("shunt", uncertainty="shunt_u")
    assert (figure.value, figure.unit, figure.uncertainty) == (100.0, "mohm", pytest.approx(1.0))
    assert (figure * 2).provenance.sources == ("parameter shunt", "parameter shunt_u")
    assert (figure.provenance.measured, figure.provenance.unproven) == (False, ())
    assert parameters.figure("shunt").uncertainty is None
    with pytest.raises(HilError, match="a list is not one number"):
        parameters.figure("temperatures")
    with pytest.raises(HilError, match="did you mean 'shunt'"):
        parameters.figure("shunk")
