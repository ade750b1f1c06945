"""What is driven: the calls that brought every output to where it is."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.instruments.roles import STATES

__all__ = ["Driven"]

_ENDS = frozenset({"case", "rest", "safe"})
"""Kinds of events after which nothing is driven any more: each case drives what it needs itself."""

_BY_CONTACT = "relays"


class Driven:
    """Learns from the events of a run.

    Of every output the last call of each operation is kept, in the order in which they were first needed: a voltage is
    set before an output is switched on. A call that leads to a state of rest makes those before it void.
    """

    def __init__(self) -> None:
        self._calls: dict[str, dict[str, tuple[str, Mapping[str, object]]]] = {}

    def take(self, event: Mapping[str, Any]) -> None:
        """Take one event."""
        if event["kind"] in _ENDS:
            self._calls.clear()
        elif event["kind"] == "effect" and event["effect"] == "drives" and "raised" not in event:
            output, _, operation = event["name"].rpartition(".")
            self._drove(output, operation, event["arguments"])

    def of(self, output: str) -> tuple[tuple[str, Mapping[str, object]], ...]:
        """Return the calls that bring an output to where it was, each with its arguments."""
        return tuple(self._calls.get(output, {}).values())

    def _drove(self, output: str, operation: str, arguments: Mapping[str, object]) -> None:
        role = output.partition(".")[0]
        calls = self._calls.setdefault(output, {})
        if operation in STATES.get(role, {}).values():
            calls.clear()
        contact = arguments.get("contact")
        calls[f"contact {contact}" if role == _BY_CONTACT and contact is not None else operation] = (
            operation,
            arguments,
        )
