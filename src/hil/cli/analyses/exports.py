"""Where an analysis writes the calibration that it found: as JSON, and as a C header."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from hil.cli.written import write_whole_file
from hil.model.errors import Refused

__all__ = ["export_options", "write_exports"]

_Command = TypeVar("_Command", bound=Callable[..., Any])


def export_options(command: _Command) -> _Command:
    """Give a command `--export` and `--c-header`, the paths of the files; None where one is not wanted."""
    c_header = click.option(
        "--c-header", type=click.Path(path_type=Path), metavar="FILE", help="Write the calibration as a C header."
    )
    export = click.option(
        "--export", type=click.Path(path_type=Path), metavar="FILE", help="Write the calibration as JSON."
    )
    return export(c_header(command))


def write_exports(*wanted: tuple[Path | None, str]) -> None:
    """Write texts to the files that are wanted.

    Raises:
        Refused: a file cannot be written.
    """
    for path, text in wanted:
        if path is None:
            continue
        try:
            write_whole_file(path, text.encode())
        except OSError as error:
            raise Refused(f"{path}: {error.strerror}", "choose a place that can be written") from None
