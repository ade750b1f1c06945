"""Copies of this process that a case forks: they may live on, and hold nothing of the bench or of the run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress

__all__ = ["kept_from_copies"]

Descriptors = Callable[[], Iterable[int]]
"""Gives what belongs to this process alone."""

_kept: list[Descriptors] = []


@contextmanager
def kept_from_copies(descriptors: Descriptors) -> Iterator[None]:
    """Let every copy of this process let go of descriptors at once, until the context is left.

    What is started by executing a program has none of them anyway: all are closed on exec.

    Args:
        descriptors: gives them, at the moment of a fork.
    """
    _kept.append(descriptors)
    try:
        yield
    finally:
        _kept.remove(descriptors)


def _let_go() -> None:
    """Put nothing in their place: their numbers stay taken, so that no object of the copy closes another file."""
    with suppress(OSError):
        nothing = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
        for descriptors in _kept:
            for each in descriptors():
                os.dup2(nothing, each, inheritable=False)
        os.close(nothing)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)
