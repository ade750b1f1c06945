"""Limits of the envelope as data: measured and derived quantities."""

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
"""Derived quantities, with the further quantities that they are computed from."""

_MILLISECOND = seconds(0.001)
_MADE = {"slope": "slope of {of}", "unchanged": "time of unchanged {of}"}


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopeLimit:
    """A limit on a quantity that trips the bench, monitored whether or not a case reads it.

    The attributes from `of` on define a derived quantity; those that do not apply are empty.

    Attributes:
        id: its name in events and messages.
        output: the role instance that is read.
        quantity: quantity read (`current`, `voltage`, `temperature`), or derived.
        unit: unit of the limits.
        minimum: lowest allowed value, or None.
        maximum: highest allowed value, or None.
        period_s: monitor period [s].
        max_age_s: age of the last good reading that trips on its own [s].
        debounce: number of consecutive readings outside the limits that trip.
        of: quantity whose `slope` is taken, or that must not stay `unchanged`.
        flow: `charging`, `discharging` or `flowing`: the limit applies only while such a current flows.
        threshold: current [A] below which none flows.
        since: start of integration: `phase`, the last current of the other direction, or `arm`.
        over_s: time window of a slope [s].
        band: largest deviation of an unchanged quantity.
        against: output whose quantity of the same name is subtracted.
    """

    id: Annotated[str, slug("-")]
    output: Text
    quantity: Text
    unit: Text
    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    period_s: Annotated[float, _MILLISECOND] = field(metadata={"alias": "period"})
    max_age_s: Seconds = field(metadata={"alias": "max_age"})
    debounce: Annotated[int, whole(1, 1000)] = 1  # beyond that the limit hardly ever trips
    of: AnyText = ""
    flow: Annotated[str, one_of("charging", "discharging", "flowing")] = field(default="", metadata={"alias": "while"})
    threshold: Annotated[float, number(above=0.0)] | None = None
    since: Annotated[str, one_of("phase", "arm")] = ""
    over_s: Annotated[float, _MILLISECOND] | None = field(default=None, metadata={"alias": "over"})
    band: Annotated[float, number(0.0)] | None = None
    against: AnyText = ""

    @property
    def derivation(self) -> Mapping[str, object]:
        """The file's definition of the derived quantity, by key."""
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
        """Whether the quantity is derived rather than read."""
        return self.quantity in MADE_OF or bool(self.derivation)

    @property
    def words(self) -> str:
        """The quantity's name in sentences."""
        words = _MADE.get(self.quantity, self.quantity).format(of=self.of)
        if self.against:
            words += f" against {self.against}"
        return f"{words} while {self.flow}" if self.flow else words
