"""What the ledger remembers of catalogue and registers: removed entries count until the reason is recorded."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import msgspec

from hil.audit.inputs import Asked, Register, Remembered
from hil.evidence.ledger.entries import Baseline, Entry, Explained
from hil.model.identity import Dut, UnitEvent
from hil.registers.instruments import Certificate, RegisteredInstrument

__all__ = ["CATALOGUE", "INSTRUMENTS", "UNITS", "Removed", "remember", "removed_from"]

CATALOGUE, UNITS, INSTRUMENTS = "catalogue", "units", "instruments"
"""The subjects of baselines whose entries are remembered."""
_KINDS = {CATALOGUE: Asked, UNITS: Dut, INSTRUMENTS: RegisteredInstrument}


@dataclass(frozen=True, slots=True, kw_only=True)
class Removed:
    """What catalogue and registers no longer have as the ledger remembers it.

    Attributes:
        told: all of it.
        asked: requirements that were withdrawn or taken out, by id.
        parents: requirements that were linked to others below them and no longer are, with the ids of those.
        events: events of units by serial number.
        instruments: instruments that lost a certificate, with all that they ever had, by their names.
        since: when the ledger first had a certificate, by the name of the instrument and the certificate's number.
    """

    told: tuple[Remembered, ...] = ()
    asked: Mapping[str, Asked] = field(default_factory=dict)
    parents: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    events: Mapping[str, tuple[UnitEvent, ...]] = field(default_factory=dict)
    instruments: Mapping[str, RegisteredInstrument] = field(default_factory=dict)
    since: Mapping[tuple[str, str], Remembered] = field(default_factory=dict)


def remember(entries: Iterable[Entry], read: Callable[[Baseline, type], Sequence[object]]) -> tuple[Remembered, ...]:
    """Return every entry that a baseline ever had, but for those whose removal was explained later.

    Args:
        entries: the entries of the ledger, in order.
        read: gives the entries of a baseline, each of a type.
    """
    kept: dict[str, Remembered] = {}
    last: dict[str, str] = {}
    for entry in entries:
        if isinstance(entry, Baseline) and entry.subject in _KINDS and last.get(entry.subject) != entry.object:
            last[entry.subject] = entry.object
            for each in _items(read(entry, _KINDS[entry.subject])):
                if each.mark not in kept:
                    kept[each.mark] = msgspec.structs.replace(each, seq=entry.seq, utc=entry.utc)
        elif isinstance(entry, Explained):
            kept.pop(entry.entry, None)
    return tuple(kept.values())


def removed_from(asked: Iterable[Asked], register: Register, remembered: Sequence[Remembered]) -> Removed:
    """Return what the ledger remembers, and catalogue and registers no longer have."""
    if not remembered:
        return Removed()
    present = (*asked, *register.duts.values(), *register.instruments.values())
    there = {each.mark for each in _items(present)}
    since = {
        (each.owner, each.item.certificates[0].number): each
        for each in remembered
        if isinstance(each.item, RegisteredInstrument) and each.mark in there
    }
    gone = tuple(sorted((each for each in remembered if each.mark not in there), key=lambda each: each.mark))
    wanted = {each.owner: each.item for each in gone if isinstance(each.item, Asked)}
    parents: dict[str, list[str]] = {}
    events: dict[str, list[UnitEvent]] = {}
    instruments: dict[str, RegisteredInstrument] = {}
    for each in gone:
        match each.item:
            case str() as parent:
                parents.setdefault(parent, []).append(each.owner)
            case UnitEvent() as event:
                events.setdefault(each.owner, []).append(event)
            case RegisteredInstrument() as known:
                now = instruments.get(known.id) or register.instruments.get(known.id) or replace(known, certificates=())
                instruments[known.id] = _with(now, known.certificates)
    return Removed(
        told=gone,
        asked=wanted,
        parents={parent: tuple(each for each in below if each not in wanted) for parent, below in parents.items()},
        events={serial: tuple(its) for serial, its in events.items()},
        instruments=instruments,
        since=since,
    )


def _with(instrument: RegisteredInstrument, removed: Sequence[Certificate]) -> RegisteredInstrument:
    """Return an instrument with certificates that it had, the oldest first; of one day those removed come first."""
    before = {each.number: each for each in removed}
    present = (_no_better(each, before.get(each.number, each)) for each in instrument.certificates)
    return replace(instrument, certificates=tuple(sorted((*removed, *present), key=lambda each: each.date)))


def _no_better(certificate: Certificate, before: Certificate) -> Certificate:
    """Return a certificate that was changed: it returns nothing in tolerance, and for no longer, than it did before."""
    left = certificate.as_left if before.as_left.good else before.as_left
    return replace(certificate, as_left=left, due=min(certificate.due, before.due))


def _items(found: Iterable[object]) -> Iterator[Remembered]:
    """Give what is remembered of requirements, units and instruments, each by a mark that tells it from all others."""
    for each in found:
        match each:
            case Asked():
                if not each.withdrawn:
                    yield Remembered(mark=f"{CATALOGUE} {each.id}", name=each.id, owner=each.id, item=each)
                    for parent in each.parents:
                        name = f"{each.id} below {parent}"
                        yield Remembered(mark=f"{CATALOGUE} {name}", name=name, owner=each.id, item=parent)
            case Dut():
                for event in each.events:
                    name = f"{each.serial}: {event.kind} on {event.date}"
                    yield Remembered(mark=_mark(UNITS, name, event), name=name, owner=each.serial, item=event)
            case RegisteredInstrument():
                for its in each.certificates:
                    name = f"{each.id}: certificate {its.number} of {its.date}"
                    only = replace(each, certificates=(its,))
                    yield Remembered(mark=_mark(INSTRUMENTS, name, its), name=name, owner=each.id, item=only)


def _mark(subject: str, name: str, item: object) -> str:
    content = hashlib.sha256(msgspec.json.encode(item, order="sorted")).hexdigest()
    return f"{subject} {name} {content[:16]}"
