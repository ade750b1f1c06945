"""Effects: everything a case learns of the world, or does to it, keyed so that the case can be re-executed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Literal, Protocol, TypeVar, cast

import msgspec

from hil.evidence import events
from hil.evidence.events import EventSink
from hil.model.errors import Diverged, HilError
from hil.model.figure import decoded, encoded
from hil.model.provenance import Provenance

__all__ = ["Effects", "Kind", "Recall", "Where"]

Kind = Literal["drives", "reads", "waits", "records", "asks"]

_Result = TypeVar("_Result")


class Where(Protocol):
    """The present place in a case."""

    @property
    def case(self) -> str:
        """The case's id."""
        ...

    @property
    def number(self) -> str:
        """The number of the present step, such as `1.2`; empty outside steps."""
        ...


class Recall:
    """The effects of an earlier run, which a re-executed case must request in the same order.

    Args:
        effects: its effects, in order.
        answered: the kinds that are answered from the record instead of being performed again.
    """

    def __init__(self, effects: Sequence[events.Effect], answered: frozenset[str]) -> None:
        self._effects: dict[str, list[events.Effect]] = {}
        for effect in effects:
            self._effects.setdefault(effect.case, []).append(effect)
        self._answered = answered

    def take(self, asked: events.Effect) -> events.Effect:
        """Return the recorded effect that a case requests.

        Raises:
            Diverged: if the case did something else here in the record, or had ended.
        """
        waiting = self._effects.get(asked.case, [])
        if not waiting:
            raise Diverged(f"{_described(asked)}, but the record of this case has ended")
        found = waiting.pop(0)
        if _key(found) != _key(asked):
            raise Diverged(f"{_described(asked)}, but the record holds {_described(found)}")
        return found

    def rest(self, case: str) -> str:
        """Return the next effect in the record of a case, in words; empty if the record has ended, too."""
        waiting = self._effects.get(case, [])
        return _described(waiting[0]) if waiting else ""

    def answers(self, effect: events.Effect) -> bool:
        """Return whether the record answers in place of the world; it does not if the question was declined."""
        return effect.effect in self._answered and not effect.raised


class Effects:
    """Performs and numbers effects, and records them with arguments and result.

    Args:
        journal: where events are written.
        where: the present case and step.
        recall: the record that this run has to agree with, or None.
        undisturbed: defers requests to stop while an effect is performed.

    Attributes:
        undisturbed: as given, for a wait that is not an effect of its own.
        diverged: the first disagreement with the record, even if the case suppressed it.
    """

    def __init__(
        self,
        journal: EventSink,
        where: Where,
        recall: Recall | None = None,
        undisturbed: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._journal = journal
        self._where = where
        self._recall = recall
        self.undisturbed = undisturbed
        self.diverged = ""
        self._ordinals: Counter[tuple[str, str]] = Counter()
        self._learning: list[list[Provenance]] = []

    def perform(self, name: str, kind: Kind, arguments: Mapping[str, object], action: Callable[[], _Result]) -> _Result:
        """Perform one effect and return its result.

        Args:
            name: what is done, such as `supply.coil.configure`.
            kind: what it does to the world or learns of it.
            arguments: JSON values.
            action: does it.

        What the action raises is recorded in place of a result, and passed on to the case.

        Raises:
            Diverged: if there is a record, and it does not match.
        """
        with self.undisturbed():
            try:
                return self._perform(name, kind, arguments, action)
            except Diverged as error:
                self.diverged = self.diverged or str(error.first)
                raise

    @contextmanager
    def learning(self) -> Iterator[list[Provenance]]:
        """Yield a list to which the provenance of each reading in the block is added."""
        learnt: list[Provenance] = []
        self._learning.append(learnt)
        try:
            yield learnt
        finally:
            self._learning.pop()

    def learnt(self, provenance: Provenance) -> None:
        """Add the provenance of a reading to the open `learning` blocks."""
        for each in self._learning:
            if provenance not in each:
                each.append(provenance)

    def end(self) -> None:
        """Compare the end of the case with the record."""
        rest = self._recall.rest(self._where.case) if self._recall else ""
        if rest and not self.diverged:
            self.diverged = f"the case has ended, but its record goes on with {rest}"

    def _perform(
        self, name: str, kind: Kind, arguments: Mapping[str, object], action: Callable[[], _Result]
    ) -> _Result:
        number = self._where.number
        self._ordinals[number, name] += 1
        asked = events.Effect(
            case=self._where.case,
            step=number,
            name=name,
            ordinal=self._ordinals[number, name],
            effect=kind,
            arguments=_arguments(arguments),
            result=None,
        )
        recorded = self._recall.take(asked) if self._recall else None
        try:
            if recorded is not None and self._recall and self._recall.answers(recorded):
                result = cast("_Result", decoded(recorded.result))
            else:
                result = action()
        except BaseException as error:
            self._end(asked, recorded, None, error)
            raise
        self._end(asked, recorded, encoded(result))
        return result

    def _end(
        self,
        asked: events.Effect,
        recorded: events.Effect | None,
        told: object,
        error: BaseException | None = None,
    ) -> None:
        """Compare how an effect ended with the record, and write it to the journal."""
        raised = "" if error is None else type(error).__name__
        if recorded is not None and (told, raised) != (recorded.result, recorded.raised):
            held = recorded.raised or recorded.result
            raise Diverged(f"{_described(asked)} gave {raised or told}, but the record holds {held}")
        said = ("", "")
        if asked.effect == "asks" and isinstance(error, HilError):  # all others recur by themselves
            said = (error.message, error.hint)
        self._journal.write(msgspec.structs.replace(asked, result=told, raised=raised, why=said[0], hint=said[1]))


def _arguments(arguments: Mapping[str, object]) -> dict[str, object]:
    return {str(name): encoded(value) for name, value in arguments.items()}


def _key(effect: events.Effect) -> tuple[object, ...]:
    """Return what must be the same in every run of the same case."""
    return effect.case, effect.step, effect.name, effect.ordinal, effect.effect, effect.arguments


def _described(effect: events.Effect) -> str:
    where = f"{effect.case}, step {effect.step or 'none'}"
    return f"{where}: {effect.name} (no. {effect.ordinal}) with {effect.arguments}"
