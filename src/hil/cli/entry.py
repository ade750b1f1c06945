"""Start-up of `hil`: until it can print a message, Ctrl-C ends it silently."""

from __future__ import annotations

import signal
import sys

__all__ = ["main"]

_CALLS = 500
"""How many nested calls hil may need; Python allows 1000."""
_USAGE = 4


def main() -> None:
    """Load the command line and run it; see `hil.cli.main`."""
    if sys.getrecursionlimit() < _CALLS:
        sys.stderr.write(
            f"hil: this Python allows only {sys.getrecursionlimit()} nested calls, and hil may need {_CALLS}\n"
            "     something lowered the limit before hil began: look for setrecursionlimit in sitecustomize.py\n"
        )
        sys.exit(_USAGE)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # imports take a while, and their traceback is of no use
    from hil.cli.main import main as run  # noqa: PLC0415 - after the line above

    run()
