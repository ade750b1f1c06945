"""The command line: one module per command, loaded when it is asked for."""

from __future__ import annotations

import importlib
import sys
import traceback
from collections.abc import Mapping, Sequence
from typing import cast

import click

from hil.documents.suggest import did_you_mean
from hil.model.errors import ConfigurationError, HilError

__all__ = ["COMMANDS", "cli", "main"]

COMMANDS: Mapping[str, str] = {
    "analyse": "Characterise an existing log.",
    "attach": "Attach a file to a run that is going on.",
    "bench": "Check a bench, or make it safe.",
    "note": "Write a note into a run that is going on.",
    "plan": "Print the procedure of plans: what they do, drive and take.",
    "replay": "Run the cases of a package again on its recorded bytes.",
    "report": "Derive the report of a package again.",
    "requirements": "Lock requirements, and compare them with their lock.",
    "run": "Run plans on a bench and seal the evidence.",
    "runs": "List the runs of the workspace.",
    "seal": "Seal an interrupted run as it is.",
    "status": "Say how a run stands.",
    "stop": "Ask a run to stop and leave the bench safe.",
    "verify": "Verify a package.",
}
"""Every command with its help line, so that `hil --help` loads none of them."""

_USAGE = 4
_INTERRUPTED = 130
_INTERNAL = 3


class Commands(click.Group):
    """Commands by name; each is the object `command` of the module of its name."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """Return the names, sorted."""
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        """Load one command."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"hil.cli.{cmd_name}")
        return cast("click.Command", module.command)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command, or name the nearest one."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            ctx.fail(f"there is no command '{name}'{did_you_mean(name, COMMANDS)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:  # noqa: ARG002 - click's
        """Write the help lines without loading the commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name]) for name in sorted(COMMANDS)])


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="hil")
def cli() -> None:
    """Hardware-in-the-loop test executive for CubeSat sensors and power parts."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit with its code; errors that a person can mend are sentences and exit code 4."""
    try:
        code = cli.main(args=arguments, prog_name="hil", standalone_mode=False)
    except ConfigurationError as error:
        click.echo(str(error), err=True)
        count = len(error.findings)
        click.echo(f"{count} {'thing is' if count == 1 else 'things are'} to be mended", err=True)
        code = _USAGE
    except HilError as error:
        click.echo(f"hil: {error.message}", err=True)
        if error.hint:
            click.echo(f"     {error.hint}", err=True)
        code = _USAGE
    except click.ClickException as error:
        error.show()
        code = _USAGE
    except (click.Abort, KeyboardInterrupt):
        code = _INTERRUPTED
    except BrokenPipeError:
        sys.stderr.close()
        code = 141
    except Exception:  # noqa: BLE001 - an error of ours: whoever mends it needs the traceback
        traceback.print_exc()
        click.echo("hil: this is an error of hil itself; please report it with the lines above", err=True)
        code = _INTERNAL
    sys.exit(code)
