"""The command line: one module per command, loaded on demand."""

from __future__ import annotations

import errno
import gc
import importlib
import signal
import sys
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import cast

import click

from hil.cli.display import Unwritten, displays, open_standard_streams, shown_safely
from hil.cli.supervision import Invocation, Word
from hil.documents.suggest import did_you_mean
from hil.model.errors import ConfigurationError, HilError

__all__ = ["COMMANDS", "cli", "main"]

COMMANDS: Mapping[str, str] = {
    "ack": "Acknowledge what the guardian did to a bench.",
    "analyse": "Characterise an existing log, or check a published table.",
    "answer": "Answer a question that a run has asked.",
    "approve": "Approve a package in a role, with an SSH key.",
    "attach": "Attach a file to a run in progress.",
    "audit": "Compute the status of every requirement.",
    "bench": "Check a bench, make it safe, or set up its computer.",
    "doctor": "Check that this computer is ready for its benches.",
    "export": "Export the recordings of a package as CSV or MATLAB files.",
    "hold": "Hold a run in progress, or release it.",
    "init": "Create a workspace that runs as it is.",
    "ledger": "Check the package ledger, and print its head.",
    "note": "Add a note to a run in progress.",
    "plan": "Print the procedure of plans, and how long they take.",
    "replay": "Rerun the cases of a package on its recorded bytes.",
    "report": "Regenerate the report of a package, and compare it.",
    "requirements": "Lock requirements, or show changes since the lock.",
    "resume": "Resume a run that was interrupted.",
    "run": "Run plans on a bench and seal the evidence.",
    "runs": "List the runs of the workspace.",
    "seal": "Seal an interrupted run as it is.",
    "select": "Select the best of several sensors from their packages.",
    "sign": "Sign a package with an SSH key.",
    "simulate": "Serve a simulated bench to other programs.",
    "status": "Show the status of a run.",
    "stop": "Stop a run and leave the bench safe.",
    "trend": "Compare the checks of one parameter across all runs.",
    "verify": "Verify packages.",
}
"""Every command with its help line, so that `hil --help` loads none of them."""

_USAGE = 4
_INTERRUPTED = 130
_INTERNAL = 3
_UNTOLD = 141
_LONGEST_NAME = 200


class Commands(click.Group):
    """Commands by name; each is the object `command` of the module of its name."""

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 - click's signature
        """Return the names, sorted."""
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:  # noqa: ARG002 - click's signature
        """Load one command."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"hil.cli.commands.{cmd_name}")
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


@click.command(cls=Commands, context_settings={"help_option_names": ["-h", "--help"], "color": True})
@click.version_option(package_name="hil")
def cli() -> None:
    """Hardware-in-the-loop test executive for CubeSat sensors and power parts."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit with its code; errors that a person can correct are sentences and exit code 4."""
    open_standard_streams()
    word = Word.given()
    given = tuple(sys.argv[1:] if arguments is None else arguments)
    if word is None:
        with shown_safely() as edge:
            code = _code(Invocation(given, None, alone=arguments is None))
            if error := edge.finish():
                untold = _of_output(error)
                code = untold if code in {0, _UNTOLD} else code  # the state of a bench outweighs a lost reader
        sys.exit(code)
    gc.disable()  # a run loads hardly any garbage; it enables this once the bench is up
    with displays():
        code = _code(Invocation(given, word))
    word.leave(code)


def _code(invocation: Invocation) -> int:
    """Run a command and return its exit code, whatever it raises."""
    code = _INTERNAL
    silent = signal.getsignal(signal.SIGINT) is signal.SIG_DFL  # see hil.cli.entry
    try:
        if silent:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = cli.main(args=invocation.arguments, prog_name="hil", standalone_mode=False, obj=invocation) or 0
    except ConfigurationError as error:
        count = len(error.findings)
        _say(str(error), f"{count} error{'' if count == 1 else 's'}")
        code = _USAGE
    except HilError as error:
        _say(f"hil: {error.message}", *([f"     {error.hint}"] if error.hint else []))
        code = _USAGE
    except click.ClickException as error:
        with suppress(OSError, ValueError):
            error.show()
        code = _USAGE
    except (click.Abort, KeyboardInterrupt):
        code = _INTERRUPTED
    except MemoryError:
        _say("hil: out of memory", "     nothing that was recorded is lost; hil runs lists the runs")
    except Unwritten:
        code = _UNTOLD
    except Exception as error:  # noqa: BLE001 - a bug of ours: whoever fixes it needs the traceback
        code = _of_file(error) if isinstance(error, OSError) and error.filename is not None else _internal()
    finally:
        over = signal.getsignal(signal.SIGINT) is signal.SIG_IGN  # see `supervise`
        if silent and not over and invocation.word is None:  # all is said: Ctrl-C ends what is left without a traceback
            signal.signal(signal.SIGINT, signal.SIG_DFL)
    return code


def _of_file(error: OSError) -> int:
    """Name the file that could not be used."""
    name = str(error.filename)
    shown = name if len(name) <= _LONGEST_NAME else f"{name[:_LONGEST_NAME]}... ({len(name)} characters)"
    _say(f"hil: {shown}: {error.strerror}", "     check the path and its permissions")
    return _USAGE


def _of_output(error: OSError) -> int:
    """Return the exit code of a command whose output could not be written; a reader that has gone gets no message."""
    if error.errno == errno.EPIPE:
        return _UNTOLD
    _say(f"hil: standard output could not be written: {error.strerror}", "     free some space, or write elsewhere")
    return _USAGE


def _internal() -> int:
    _say(traceback.format_exc().rstrip(), "hil: this is a bug in hil; please report it with the lines above")
    return _INTERNAL


def _say(*lines: str) -> None:
    """Write to standard error if possible; the exit code does not depend on it."""
    with suppress(OSError, ValueError):
        for line in lines:
            click.echo(line, err=True, color=True)  # nothing is stripped: it would be lost
