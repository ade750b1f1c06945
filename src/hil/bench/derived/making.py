"""Which derivation computes the quantity of a limit."""

from __future__ import annotations

from hil.bench.derived.derivation import INTEGRALS, Derivation
from hil.bench.derived.gated import Gated
from hil.bench.derived.slopes import Slope
from hil.bench.derived.sums import Integral, Unchanged
from hil.model.envelope import Derived, EnvelopeLimit

__all__ = ["derivation_of"]


def derivation_of(limit: EnvelopeLimit, how: Derived) -> Derivation:
    """Return what computes the quantity of a limit."""
    if limit.quantity in INTEGRALS:
        return Integral(limit, how)
    if limit.quantity == "unchanged":
        return Unchanged(limit, how)
    return Slope(limit, how) if limit.quantity == "slope" else Gated(limit, how)
