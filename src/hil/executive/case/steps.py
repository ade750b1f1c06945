"""Steps: named parts of a case that make the as-run procedure."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

__all__ = ["Steps"]


class Steps:
    """Numbers nested steps and writes their beginning and end.

    Args:
        case: the case's id.
        write: writes an event.
        now: bench time in seconds.
    """

    def __init__(self, case: str, write: Callable[..., None], now: Callable[[], float]) -> None:
        self.case = case
        self._write = write
        self._now = now
        self._titles: list[str] = []
        self._counts = [0]

    @property
    def number(self) -> str:
        """The number of the present step, such as `1.2`; empty outside steps."""
        return ".".join(str(count) for count in self._counts[: len(self._titles)])

    @contextmanager
    def __call__(self, title: str) -> Iterator[None]:
        """Be in a step; steps nest."""
        depth = len(self._titles)
        del self._counts[depth + 1 :]
        self._counts[depth] += 1
        self._titles.append(title)
        self._counts.append(0)
        facts = {"case": self.case, "path": list(self._titles), "number": self.number}
        began = self._now()
        self._write("step", **facts)
        outcome = "raised"
        try:
            yield
            outcome = "done"
        finally:
            self._write("step-end", **facts, outcome=outcome, duration=round(self._now() - began, 9))
            self._titles.pop()
