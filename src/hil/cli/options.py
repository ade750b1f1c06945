"""Options that several commands share: where a served bench is, who attends a run, how it deviates from its plan."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from hil.documents.text import require_name
from hil.model.errors import Refused

__all__ = [
    "ABOVE_ZERO",
    "ACKNOWLEDGE_WITHIN",
    "ANSWERS",
    "CONFIDENCE",
    "DEGC",
    "FINITE",
    "JSON",
    "SERVED",
    "ZERO_OR_MORE",
    "Within",
    "attendance_of",
    "attendance_options",
    "deviation_options",
    "name_option",
    "only_of",
    "overrides_of",
    "plot_option",
    "skips_of",
    "unit_option",
]

_Command = TypeVar("_Command", bound=Callable[..., Any])


class _Finite(click.types.FloatParamType):
    """A finite number."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:  # noqa: ANN401
        """Return the number; comparisons with NaN are false, so click's own ranges let it pass."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{number} is not a finite number.", param, ctx)
        return number


class Within(click.FloatRange, _Finite):
    """A finite number within a range, as of `click.FloatRange`."""


FINITE = _Finite()
"""The type of an option that takes a finite number."""
ABOVE_ZERO = Within(min=0.0, min_open=True)
"""Likewise, for a number above zero."""
ZERO_OR_MORE = Within(min=0.0)
"""Likewise, for zero or a number above it."""
DEGC = Within(min=-273.15, min_open=True)
"""Likewise, for a temperature in degC."""

SERVED = click.option(
    "--served",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="The folder in which hil simulate serves the bench.",
)
ANSWERS = click.option(
    "--answers",
    type=click.Path(path_type=Path, exists=True, dir_okay=False),
    help="File with answers to the plan's questions.",
)
CONFIDENCE = click.option(
    "--confidence",
    type=float,
    default=0.68,
    show_default=True,
    metavar="LEVEL",
    help="Confidence level of the intervals.",
)
JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON document and nothing else.")
ACKNOWLEDGE_WITHIN = click.option(
    "--acknowledge-within",
    type=Within(min=0, min_open=True, max=24 * 60),
    default=10.0,
    metavar="MINUTES",
    help="Time for the person on call to acknowledge the first notification; 10 by default.",
)


def name_option(flag: str, *, help: str) -> Callable[[_Command], _Command]:  # noqa: A002 - click's word
    """Return an option that takes the name of a person; empty by default."""
    return click.option(flag, default="", metavar="NAME", help=help, callback=_named)


def _named(context: click.Context, option: click.Parameter, value: str) -> str:
    if context.get_parameter_source(str(option.name)) is not click.core.ParameterSource.DEFAULT:
        require_name(option.opts[0], value)
    return value


def unit_option(flag: str, *, help: str, required: bool = False) -> Callable[[_Command], _Command]:  # noqa: A002 - as above
    """Return an option that takes a known unit."""
    return click.option(flag, required=required, metavar="UNIT", help=help, callback=_known_unit)


def _known_unit(context: click.Context, option: click.Parameter, value: str | None) -> str | None:
    from hil.requirements.units import check_unit  # noqa: PLC0415 - slow to import

    del context
    if value is not None and (problem := check_unit(value)):
        raise Refused(f"{option.opts[0]}: {problem}", "LSB, count or 1 for numbers as the device gives them")
    return value


def plot_option(drawn: str) -> Callable[[_Command], _Command]:
    """Return an option that takes the file into which something is drawn; `drawn` is an object, as in "the fits"."""
    return click.option("--plot", type=click.Path(path_type=Path), metavar="FILE", help=f"Plot {drawn}: .svg or .png.")


def attendance_options(command: _Command) -> _Command:
    """Give a command `--unattended`, `--on-call` and `--acknowledge-within`, the last in min."""
    options = (
        click.option(
            "--unattended", is_flag=True, help="Run without an operator in attendance; the bench must allow it."
        ),
        name_option("--on-call", help="Whom to call if something happens during an unattended run."),
        ACKNOWLEDGE_WITHIN,
    )
    for option in reversed(options):
        command = option(command)
    return command


def attendance_of(options: Mapping[str, Any], *, left_alone: bool) -> dict[str, Any]:
    """Return the attendance settings of a request.

    Args:
        options: those of `attendance_options`.
        left_alone: whether the run is detached from its terminal on a bench outside of its process.
    """
    return {
        "unattended": options["unattended"] or left_alone,
        "on_call": options["on_call"],
        "acknowledge_within_s": 60 * options["acknowledge_within"],
    }


def deviation_options(command: _Command) -> _Command:
    """Give a command `--only`, `--skip`, `--reason` and `--parameter`: `only`, `skips`, `reasons`, `overrides`."""
    options = (
        click.option("--only", multiple=True, metavar="CASE", help="Run only this case; the run then deviates."),
        click.option("--skip", "skips", multiple=True, metavar="CASE", help="Skip this case; needs a --reason."),
        click.option("--reason", "reasons", multiple=True, metavar="TEXT", help="Why the case is skipped."),
        click.option(
            "--parameter",
            "overrides",
            multiple=True,
            metavar="NAME=VALUE",
            help="Change a parameter; the run then deviates from its plan.",
        ),
    )
    for option in reversed(options):
        command = option(command)
    return command


def only_of(cases: Sequence[str]) -> tuple[str, ...]:
    """Return the cases of `--only`, sorted.

    Raises:
        Refused: if a name is empty, or a case is named twice.
    """
    if not all(case.strip() for case in cases):
        raise Refused("--only is empty", "name the case as hil plan shows it")
    if twice := [case for case in cases if cases.count(case) > 1]:
        raise Refused(f"--only {twice[0]} is given {cases.count(twice[0])} times", "name every case once")
    return tuple(sorted(cases))


def skips_of(cases: Sequence[str], reasons: Sequence[str]) -> dict[str, str]:
    """Return the reason for each skipped case.

    Raises:
        Refused: if a case has no reason, a name is empty, or a case is named twice.
    """
    if len(cases) != len(reasons):
        raise Refused(
            f"{len(cases)} --skip and {len(reasons)} --reason were given", "give each --skip its own --reason"
        )
    for case, reason in zip(cases, reasons, strict=True):
        if not case.strip() or not reason.strip():
            raise Refused(
                f"--skip '{case}' --reason '{reason}': one of them is empty", "name the case, and say why it is skipped"
            )
        if cases.count(case) > 1:
            raise Refused(f"--skip {case} is given {cases.count(case)} times", "give every skipped case one reason")
    return dict(zip(cases, reasons, strict=True))


def overrides_of(pairs: Sequence[str]) -> dict[str, str]:
    """Return the new value of each changed parameter.

    Raises:
        Refused: if a value is missing, or a parameter is named twice.
    """
    found = [_pair(text) for text in pairs]
    names = [name for name, _ in found]
    for name in names:
        if names.count(name) > 1:
            raise Refused(f"--parameter {name} is given {names.count(name)} times", "give every parameter one value")
    return dict(found)


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise Refused(f"--parameter {text} has no value", "write --parameter NAME=VALUE")
    return name, value
