"""The options by which a run deviates from its plan: cases left out, and parameters changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import click

from hil.model.errors import Refused

__all__ = ["deviation_options", "overrides_of", "skips_of"]

_Command = TypeVar("_Command", bound=Callable[..., Any])


def deviation_options(command: _Command) -> _Command:
    """Give a command the options `--skip`, `--reason` and `--parameter`, as `skips`, `reasons` and `overrides`."""
    options = (
        click.option(
            "--skip", "skips", multiple=True, metavar="CASE", help="Leave a case out; give its --reason next."
        ),
        click.option("--reason", "reasons", multiple=True, metavar="TEXT", help="Why the case is left out."),
        click.option("--parameter", "overrides", multiple=True, metavar="NAME=VALUE", help="Change a parameter."),
    )
    for option in reversed(options):
        command = option(command)
    return command


def skips_of(cases: Sequence[str], reasons: Sequence[str]) -> dict[str, str]:
    """Return by case the reason why it is left out.

    Raises:
        Refused: where a case has no reason, nothing is named, or a case is named twice.
    """
    if len(cases) != len(reasons):
        raise Refused(f"{len(cases)} --skip and {len(reasons)} --reason were given", "every skipped case has a reason")
    for case, reason in zip(cases, reasons, strict=True):
        if not case.strip() or not reason.strip():
            raise Refused(
                f"--skip '{case}' --reason '{reason}' says nothing", "name the case, and say why it is skipped"
            )
        if cases.count(case) > 1:
            raise Refused(f"--skip {case} is given {cases.count(case)} times", "give every skipped case one reason")
    return dict(zip(cases, reasons, strict=True))


def overrides_of(pairs: Sequence[str]) -> dict[str, str]:
    """Return by parameter the value that it is changed to.

    Raises:
        Refused: where there is no value, or a parameter is named twice.
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
