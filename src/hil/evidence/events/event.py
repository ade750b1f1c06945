"""Base of all events: a frozen record of one kind, stamped when it is written."""

import re
from collections.abc import Mapping
from enum import Enum, auto
from types import MappingProxyType
from typing import ClassVar, Protocol

import msgspec

__all__ = ["NOTHING", "Event", "EventSink", "Origin", "Part"]

NOTHING: Mapping[str, object] = MappingProxyType({})


class Origin(Enum):
    """The cause of events of a kind, which decides whether they recur when a run is resumed or replayed."""

    COURSE = auto()
    """The run's own course: every run of the same course writes them again."""
    OUTSIDE = auto()
    """Something outside the run may have caused them; they do not recur."""
    PERSON = auto()
    """A question to a person: a resumed run repeats them at other instants, and a replay answers from its record."""


def _kind(name: str) -> str:
    """Return the kind of the events of a class: `CaseEnd` is `case-end`."""
    return re.sub(r"(?<!^)([A-Z])", r"-\1", name).lower()


class Part(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, omit_defaults=True):
    """An object inside an event; a field that has its default is not written."""


class Event(Part, frozen=True, kw_only=True, tag_field="kind", tag=_kind):
    """One event of a run.

    Attributes:
        seq: its sequence number, from 0; -1 until it is written.
        t: bench time in s; -1 until it is written.
    """

    seq: int = -1
    t: float = -1.0

    origin: ClassVar[Origin] = Origin.COURSE
    synced: ClassVar[bool] = False
    """Whether it is on disk before the run continues; other kinds follow within half a second."""
    recurs: ClassVar[bool] = True
    """Whether the event recurs in every run of the same course, its replay included; follows from its origin."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.recurs = cls.origin is Origin.COURSE

    @classmethod
    def kind(cls) -> str:
        """Return what the journal calls events of this type."""
        return str(cls.__struct_config__.tag)


class EventSink(Protocol):
    """Writer's view of a run's journal."""

    def write(self, event: Event, *, beside: Mapping[str, object] = NOTHING) -> None:
        """Write an event down.

        Args:
            event: the event, not stamped yet.
            beside: facts of this place and moment only.
        """
        ...
