"""Integrity of the product: whether the workspace's code has replaced anything in it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from operator import is_not
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import NamedTuple

from hil.executive.setup import auditing
from hil.model.errors import HilError

__all__ = ["Intact", "Replaced"]

_ROOMS = frozenset(
    {"analysis", "bench", "clock", "evidence", "executive", "instruments", "model", "requirements", "wire"}
)
"""The packages that measure, judge and record."""

_CONSTANTS = (bool, float, frozenset, int, str, tuple)
_CALLED = (BuiltinFunctionType, FunctionType, classmethod, property, staticmethod, type)
_PASSING = frozenset({"__abstractmethods__", "__doc__", "__module__"})


class Replaced(HilError):
    """Code of the workspace has replaced a part of the product."""


class _Owner(NamedTuple):
    """A module or class: its dotted name, its names as they are now, what they referred to, and since when."""

    named: str
    now: Mapping[str, object]
    then: Mapping[str, object]
    since: int


class Intact:
    """Finds what was replaced in the product since this was created; modules loaded later count from then on.

    What is put back before a check is not noticed. What the source shows of it is reported anyway, see
    `hil.executive.setup.reach`.

    Args:
        is_own: whether code belongs to the workspace, by the path that it was compiled with.
    """

    def __init__(self, is_own: Callable[[str], bool]) -> None:
        self._is_own = is_own
        self._modules: dict[str, ModuleType] = {}
        self._owners: list[_Owner] = []
        self._take_in()

    def replaced(self) -> Iterator[Replaced]:
        """Yield an error for every name of the product that refers to something else than before."""
        hint = "measure and judge with what the case is given"
        names = [name for name, module in self._modules.items() if sys.modules.get(name) is not module]
        recoded = {since: _recoded(since) for since in {owner.since for owner in self._owners}}
        names += [f"{owner.named}.{name}" for owner in self._owners for name in _changed(owner, recoded[owner.since])]
        known = len(self._owners)
        self._take_in()
        late = self._owners[known:]
        names += [f"{owner.named}.{name}" for owner in late for name in owner.then if self._is_foreign(owner, name)]
        for name in dict.fromkeys(names):
            yield Replaced(f"code of the workspace replaced {name}, which is a part of hil", hint)

    def _is_foreign(self, owner: _Owner, name: str) -> bool:
        value = owner.then[name]
        return type(value) is FunctionType and self._is_own(value.__code__.co_filename)

    def _take_in(self) -> None:
        """Add the modules that were loaded since."""
        for name, module in list(sys.modules.items()):
            if name not in self._modules and name.startswith("hil.") and name.split(".", 2)[1] in _ROOMS:
                self._modules[name] = module
                self._owners += _owners_in(module)


def _owners_in(module: ModuleType) -> Iterator[_Owner]:
    named = module.__name__
    yield _owner(named, vars(module))
    for value in list(vars(module).values()):
        if isinstance(value, type) and value.__module__ == named:
            yield _owner(f"{named}.{value.__qualname__}", vars(value))


def _owner(named: str, now: Mapping[str, object]) -> _Owner:
    then = {
        name: value
        for name, value in list(now.items())
        if name not in _PASSING and (isinstance(value, _CALLED) or (name.isupper() and isinstance(value, _CONSTANTS)))
    }
    return _Owner(named, now, then, auditing.begin())


def _changed(owner: _Owner, recoded: frozenset[FunctionType]) -> list[str]:
    now, then = owner.now, owner.then
    if not recoded and not any(map(is_not, map(now.get, then), then.values())):
        return []  # nearly always; called some hundred times after every phase of a case
    return [
        name
        for name, value in then.items()
        if now.get(name) is not value or (type(value) is FunctionType and value in recoded)
    ]


def _recoded(since: int) -> frozenset[FunctionType]:
    """Return the functions whose code or defaults have changed."""
    first: dict[FunctionType, tuple[object, object]] = {}
    for function, before in auditing.recoded(since):
        first.setdefault(function, before)
    return frozenset(each for each, before in first.items() if (each.__code__, each.__defaults__) != before)
