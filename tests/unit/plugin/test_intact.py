"""Whatever code of the workspace puts in place of a part of the product is told by its name."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest

from hil.executive.cases import certificate, checks
from hil.model.figure import Figure
from hil.plugin.plans.intact import Intact


def told(intact):
    """Return what was replaced."""
    return [str(error).split(";")[0] for error in intact.replaced()]


def replaced(name):
    """Return how it is told."""
    return f"code of the workspace replaced {name}, which is a part of hil"


def other(*_):
    """Stand for anything."""


@pytest.mark.parametrize(
    ("owner", "name", "value", "named"),
    [
        (checks, "judge", other, "hil.executive.cases.checks.judge"),
        (certificate, "_NEEDS_NONE", frozenset({"V"}), "hil.executive.cases.certificate._NEEDS_NONE"),
        (Figure, "__mul__", other, "hil.model.figure.Figure.__mul__"),
        (Figure, "replaced", property(lambda _self: ()), "hil.model.figure.Figure.replaced"),
        (
            certificate.standard_uncertainty,
            "__code__",
            other.__code__,
            "hil.executive.cases.certificate.standard_uncertainty",
        ),
    ],
)
def test_a_part_that_was_replaced_is_named(monkeypatch, owner, name, value, named):
    """Functions, constants, what classes hold, and the code inside a function."""
    intact = Intact(lambda _file: False)
    assert told(intact) == []
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, value)
        assert replaced(named) in told(intact)
    assert told(intact) == []


def test_a_module_that_was_replaced_is_named(monkeypatch):
    """Also one that nobody has a name of yet."""
    intact = Intact(lambda _file: False)
    monkeypatch.setitem(sys.modules, "hil.requirements.decision", ModuleType("hil.requirements.decision"))
    assert replaced("hil.requirements.decision") in told(intact)


def test_a_module_that_is_loaded_later_holds_no_code_of_the_workspace(monkeypatch):
    """Such as one that a case imports first, to put its own function in."""
    intact = Intact(lambda file: file == __file__)
    late = ModuleType("hil.executive.late")
    late.judge = other
    monkeypatch.setitem(sys.modules, late.__name__, late)
    assert told(intact) == [replaced("hil.executive.late.judge")]


def test_a_function_that_is_made_later_may_be_given_its_defaults(monkeypatch):
    """Before anybody looks; from then on they belong to it."""
    intact = Intact(lambda _file: False)
    late = ModuleType("hil.executive.late")
    late.judge = lambda limit: limit
    late.judge.__defaults__ = (1,)
    monkeypatch.setitem(sys.modules, late.__name__, late)
    assert told(intact) == []
    assert told(intact) == []
    late.judge.__defaults__ = (2,)
    assert told(intact) == [replaced("hil.executive.late.judge")]
