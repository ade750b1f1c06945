"""Limits of the envelope as data: what is read, and what is computed from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from hil.model.notation import AnyText, Number, Seconds, Text, matching, number, one_of, seconds, whole

__all__ = ["MADE_OF", "Derived", "EnvelopeLimit"]

MADE_OF = {
    "charge": ("current",),
    "energy": ("voltage", "current"),
    "duration": ("current",),
    "slope": (),
    "unchanged": (),
}
"""Derived quantities, and what they are computed from besides what the limit names."""

_MILLISECOND = seconds(0.001)
_MADE = {"slope": "slope of {of}", "unchanged": "time of unchanged {of}"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Derived:
    """How the quantity of a limit comes from what is read. What does not concern it is empty.

    Attributes:
        of: of which quantity a `slope` is taken, or which one may not stay `unchanged`.
        flow: `charging`, `discharging` or `flowing`: the limit counts while such a current flows only.
        threshold: in A; a current that is nearer to zero is none.
        since: `phase`, the last current of the other direction, or `arm`.
        over_s: the time over which a slope is taken.
        band: how far an unchanged quantity may go from where it was.
        against: the output whose quantity of the same name is subtracted.
    """

    of: AnyText = ""
    flow: Annotated[str, one_of("charging", "discharging", "flowing")] = field(default="", metadata={"alias": "while"})
    threshold: Annotated[float, number(above=0.0)] | None = None
    since: Annotated[str, one_of("phase", "arm")] = ""
    over_s: Annotated[float, _MILLISECOND] | None = field(default=None, metadata={"alias": "over"})
    band: Annotated[float, number(0.0)] | None = None
    against: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeLimit(Derived):
    """A quantity that trips the bench, watched whether or not a case reads it.

    Attributes:
        id: its name in events and messages.
        output: the role instance that is read.
        quantity: which of its reads (`current`, `voltage`, `temperature`), or what is computed from them.
        unit: unit of the limits.
        minimum: lowest allowed value, or None.
        maximum: highest allowed value, or None.
        period_s: how often it is read.
        max_age_s: how old the last good reading may get before that alone is a trip.
        debounce: how many readings in a row must be outside.
    """

    id: Annotated[str, matching("[a-z][a-z0-9-]*")]
    output: Text
    quantity: Text
    unit: Text
    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    period_s: Annotated[float, _MILLISECOND] = field(metadata={"alias": "period"})
    max_age_s: Seconds = field(metadata={"alias": "max_age"})
    debounce: Annotated[int, whole(1, 1000)] = 1  # with more, the limit hardly ever trips

    @property
    def derived(self) -> Derived | None:
        """How it is computed, None where it is what is read."""
        given = self.of or self.flow or self.since or self.against
        numbers = (self.threshold, self.over_s, self.band)
        return self if self.quantity in MADE_OF or given or any(each is not None for each in numbers) else None

    @property
    def words(self) -> str:
        """The quantity as a sentence names it."""
        if self.derived is None:
            return self.quantity
        words = _MADE.get(self.quantity, self.quantity).format(of=self.derived.of)
        if self.derived.against:
            words += f" against {self.derived.against}"
        return f"{words} while {self.derived.flow}" if self.derived.flow else words
