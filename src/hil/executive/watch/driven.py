"""What is driven: the calls that brought every output to where it is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hil.instruments.registry import role_of, states_of

__all__ = ["Call", "Driven"]

_ENDS = frozenset({"case", "rest", "safe"})
"""Kinds of events after which nothing is driven any more: each case drives what it needs itself."""


@dataclass(frozen=True, slots=True)
class Call:
    """One driving call: what it was, and the bench time in s at which its operation was first needed."""

    output: str
    operation: str
    arguments: Mapping[str, object]
    first_t: float


class Driven:
    """Learns from the events of a run.

    Of every output the last call of each operation is kept, in the order in which they were first needed: a voltage is
    set before an output is switched on. A call that leads to a state of rest makes those before it void. A call that
    begins something is not kept: nobody but the case may begin it anew.
    """

    def __init__(self) -> None:
        self._calls: dict[str, dict[str, Call]] = {}

    def take(self, event: Mapping[str, Any]) -> None:
        """Take one event."""
        if event["kind"] in _ENDS:
            self._calls.clear()
        elif event["kind"] == "effect" and event["effect"] == "drives" and "raised" not in event:
            output, _, operation = event["name"].rpartition(".")
            self._drove(output, operation, event["arguments"], event["t"])

    def of(self, output: str) -> tuple[Call, ...]:
        """Return the calls that bring an output to where it was."""
        return tuple(self._calls.get(output, {}).values())

    @property
    def any_on(self) -> bool:
        """Whether an output was driven to anything but a state of rest."""
        return any(
            call.operation not in states_of(output).values()
            for output, calls in self._calls.items()
            for call in calls.values()
        )

    @property
    def calls(self) -> list[Call]:
        """Those of all outputs, in the order in which they were first needed: a sensor is woken after its supply."""
        return sorted((call for output in self._calls for call in self.of(output)), key=lambda call: call.first_t)

    def _drove(self, output: str, operation: str, arguments: Mapping[str, object], t: float) -> None:
        role = role_of(output)
        if role and operation in role.operations and role.operations[operation].begins:
            return
        calls = self._calls.setdefault(output, {})
        if operation in states_of(output).values():
            calls.clear()
        part = role.part if role else ""
        key = f"{part} {arguments[part]}" if arguments.get(part) is not None else operation
        first_t = calls[key].first_t if key in calls else t
        calls[key] = Call(output, operation, arguments, first_t)
