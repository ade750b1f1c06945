"""A figure: a number that knows its unit and how well it is known, and its form in JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from numbers import Integral, Real

__all__ = ["Figure", "FigureStatus", "decoded", "encoded"]


class FigureStatus(StrEnum):
    """What the analysis says of the number it gives."""

    MEASURED = "measured"
    UPPER_LIMIT = "upper limit"
    NOT_OBSERVABLE = "not observable"
    MODEL_REJECTED = "model rejected"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A value with unit and standard uncertainty.

    Attributes:
        value: the number, in `unit`; NaN is allowed and never passes a check.
        unit: a unit string of the catalogue's notation (`deg/s/sqrt(Hz)`, `1` for a plain number).
        uncertainty: standard uncertainty (k = 1) in the same unit, None if unknown.
        dof: degrees of freedom of the uncertainty, infinite where it is taken as exact.
        status: what the analysis says of the number; only MEASURED and UPPER_LIMIT can pass.
    """

    value: float
    unit: str
    uncertainty: float | None = None
    dof: float = math.inf
    status: FigureStatus = FigureStatus.MEASURED

    def __post_init__(self) -> None:
        if self.uncertainty is not None and not self.uncertainty >= 0:
            raise ValueError(f"uncertainty must be a number not below zero, got {self.uncertainty}")
        if not self.dof > 0:
            raise ValueError(f"degrees of freedom must be above zero, got {self.dof}")


def encoded(value: object) -> object:
    """Return a value as JSON: figures become mappings, tuples lists, NumPy's numbers plain ones, NaN and inf None."""
    if isinstance(value, Figure):
        return {
            "value": encoded(value.value),
            "unit": value.unit,
            "uncertainty": encoded(value.uncertainty),
            "dof": encoded(value.dof),
            "status": value.status.value,
        }
    if isinstance(value, Real) and not isinstance(value, bool):  # type: ignore[unreachable]
        return _number(value)
    if isinstance(value, Mapping):
        return {str(key): encoded(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [encoded(item) for item in value]
    return value


def _number(value: Real) -> int | float | None:
    if isinstance(value, Integral):
        return int(value)
    return float(value) if math.isfinite(value) else None


def decoded(value: object) -> object:
    """Return what `encoded` was given, as far as a case can tell."""
    if isinstance(value, Mapping) and set(value) == {"value", "unit", "uncertainty", "dof", "status"}:
        return Figure(
            value=math.nan if value["value"] is None else float(value["value"]),
            unit=str(value["unit"]),
            uncertainty=value["uncertainty"],
            dof=math.inf if value["dof"] is None else float(value["dof"]),
            status=FigureStatus(value["status"]),
        )
    if isinstance(value, list):
        return tuple(decoded(item) for item in value)
    return value
