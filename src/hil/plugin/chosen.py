"""Cases and files that are named on pytest's command line, in place of the whole plans that they belong to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

__all__ = ["Chosen"]


class Chosen:
    """Lets whole plans be collected, so that they are planned, and takes out what nobody named.

    Args:
        arguments: folders, files and cases, as pytest was given them.
        plans: the folders of the run's plans.

    Attributes:
        single: whether anything but folders was named.
        whole: what to collect: the plans of named files and cases, and everything else as it was named.
    """

    def __init__(self, arguments: Sequence[str], plans: Sequence[Path]) -> None:
        self._arguments = tuple(arguments)
        whole = (_plan_of(argument, plans) for argument in self._arguments)
        self.whole = list(dict.fromkeys(whole))
        self.single = any(not Path(argument).is_dir() for argument in self._arguments)

    def pytest_collection_modifyitems(
        self, session: pytest.Session, config: pytest.Config, items: list[pytest.Item]
    ) -> None:
        """Deselect every case that nobody named.

        Raises:
            pytest.UsageError: for a name that no case has.
        """
        if session.testsfailed:  # what could not be collected is told by pytest
            return
        for argument in self._arguments:
            if not any(_is_meant(item, argument) for item in items):
                raise pytest.UsageError(f"there is no case {argument}")
        named = [item for item in items if any(_is_meant(item, argument) for argument in self._arguments)]
        others = [item for item in items if item not in named]
        if others:
            config.hook.pytest_deselected(items=others)
            items[:] = named


def _plan_of(argument: str, plans: Sequence[Path]) -> str:
    path = Path(argument.partition("::")[0]).resolve()
    return str(path.parent) if path.parent in plans and not path.is_dir() else argument


def _is_meant(item: pytest.Item, argument: str) -> bool:
    place, _, name = argument.partition("::")
    path, own = Path(place).resolve(), item.nodeid.partition("::")[2]
    return item.path.is_relative_to(path) and (not name or own == name or own.startswith((f"{name}::", f"{name}[")))
