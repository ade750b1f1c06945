"""Values that a case passes to a check: a figure, a word, or a bare number where no unit is needed."""

from __future__ import annotations

import math
from numbers import Real
from typing import TypeGuard

from hil.model.errors import Misused
from hil.model.figure import Figure, FigureStatus
from hil.requirements.requirement import Limit

__all__ = ["given"]


def given(value: object, limit: Limit, what: str) -> Figure | str:
    """Return a figure or a word of plain Python types, so that what is judged is what is recorded.

    NumPy numbers become floats: a float32 would be judged by digits other than those in the journal.

    Args:
        value: what the case passed.
        limit: the limit that the value is compared with.
        what: requirement and parameter, for messages.

    Raises:
        Misused: for a text or a bare number instead of a figure with a unit, and for anything else.
    """
    if isinstance(value, Figure):
        return _figure(value, what)
    if isinstance(value, str):
        if limit.unit:
            raise Misused(f"{what}: expected a number in {limit.unit}, found the text '{value}'", "give a Figure")
        return str(value)
    if not _is_number(value):
        expected = f"a number in {limit.unit}" if limit.unit else "a text"
        raise Misused(f"{what}: expected {expected}, found {_named(value)}", _HINT)
    number = _number(value, what)
    if limit.unit != "1":
        expected, found = (
            (f"a number in {limit.unit}", f"{number:g} without a unit") if limit.unit else ("a text", f"{number:g}")
        )
        raise Misused(f"{what}: expected {expected}, found {found}", _HINT)
    return Figure(value=number, unit="1")


_HINT = "give a Figure of one number and its unit, or a text where the requirement names one"


_STATUSES = frozenset(FigureStatus)


def _figure(figure: Figure, what: str) -> Figure:
    if not isinstance(figure.unit, str):
        raise Misused(f"{what}: the unit of a figure is a text, found {_named(figure.unit)}", _HINT)
    if figure.status not in _STATUSES:
        raise Misused(f"{what}: {_named(figure.status)} is not a status of a figure", "use one of FigureStatus")
    uncertainty = figure.uncertainty
    return Figure(
        value=_number(figure.value, f"{what}: the value of a figure"),
        unit=str(figure.unit),
        uncertainty=None if uncertainty is None else _number(uncertainty, f"{what}: the uncertainty of a figure"),
        dof=_number(figure.dof, f"{what}: the dof of a figure"),
        status=FigureStatus(figure.status),
    )


def _number(value: object, what: str) -> float:
    if not _is_number(value):
        raise Misused(f"{what} is one real number, found {_named(value)}", _HINT)
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _is_number(value: object) -> TypeGuard[Real]:
    """Return whether this is one real number; Python's bool only looks like one, and NumPy's does not even do that."""
    return type(value) is float or (not isinstance(value, bool) and isinstance(value, Real))


def _named(value: object) -> str:
    """Return what something is, on one line and without its memory address."""
    shape = getattr(value, "shape", ())
    kind = f"{type(value).__name__} of shape {shape}" if shape else type(value).__name__
    return f"{value!r} ({kind})" if isinstance(value, bool | bytes | complex | str | type(None)) else f"a {kind}"
