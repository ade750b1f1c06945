"""The first moments of `hil`: Ctrl-C ends it without a word until it can say one."""

from __future__ import annotations

import signal

__all__ = ["main"]


def main() -> None:
    """Load the command line and run it; see `hil.cli.main`."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # imports take a while, and a traceback of theirs helps nobody
    from hil.cli.main import main as run  # noqa: PLC0415 - after the line above

    run()
