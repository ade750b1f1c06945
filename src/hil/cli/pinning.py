"""Start the process anew where its environment would change the last digits of numbers."""

from __future__ import annotations

import os
import sys

__all__ = ["pin"]


def pin() -> None:
    """Replace this process by itself with the pinned environment, unless it has it.

    Modules that happen to lie in the present folder do not take part, as they do not for the `hil` script.
    """
    from hil.executive.setup.pins import PINNED, pinned_environment  # noqa: PLC0415 - only when cases run

    if any(os.environ.get(name) != value for name, value in PINNED.items()):
        sys.stdout.flush()
        os.execve(sys.executable, [sys.executable, "-P", "-m", "hil.cli", *sys.argv[1:]], pinned_environment())  # noqa: S606
