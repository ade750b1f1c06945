"""The differences between two audits: what a change would reopen, and what it would close."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from hil.audit.document import Document, Row
from hil.audit.reasons import Reason

__all__ = ["Change", "changes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """What becomes of one requirement.

    Attributes:
        id: the requirement.
        what: `reopened`, `closed`, `added`, `removed`, or `changed` where it stays open or closed.
        gained: reasons that it did not have.
        lost: reasons that it no longer has.
        told: new remarks on its reports and waivers.
    """

    id: str
    what: str
    gained: tuple[Reason, ...] = ()
    lost: tuple[Reason, ...] = ()
    told: tuple[str, ...] = ()


def changes(before: Document, after: Document) -> tuple[Change, ...]:
    """Return what becomes of every requirement whose status or reasons differ, by id; reopened ones first."""
    return tuple(sorted(_changes(before, after), key=lambda change: (change.what != "reopened", change.id)))


def _changes(before: Document, after: Document) -> Iterator[Change]:
    old, new = ({row.id: row for row in each.rows} for each in (before, after))
    for identifier in sorted({*old, *new}):
        if identifier not in new:
            yield Change(id=identifier, what="removed")
        elif identifier not in old:
            yield Change(id=identifier, what="added", gained=new[identifier].reasons)
        elif (found := _change(old[identifier], new[identifier])) is not None:
            yield found


def _change(old: Row, new: Row) -> Change | None:
    gained = tuple(each for each in new.reasons if each not in set(old.reasons))
    lost = tuple(each for each in old.reasons if each not in set(new.reasons))
    told = tuple(each for each in new.records if each not in set(old.records))
    if old.closed != new.closed:
        return Change(id=new.id, what="closed" if new.closed else "reopened", gained=gained, lost=lost, told=told)
    if gained or lost or told or old.fingerprint != new.fingerprint:
        return Change(id=new.id, what="changed", gained=gained, lost=lost, told=told)
    return None
