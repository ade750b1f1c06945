"""Numbers that options take: what is no finite number, or out of all bounds, is refused before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from hil.cli.main import cli
from hil.model.errors import Refused

DATA = Path(__file__).parents[3] / "docs" / "data"
_PHOTODIODE = (
    *("analyse", "photodiode", str(DATA / "photodiode-simulated.csv"), "--reading", "photodiode", "--unit", "LSB"),
    *("--temperature", "temperature", "--load-column", "load", "--light", "monitor", "--reference", "3.3"),
)
_SOLAR = (
    *("analyse", "solar", str(DATA / "solar-panel-simulated.csv"), "--voltage", "1", "--voltage-unit", "V"),
    *("--current", "2", "--current-unit", "A"),
)
_MAGNETOMETER = (
    *("analyse", "magnetometer", str(DATA / "magnetometer-simulated.csv"), "--columns", "x,y,z", "--unit", "uT"),
    *("--field-column", "field"),
)

REFUSED_IN_A_SENTENCE = {
    "analyse allan": {"--rate", "--scale", "--from", "--to", "--lsb", "--full-scale", "--bandwidth", "--noise-density"}
    | {"--tau-min", "--tau-max", "--confidence"},
    "analyse battery": {"--interval", "--upper", "--lower", "--cut-off", "--current-gain", "--current-offset"}
    | {"--capacity", "--energy", "--rest-current", "--remaining"},
    "analyse psd": {"--overlap", "--confidence"},
}
"""Options whose command says itself what is possible; those of a log are of all commands that take one."""


def commands(group: click.Group, name: str = "") -> Iterator[tuple[str, click.Command]]:
    """Give every command with its name."""
    context = click.Context(group)
    for word in group.list_commands(context):
        found = group.get_command(context, word)
        assert found is not None
        if isinstance(found, click.Group):
            yield from commands(found, f"{name}{word} ")
        else:
            yield f"{name}{word}", found


def numbers() -> Iterator[tuple[str, str, click.ParamType]]:
    """Give the options that take a number with a fraction: of which command, the option, and its type."""
    for name, command in commands(cli):
        for option in command.params:
            told = REFUSED_IN_A_SENTENCE.get(name, set()) | REFUSED_IN_A_SENTENCE["analyse allan"]
            if isinstance(option.type, click.types.FloatParamType) and option.opts[0] not in told:
                yield name, option.opts[0], option.type


def test_there_are_such_options():
    """Those of the analyses and of commands that wait."""
    found = {(name, option) for name, option, _ in numbers()}
    assert {("analyse photodiode", "--series"), ("run", "--acknowledge-within"), ("simulate", "--speed")} <= found
    assert len(found) > 25


@pytest.mark.parametrize("text", ["nan", "NaN", "inf", "-inf", "1e999"])
@pytest.mark.parametrize(
    "kind", {(name, option): kind for name, option, kind in numbers()}.items(), ids=lambda it: it[0]
)
def test_no_option_takes_what_is_not_finite(kind, text):
    """Comparisons with NaN are false, so that it passes every range that only compares."""
    with pytest.raises(click.BadParameter):
        kind[1].convert(text, None, None)
    assert math.isfinite(kind[1].convert("0.5", None, None))


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((*_PHOTODIODE, "--full-scale", "0"), "'--full-scale': 0.0 is not in the range"),
        ((*_PHOTODIODE, "--series", "-20"), "'--series': -20.0 is not in the range"),
        ((*_PHOTODIODE, "--nominal", "-300"), "'--nominal': -300.0 is not in the range"),
        ((*_PHOTODIODE, "--reference-uncertainty", "-1"), "'--reference-uncertainty': -1.0 is not in the range"),
        ((*_SOLAR, "--nominal-voltage", "-2.7"), "'--nominal-voltage': -2.7 is not in the range"),
        ((*_SOLAR, "--to", "-1000", "25"), "'--to': -1000.0 is not in the range"),
        ((*_SOLAR, "--to", "1000", "-300"), "'--to': -300.0 is not in the range"),
        ((*_MAGNETOMETER, "--noise", "0"), "'--noise': 0.0 is not in the range"),
    ],
)
def test_what_cannot_be_is_refused(arguments, told):
    """Some were tracebacks, others were taken."""
    with pytest.raises(click.BadParameter) as refused:
        CliRunner().invoke(cli, arguments, standalone_mode=False, catch_exceptions=False)
    assert told.strip("'") in f"{refused.value.param.opts[0] if refused.value.param else ''}': {refused.value.message}"


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((*_SOLAR, "--alpha", "0.0006"), "--alpha corrects the curve, but the target conditions are missing"),
        ((*_MAGNETOMETER, "--scale", "0", "--scaled-unit", "uT"), "--scale 0 is not possible"),
    ],
)
def test_what_would_be_overlooked_is_refused(arguments, told):
    """A coefficient without a correction, and a factor of zero, which was taken for none."""
    with pytest.raises(Refused, match=told):
        CliRunner().invoke(cli, arguments, standalone_mode=False, catch_exceptions=False)


def test_a_factor_below_zero_turns_no_limit_around():
    """A full scale of 100 LSB is 100 in either direction."""
    result = CliRunner().invoke(
        cli,
        (*_MAGNETOMETER, "--scale", "-1", "--scaled-unit", "uT", "--full-scale", "1000"),
        standalone_mode=False,
        catch_exceptions=False,
    )
    assert result.return_value == 0, result.output
