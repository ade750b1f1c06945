"""Limits of the envelope as data: what is read, and what is computed from it."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Derived", "EnvelopeLimit"]

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

    of: str = ""
    flow: str = ""
    threshold: float | None = None
    since: str = ""
    over_s: float | None = None
    band: float | None = None
    against: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeLimit:
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
        derived: how it is computed, None where it is what is read.
    """

    id: str
    output: str
    quantity: str
    unit: str
    minimum: float | None
    maximum: float | None
    period_s: float
    max_age_s: float
    debounce: int = 1
    derived: Derived | None = None

    @property
    def words(self) -> str:
        """The quantity as a sentence names it."""
        if self.derived is None:
            return self.quantity
        words = _MADE.get(self.quantity, self.quantity).format(of=self.derived.of)
        if self.derived.against:
            words += f" against {self.derived.against}"
        return f"{words} while {self.derived.flow}" if self.derived.flow else words
