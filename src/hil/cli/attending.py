"""The options of a run that nobody attends."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import click

__all__ = ["ACKNOWLEDGE_WITHIN", "attendance_of", "attendance_options"]

_Command = TypeVar("_Command", bound=Callable[..., Any])

ACKNOWLEDGE_WITHIN = click.option(
    "--acknowledge-within",
    type=click.FloatRange(min=0, min_open=True, max=24 * 60),
    default=10.0,
    metavar="MINUTES",
    help="How long that person may take to answer the first notification; 10 by default.",
)


def attendance_options(command: _Command) -> _Command:
    """Give a command `--unattended`, `--on-call` and `--acknowledge-within`, the last in min."""
    options = (
        click.option("--unattended", is_flag=True, help="Nobody stays with it; the bench has to be fit for that."),
        click.option("--on-call", default="", metavar="NAME", help="Who comes if something happens then."),
        ACKNOWLEDGE_WITHIN,
    )
    for option in reversed(options):
        command = option(command)
    return command


def attendance_of(options: Mapping[str, Any], *, left_alone: bool) -> dict[str, Any]:
    """Return what a request says of its attendance.

    Args:
        options: those of `attendance_options`.
        left_alone: whether the run is detached from its terminal on a bench outside of its process.
    """
    return {
        "unattended": options["unattended"] or left_alone,
        "on_call": options["on_call"],
        "acknowledge_within_s": 60 * options["acknowledge_within"],
    }
