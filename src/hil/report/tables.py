"""Tables on a terminal: aligned columns, in lines no longer than their content."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

__all__ = ["aligned", "labelled"]


def aligned(
    rows: Iterable[Sequence[str]], *, head: Sequence[str] = (), right: Container[int] = (), indent: str = ""
) -> list[str]:
    """Return rows as lines whose columns line up, two spaces apart.

    Args:
        rows: their cells, as many in each.
        head: the columns' names, in a line of their own; none where it is empty.
        right: the places of columns that end at their right edge, such as numbers.
        indent: the prefix of each line.
    """
    from rich.cells import cell_len  # noqa: PLC0415 - slow to import

    cells = [tuple(row) for row in (*([head] if head else []), *rows)]
    places = range(max(map(len, cells), default=0))
    widths = [max(cell_len(row[place]) for row in cells) for place in places]

    def padded(place: int, cell: str) -> str:
        gap = " " * (widths[place] - cell_len(cell))
        return gap + cell if place in right else cell + gap

    return [f"{indent}{'  '.join(map(padded, places, row))}".rstrip() for row in cells]


def labelled(facts: Iterable[tuple[str, str]], *, indent: str = "") -> list[str]:
    """Return a line for each known fact, its label first."""
    return aligned([fact for fact in facts if fact[1]], indent=indent)
