"""The terminal at which a person answers questions."""

from __future__ import annotations

import select
import sys

__all__ = ["Terminal"]

_PATIENCE_S = 0.1


class Terminal:
    """Standard input and standard error; a look for input never waits for long."""

    def show(self, text: str) -> None:
        """Show a line where standard output stays clean."""
        sys.stderr.write(f"  ? {text} ")
        sys.stderr.flush()

    def line(self) -> str | None:
        """Return a line if one was entered, None otherwise; the end of input counts as an empty line."""
        ready, _, _ = select.select([sys.stdin], [], [], _PATIENCE_S)
        return sys.stdin.readline() if ready else None
