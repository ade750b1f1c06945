"""What a case gives to `check`, made plain at the door, or refused with a reason."""

from __future__ import annotations

import math
from numbers import Real
from typing import TypeGuard

from hil.model.errors import HilError
from hil.model.figure import Figure, FigureStatus
from hil.requirements.requirement import Limit

__all__ = ["Misused", "given"]


class Misused(HilError):
    """A case asks for what the catalogue does not hold, or gives something that is no figure or no role of its own."""


def given(value: object, limit: Limit, what: str) -> Figure | str:
    """Return a figure or a word of plain Python types, so that what is judged is what is written down.

    NumPy's numbers become floats: a float32 would be judged by other digits than those of the journal.

    Args:
        value: what the case gave.
        limit: what is due.
        what: requirement and parameter, for messages.

    Raises:
        Misused: for a word or a bare number where a figure with a unit is due, and for whatever is neither.
    """
    if isinstance(value, Figure):
        return _figure(value, what)
    if isinstance(value, str):
        if limit.unit:
            raise Misused(f"{what}: '{value}' is a word, and a number in {limit.unit} is due", "give a Figure")
        return str(value)
    if not _is_number(value):
        due = f"a number in {limit.unit}" if limit.unit else "a word"
        raise Misused(f"{what}: {_told(value)} is neither a number nor a word, and {due} is due", _HINT)
    number = _number(value, what)
    if limit.unit != "1":
        raise Misused(f"{what}: a bare {number:g} has no unit, and {limit.unit or 'a word'} is due", _HINT)
    return Figure(value=number, unit="1")


_HINT = "give a Figure of one number and its unit, or a text where a word is due"


def _figure(figure: Figure, what: str) -> Figure:
    if not isinstance(figure.unit, str):
        raise Misused(f"{what}: the unit of a figure is a text, found {_told(figure.unit)}", _HINT)
    if figure.status not in set(FigureStatus):
        raise Misused(f"{what}: {_told(figure.status)} is no status of a figure", "take one of FigureStatus")
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
        raise Misused(f"{what} is one real number, found {_told(value)}", _HINT)
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _is_number(value: object) -> TypeGuard[Real]:
    """Return whether this is one real number; Python's flag only looks like one, and NumPy's not even that."""
    return not isinstance(value, bool) and isinstance(value, Real)


def _told(value: object) -> str:
    """Return what something is, on one line and without its place in memory."""
    shape = getattr(value, "shape", ())
    kind = f"{type(value).__name__} of shape {shape}" if shape else type(value).__name__
    return f"{value!r} ({kind})" if isinstance(value, bool | bytes | complex | str | type(None)) else f"a {kind}"
