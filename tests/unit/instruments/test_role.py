"""The description of a role, and why one is none."""

from __future__ import annotations

from typing import Annotated, Protocol

import pytest

from hil.instruments.marks import begins, drives, reads
from hil.instruments.role import Role, problem_with
from hil.model.figure import Figure


class Valve(Protocol):
    """A valve with two seats."""

    @drives
    def turn(self, seat: str, opening: Annotated[float, "%"], slowly: Annotated[float, "s"] | None = None) -> None:
        """Turn it."""

    @drives
    def shut(self) -> None:
        """Shut it."""

    @begins
    def flush(self) -> None:
        """Begin to flush."""

    @reads
    def flow(self) -> tuple[Annotated[Figure, "L/min"], Annotated[Figure, "s"]]:
        """Return the flow, and when."""

    def unmarked(self) -> None:
        """Be no operation."""


class Broken(Protocol):
    """A protocol whose annotations cannot be read."""

    @reads
    def flow(self) -> NoSuchType:  # noqa: F821 - it is not there
        """Return the flow."""


class Empty(Protocol):
    """A protocol without operations."""


def valve(**changes):
    """Return the role of a valve."""
    settings = {"name": "valve", "protocol": Valve, "states": {"shut": "shut"}, "quantities": {"flow": "L/min"}}
    return Role(**{**settings, **changes})


def test_operations_say_what_they_take_and_do():
    """Units come from the annotations, effects from the marks."""
    operations = valve().operations
    assert list(operations) == ["flow", "flush", "shut", "turn"]
    arguments = operations["turn"].arguments
    assert {name: (each.number, each.unit) for name, each in arguments.items()} == {
        "seat": (False, ""),
        "opening": (True, "%"),
        "slowly": (False, "s"),
    }
    assert operations["flow"].unit == "L/min, s"
    assert {name: (each.effect, each.begins) for name, each in operations.items()} == {
        "flow": ("reads", False),
        "flush": ("drives", True),
        "shut": ("drives", False),
        "turn": ("drives", False),
    }


@pytest.mark.parametrize(
    ("role", "problem"),
    [
        (valve(), ""),
        (Valve, "is <class"),
        (valve(name="tap"), "calls itself 'tap'"),
        (valve(protocol=Broken), "has operations that cannot be read: NameError"),
        (valve(protocol=Empty), "has no operation: mark them with hil.instruments.marks"),
        (valve(states={"open": "opened"}), "comes to its state 'open' by 'opened', which is no driving operation"),
        (valve(states={"open": "flow"}), "comes to its state 'open' by 'flow', which is no driving operation"),
        (valve(states={"open": "turn"}), "comes to its state 'open' by 'turn', which is no driving operation"),
        (valve(clamped=("opening",)), "has clamps for opening, of which it gives no unit"),
    ],
)
def test_what_is_no_role_is_told(role, problem):
    """Each reason in words that follow its name."""
    told = problem_with("valve", role)
    assert told.startswith(problem) if problem else told == ""
