"""`hil analyse`: characterise an existing log, or check a published table."""

from __future__ import annotations

import click

from hil.cli.analyses.allan import allan
from hil.cli.analyses.battery import battery
from hil.cli.analyses.drift import drift
from hil.cli.analyses.flight import flight
from hil.cli.analyses.gyroscope_temperature import gyroscope_temperature
from hil.cli.analyses.magnetometer import magnetometer
from hil.cli.analyses.photodiode import photodiode
from hil.cli.analyses.psd import psd
from hil.cli.analyses.solar import solar
from hil.cli.analyses.table import table

__all__ = ["command"]


@click.group("analyse")
def command() -> None:
    """Characterise an existing log, or check a published table.

    \b
    Example:
      hil analyse allan docs/data/gyroscope-xsens-rest.txt --time 1 --unit LSB --to 50
    """  # noqa: D301 - click reads \b


command.add_command(allan)
command.add_command(battery)
command.add_command(drift)
command.add_command(flight)
command.add_command(gyroscope_temperature)
command.add_command(magnetometer)
command.add_command(photodiode)
command.add_command(psd)
command.add_command(solar)
command.add_command(table)
