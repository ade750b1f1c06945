"""Tables on a terminal: columns that line up, in lines that are as long as what they say."""

from __future__ import annotations

import io
from collections.abc import Container, Iterable, Sequence

__all__ = ["aligned", "labelled"]

_ANY_WIDTH = 1_000_000
"""A terminal breaks a line that is too long; data in a file or a pipe is never broken."""


def aligned(
    rows: Iterable[Sequence[str]], *, head: Sequence[str] = (), right: Container[int] = (), indent: str = ""
) -> list[str]:
    """Return rows as lines whose columns line up, two spaces apart.

    Args:
        rows: their cells, as many in each.
        head: the columns' names, in a line of their own; none where it is empty.
        right: the places of columns that end at their right edge, such as numbers.
        indent: what stands before each line.
    """
    from rich.console import Console  # noqa: PLC0415 - slow to import
    from rich.table import Table  # noqa: PLC0415 - slow to import
    from rich.text import Text  # noqa: PLC0415 - slow to import

    cells = [*([head] if head else []), *rows]
    if not cells:
        return []
    grid = Table.grid(padding=(0, 2, 0, 0))
    for place in range(len(cells[0])):
        grid.add_column(justify="right" if place in right else "left", no_wrap=True)
    for row in cells:
        grid.add_row(*map(Text, row))
    written = io.StringIO()
    Console(file=written, width=_ANY_WIDTH, color_system=None, legacy_windows=False).print(grid)
    return [f"{indent}{line}".rstrip() for line in written.getvalue().splitlines()]


def labelled(facts: Iterable[tuple[str, str]], *, indent: str = "") -> list[str]:
    """Return a line for each fact that is known, its label first."""
    return aligned([fact for fact in facts if fact[1]], indent=indent)
