"""What later entries of the registers say about evidence from before: intervals in doubt, and events after it.

Days are days of UTC, ISO 8601, and both ends of an interval belong to it. Where a day alone cannot tell what came
first, the evidence of that day is in doubt.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from hil.model.identity import UnitEvent
from hil.registers.instruments import AsFound, AsLeft, Certificate, RegisteredInstrument

__all__ = ["Doubt", "calibration_problem", "doubts", "events_after"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """An interval in which the readings of an instrument are in doubt.

    Attributes:
        first: its first day, empty if it has no beginning.
        last: its last day, empty if it has no end yet.
        certificate: number of the certificate that says so.
        reason: why, in a sentence.
    """

    first: str
    last: str
    certificate: str
    reason: str

    def covers(self, first: str, last: str) -> bool:
        """Return whether any day from `first` to `last`, both included, is in doubt."""
        return last[:10] >= self.first and (not self.last or first[:10] <= self.last)


def doubts(instrument: RegisteredInstrument) -> tuple[Doubt, ...]:
    """Return the intervals in which an instrument is in doubt, in the order of its certificates.

    A certificate that finds an instrument out of tolerance puts everything in doubt since the day of the last
    certificate that returned it in tolerance. So does one that does not state what it found and adjusted something. One
    that returns it out of tolerance puts everything in doubt until the next.
    """
    return (*_as_found(instrument), *_as_left(instrument))


def _as_found(instrument: RegisteredInstrument) -> Iterator[Doubt]:
    good = ""
    for each in instrument.certificates:
        since = f"since {good}" if good else "at any time before"
        if each.as_found is AsFound.OUT_OF_TOLERANCE:
            found = f"was found out of tolerance on {each.date}"
        elif each.as_found is AsFound.NOT_STATED and each.as_left is not AsLeft.IN_TOLERANCE:
            found = f"was {each.as_left}, and what was found before on {each.date} is not stated"
        else:
            found = ""
        if found and (good or each.as_found is AsFound.OUT_OF_TOLERANCE):
            reason = f"{_named(instrument, each)} {found}: what it measured {since} is in doubt"
            yield Doubt(first=good, last=each.date, certificate=each.number, reason=reason)
        if each.as_left.good:
            good = each.date


def _as_left(instrument: RegisteredInstrument) -> Iterator[Doubt]:
    ends = [after.date for _, after in pairwise(instrument.certificates)]
    for each, last in zip(instrument.certificates, [*ends, ""], strict=False):
        if not each.as_left.good:
            reason = f"{_named(instrument, each)} was returned out of tolerance on {each.date}"
            yield Doubt(first=each.date, last=last, certificate=each.number, reason=reason)


def _named(instrument: RegisteredInstrument, certificate: Certificate) -> str:
    return f"{instrument.id} (certificate {certificate.number})"


def calibration_problem(instrument: RegisteredInstrument, first: str, last: str) -> str:
    """Return why an instrument was not in calibration from one day to another, nothing if it was.

    A certificate counts from its date to its due date, both included. `doubts` gives the intervals in doubt.

    Args:
        instrument: the instrument with all its certificates.
        first: the first day of use, or a moment in it.
        last: the last day of use, or a moment in it.
    """
    for day in dict.fromkeys((first[:10], last[:10])):
        newest = instrument.certificate_on(day)
        if newest is None:
            earliest = instrument.certificates[0].date if instrument.certificates else ""
            why = f"was used on {day}, before its calibration on {earliest}" if earliest else "has no certificate"
            return f"{instrument.id} {why}"
        if day > newest.due:
            return f"{instrument.id} was used on {day}, and its calibration was due on {newest.due}"
    return ""


def events_after(events: Sequence[UnitEvent], began: str) -> tuple[UnitEvent, ...]:
    """Return the events after which evidence for a unit has to be repeated, in the order of the register.

    Args:
        events: what the register says was done to the unit.
        began: when the evidence began to be recorded, a day or a moment of UTC. Evidence that began on the last day of
            an event may be from before it.
    """
    return tuple(event for event in events if event.reverify and began[:10] <= event.last)
