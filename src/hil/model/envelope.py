"""Limits of the envelope as data: what is read, and what is computed from it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from hil.model.notation import AnyText, Number, Seconds, Text, number, one_of, seconds, slug, whole

__all__ = ["MADE_OF", "EnvelopeLimit"]

MADE_OF = {
    "charge": ("current",),
    "energy": ("voltage", "current"),
    "duration": ("current",),
    "slope": (),
    "unchanged": (),
}
"""Derived quantities, and what else they are computed from, beyond what the limit names."""

_MILLISECOND = seconds(0.001)
_MADE = {"slope": "slope of {of}", "unchanged": "time of unchanged {of}"}


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeLimit:
    """A quantity that trips the bench, watched whether or not a case reads it.

    From `of` on, the attributes say how a derived quantity comes from what is read; what does not concern it is empty.

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
        of: of which quantity a `slope` is taken, or which one may not stay `unchanged`.
        flow: `charging`, `discharging` or `flowing`: the limit counts only while such a current flows.
        threshold: in A; a current that is nearer to zero is none.
        since: `phase`, the last current of the other direction, or `arm`.
        over_s: the time over which a slope is taken.
        band: how far an unchanged quantity may go from where it was.
        against: the output whose quantity of the same name is subtracted.
    """

    id: Annotated[str, slug("-")]
    output: Text
    quantity: Text
    unit: Text
    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    period_s: Annotated[float, _MILLISECOND] = field(metadata={"alias": "period"})
    max_age_s: Seconds = field(metadata={"alias": "max_age"})
    debounce: Annotated[int, whole(1, 1000)] = 1  # with more, the limit hardly ever trips
    of: AnyText = ""
    flow: Annotated[str, one_of("charging", "discharging", "flowing")] = field(default="", metadata={"alias": "while"})
    threshold: Annotated[float, number(above=0.0)] | None = None
    since: Annotated[str, one_of("phase", "arm")] = ""
    over_s: Annotated[float, _MILLISECOND] | None = field(default=None, metadata={"alias": "over"})
    band: Annotated[float, number(0.0)] | None = None
    against: AnyText = ""

    @property
    def derivation(self) -> Mapping[str, object]:
        """What the file says of how the quantity is derived, by key."""
        said = {
            "of": self.of,
            "while": self.flow,
            "threshold": self.threshold,
            "since": self.since,
            "over": self.over_s,
            "band": self.band,
            "against": self.against,
        }
        return {key: value for key, value in said.items() if value not in {None, ""}}

    @property
    def is_derived(self) -> bool:
        """Whether the quantity is computed, not read."""
        return self.quantity in MADE_OF or bool(self.derivation)

    @property
    def words(self) -> str:
        """The quantity as a sentence names it."""
        words = _MADE.get(self.quantity, self.quantity).format(of=self.of)
        if self.against:
            words += f" against {self.against}"
        return f"{words} while {self.flow}" if self.flow else words
