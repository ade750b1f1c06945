"""What a simulated part changes while its world lives is kept in checkpoints, or follows from what is."""

from __future__ import annotations

import ast
import importlib
import inspect
import pkgutil
import textwrap

import pytest

import hil.simulation
from hil.wire.checkpoint import Stateful

BUILDING = {"__init__", "attach", "follow", "restored", "_connected"}
FOLLOWS = {
    **dict.fromkeys(("_ahead", "_next_ns", "_past", "_present", "_resting", "_set", "_solved", "_whole"), "of moments"),
    **dict.fromkeys(("_made", "_plain", "_setting", "_warm"), "of registers and the clock"),
    **dict.fromkeys(("_calm", "_tuned"), "of parameters"),
    **dict.fromkeys(("_bits", "_marks", "_now_ns", "_received_us"), "of the call that is being answered"),
    "_peers": "of the wiring",
    "_program": "of its request",
}
"""Attributes that need not be kept, and of what they are made again."""


def _parts():
    for module in pkgutil.walk_packages(hil.simulation.__path__, "hil.simulation."):
        importlib.import_module(module.name)
    found, todo = set(), [Stateful]
    while todo:
        for part in todo.pop().__subclasses__():
            todo.append(part)
            if part.__module__.startswith("hil.simulation"):
                found.add(part)
    return sorted(found, key=lambda part: (part.__module__, part.__qualname__))


def _changed(part):
    """Return what the methods of a class and its parents set on `self`, without those that build and restore it."""
    names = set()
    for each in part.__mro__:
        if each.__module__.startswith("hil.simulation"):
            (tree,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
            methods = (node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name not in BUILDING)
            names |= {name for method in methods for name in _set_in(method)}
    return names


def _set_in(method):
    for node in ast.walk(method):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and ast.unparse(node.value) == "self":
            yield node.attr


@pytest.mark.parametrize("part", _parts(), ids=lambda part: part.__qualname__)
def test_what_changes_is_kept(part):
    """A run that is resumed would otherwise go on in another world."""
    kept = {name for each in part.__mro__ for name, hint in inspect.get_annotations(each).items() if "Kept[" in hint}
    assert _changed(part) - kept - FOLLOWS.keys() == set()
