"""What a plan allows its parameters to be, so that a wrong one is refused before anything is armed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated

from hil.model.notation import Flag, Number, whole

__all__ = ["Allowed"]

_COUNT = whole(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """What the numbers of one parameter may be; without anything, every number.

    Attributes:
        minimum: the lowest, in the parameter's unit; it is allowed itself.
        maximum: the highest; it is allowed itself.
        whole: whether there is nothing behind the point.
        rising: whether each number of a list is above the one before.
        count: how many a list holds; any number of them where None.
    """

    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    whole: Flag = False
    rising: Flag = False
    count: Annotated[int, _COUNT] | None = None

    def holds(self, numbers: Sequence[float]) -> bool:
        """Return whether these numbers are allowed, in the parameter's unit."""
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        return (
            all(low <= number <= high for number in numbers)
            and (not self.whole or all(number.is_integer() for number in numbers))
            and (not self.rising or all(one < other for one, other in pairwise(numbers)))
            and self.count in {None, len(numbers)}
        )

    def shown(self, unit: str) -> str:
        """Return what is allowed, for people: `a whole number from 1 to 10`."""
        suffix = "" if unit in {"", "1"} else f" {unit}"
        low, high = (None if each is None else f"{each:.15g}{suffix}" for each in (self.minimum, self.maximum))
        kind = "whole number" if self.whole else "number"
        what = f"a {kind}" if self.count is None else f"{self.count} {kind}s"
        order = ", each above the one before" if self.rising else ""
        if low is not None and high is not None:
            return f"{what} from {low} to {high}{order}"
        bounds = [text for text in (low and f"at least {low}", high and f"at most {high}") if text]
        return " ".join([what, *(f"of {text}" for text in bounds)]) + order
