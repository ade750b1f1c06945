"""The monitors of a bench: how the quantity of each limit is read through the drivers."""

from __future__ import annotations

from collections.abc import Callable

from hil.bench.bound import BoundBench
from hil.bench.derived.derivation import Derivation
from hil.bench.derived.making import derivation_of
from hil.bench.envelope import Monitor
from hil.model.envelope import EnvelopeLimit
from hil.model.figure import Figure

__all__ = ["monitor_of"]


def monitor_of(bench: BoundBench, limit: EnvelopeLimit) -> Monitor:
    """Return the monitor of one limit."""
    if limit.derived is None:
        return Monitor(limit, _reading(bench, limit.output, limit.quantity), 0)
    derivation = derivation_of(limit, limit.derived)
    return Monitor(limit, _derived_reading(bench, limit, derivation), 0, derivation)


def _reading(bench: BoundBench, output: str, quantity: str) -> Callable[[], Figure]:
    role = bench.roles[output]

    def read() -> Figure:
        figure: Figure = getattr(role, quantity)()
        return figure

    return read


def _derived_reading(bench: BoundBench, limit: EnvelopeLimit, derivation: Derivation) -> Callable[[], Figure]:
    sources = [_reading(bench, output, quantity) for output, quantity in derivation.sources]

    def read() -> Figure:
        numbers = [source().value for source in sources]
        return Figure(value=derivation.row(bench.clock.now_ns(), numbers), unit=limit.unit)

    return read
