"""The options of `hil analyse battery` that no test of a cell can have."""

from __future__ import annotations

import math

from hil.model.errors import Refused

__all__ = ["refuse_impossible", "span_of"]


def refuse_impossible(
    *,
    positive: dict[str, float | None],
    upper: float,
    lower: float,
    skip: int,
    counted: int | None,
    remaining: float,
) -> None:
    """Refuse options that contradict each other or physics.

    Args:
        positive: by name of the option, values that have to be above zero; None where one was not given.
        upper: end of charge, in V.
        lower: end of discharge, in V.
        skip: cycles that the fade leaves out.
        counted: cycles that somebody counted.
        remaining: part that is left at the end of life.

    Raises:
        Refused: the first that is not possible.
    """
    for name, value in positive.items():
        if value is not None and not 0.0 < value < math.inf:
            raise Refused(f"{name} {value:g} is not possible", "give a number above zero")
    if not 0.0 <= lower < upper < math.inf:
        raise Refused(
            f"--upper {upper:g} and --lower {lower:g} are no range",
            "give the higher voltage in V, at which a charge ends, as --upper",
        )
    if skip < 0:
        raise Refused(f"--skip {skip} is not possible", "give how many of the first cycles the fade leaves out, or 0")
    if counted is not None and counted < 1:
        raise Refused(f"--counted {counted} is not possible", "give how many cycles somebody counted")
    if not 0.0 < remaining < 1.0:
        raise Refused(f"--remaining {remaining:g} is not possible", "give a part between 0 and 1, such as 0.8")


def span_of(text: str) -> tuple[float, float]:
    """Return the range of mean voltages that `--mean-voltage` gives, in V.

    Raises:
        Refused: not two numbers, or not the lower one first.
    """
    try:
        low, high = map(float, text.split(","))
    except ValueError:
        raise Refused(f"--mean-voltage {text} is no range", "give two voltages as 3.4,3.95") from None
    if not 0.0 < low < high < math.inf:
        raise Refused(f"--mean-voltage {text} is no range", "give the lower voltage first, as 3.4,3.95")
    return low, high
