"""A figure: a number that knows its unit and how well it is known."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Figure", "FigureStatus"]


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
        uncertainty: standard uncertainty (k = 1) in the same unit, None where unknown.
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
