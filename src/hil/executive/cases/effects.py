"""Effects: everything a case learns of the world, or does to it, keyed so that it can be run again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeVar, cast

from hil.model.errors import Diverged
from hil.model.figure import decoded, encoded

__all__ = ["Effects", "Recall", "Where"]

_Result = TypeVar("_Result")


class Where(Protocol):
    """Tells where a case is."""

    @property
    def case(self) -> str:
        """The case's id."""
        ...

    @property
    def number(self) -> str:
        """The number of the present step, such as `1.2`; empty outside steps."""
        ...


class Recall:
    """The effects of an earlier run, which a case that is run again must ask for in the same order.

    Args:
        effects: the bodies of the `effect` events, in order.
        answered: which kinds are answered from the record instead of being performed again.
    """

    def __init__(self, effects: Sequence[Mapping[str, object]], answered: frozenset[str]) -> None:
        self._effects: dict[str, list[Mapping[str, object]]] = {}
        for effect in effects:
            self._effects.setdefault(str(effect["case"]), []).append(effect)
        self._answered = answered

    def take(self, key: Mapping[str, object]) -> Mapping[str, object]:
        """Return the recorded effect of that key.

        Raises:
            Diverged: if the case did something else here in the record, or had ended.
        """
        waiting = self._effects.get(str(key["case"]), [])
        if not waiting:
            raise Diverged(f"{_spoken(key)}, but the record of this case has ended")
        found = waiting.pop(0)
        if any(found[name] != value for name, value in key.items()):
            raise Diverged(f"{_spoken(key)}, but the record holds {_spoken(found)}")
        return found

    def rest(self, case: str) -> str:
        """Return what the record of a case goes on with, empty where it has ended, too."""
        waiting = self._effects.get(case, [])
        return _spoken(waiting[0]) if waiting else ""

    def answers(self, effect: Mapping[str, object]) -> bool:
        """Return whether the record answers in place of the world; nobody answered where it was declined."""
        return effect["effect"] in self._answered and "raised" not in effect


class Effects:
    """Performs effects, numbers them, and writes them down with arguments and result.

    Args:
        write: writes an event.
        where: tells case and step.
        recall: the record that this run has to agree with, or None.
        undisturbed: keeps requests to stop waiting while an effect is performed.

    Attributes:
        diverged: the first disagreement with the record, also where the case let it through.
    """

    def __init__(
        self,
        write: Callable[..., None],
        where: Where,
        recall: Recall | None = None,
        undisturbed: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._write = write
        self._where = where
        self._recall = recall
        self._undisturbed = undisturbed
        self.diverged = ""
        self._ordinals: Counter[tuple[str, str]] = Counter()

    def perform(self, name: str, kind: str, arguments: Mapping[str, object], action: Callable[[], _Result]) -> _Result:
        """Perform one effect and return its result.

        Args:
            name: what is done, such as `supply.coil.configure`.
            kind: `drives`, `reads`, `waits` or `asks`.
            arguments: JSON values.
            action: does it.

        What the action raises is written down in place of a result, and goes on to the case.

        Raises:
            Diverged: if a record is to be agreed with, and does not.
        """
        with self._undisturbed():
            try:
                return self._perform(name, kind, arguments, action)
            except Diverged as error:
                self.diverged = self.diverged or str(error.first)
                raise

    def end(self) -> None:
        """Compare the end of the case with the record."""
        rest = self._recall.rest(self._where.case) if self._recall else ""
        if rest and not self.diverged:
            self.diverged = f"the case has ended, but its record goes on with {rest}"

    def _perform(self, name: str, kind: str, arguments: Mapping[str, object], action: Callable[[], _Result]) -> _Result:
        number = self._where.number
        self._ordinals[number, name] += 1
        key = {
            "case": self._where.case,
            "step": number,
            "name": name,
            "ordinal": self._ordinals[number, name],
            "effect": kind,
            "arguments": encoded(arguments),
        }
        recorded = self._recall.take(key) if self._recall else None
        try:
            if recorded is not None and self._recall and self._recall.answers(recorded):
                result = cast("_Result", decoded(recorded["result"]))
            else:
                result = action()
        except BaseException as error:
            self._end(key, recorded, None, type(error).__name__)
            raise
        self._end(key, recorded, encoded(result), "")
        return result

    def _end(self, key: Mapping[str, object], recorded: Mapping[str, object] | None, told: object, raised: str) -> None:
        """Compare how an effect ended with the record, and write it down."""
        if recorded is not None and (told, raised) != (recorded["result"], recorded.get("raised", "")):
            held = recorded.get("raised") or recorded["result"]
            raise Diverged(f"{_spoken(key)} gave {raised or told}, but the record holds {held}")
        self._write("effect", **key, result=told, **({"raised": raised} if raised else {}))


def _spoken(key: Mapping[str, object]) -> str:
    return f"{key['case']}, step {key['step'] or 'none'}: {key['name']} (no. {key['ordinal']}) with {key['arguments']}"
