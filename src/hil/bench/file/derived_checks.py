"""What must hold for limits of the envelope on derived quantities."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.derived.derivation import INTEGRALS, TIMES, UNITS
from hil.bench.file.complaints import Complaints, known, listed, quantity_of
from hil.documents.suggest import did_you_mean
from hil.instruments.registry import ROLES, quantity_units, role_of, unit_of
from hil.model.bench import BenchSpec, Wire
from hil.model.envelope import MADE_OF, EnvelopeLimit
from hil.model.notation import Path

__all__ = ["air", "derived"]

_NEEDED = {
    **dict.fromkeys(INTEGRALS, ("while", "threshold", "since")),
    "slope": ("of", "over"),
    "unchanged": ("of", "band"),
}
_FLOW = ("while", "threshold")
_ALLOWED = {**dict.fromkeys(INTEGRALS, ()), "slope": _FLOW, "unchanged": _FLOW}
_OF_WHAT_IS_READ = (*_FLOW, "against")
_DIRECTIONS = ("charging", "discharging")


def derived(spec: BenchSpec, at: Path, limit: EnvelopeLimit) -> Complaints:
    """Check one limit on a derived quantity."""
    if limit.quantity in MADE_OF:
        yield from _unit(at, limit)
    else:
        units = quantity_units()
        yield from known(at, "quantity", limit.quantity, (*units, *MADE_OF))
        if limit.quantity in units:
            yield from quantity_of(at, limit.output, limit.quantity, limit.unit)
    for problem in (*_keys(limit), *_sources(spec, limit), *_numbers(limit)):
        yield at, f"{limit.id}: {problem}"


def air(spec: BenchSpec) -> Complaints:
    """Check that nothing is cooled below the dew point of the air around it, where the bench knows that."""
    dew_point = spec.head.dew_point
    if dew_point is None:
        return
    lowest = f"the dew point {dew_point:g} degC"
    for at, wire in listed("wiring", spec.wiring):
        role = ROLES.find(wire.role)
        if role is None or "temperature" not in role.clamped:
            continue
        for where, clamp in listed("clamps", spec.clamps):
            if (clamp.output, clamp.quantity) == (wire.name, "temperature") and clamp.minimum < dew_point:
                allowed = f"its clamp allows {clamp.minimum:g} degC"
                yield where, f"{wire.name}: {allowed}, below {lowest}, at which water condenses"
        if not _guarded(spec, wire, dew_point):
            yield at, f"{wire.name}: the envelope needs a limit on its temperature, with min at {lowest} or above"


def _guarded(spec: BenchSpec, wire: Wire, lowest: float) -> bool:
    return any(
        (limit.output, limit.quantity, limit.is_derived) == (wire.name, "temperature", False)
        and limit.minimum is not None
        and limit.minimum >= lowest
        for limit in spec.envelope
    )


def _keys(limit: EnvelopeLimit) -> Iterator[str]:
    """What a quantity needs, what it takes besides, and nothing else."""
    given = limit.derivation
    needed = _NEEDED.get(limit.quantity, ())
    allowed = (*needed, *_ALLOWED.get(limit.quantity, _OF_WHAT_IS_READ))
    yield from (f"{limit.quantity} needs '{key}'" for key in needed if key not in given)
    yield from (f"{limit.quantity} takes no '{key}'" for key in given if key not in allowed)
    if "threshold" not in needed and ("while" in given) != ("threshold" in given):
        yield "'while' and 'threshold' belong together: from the threshold on, a current flows"
    if limit.quantity in INTEGRALS and limit.flow == "flowing":
        yield f"{limit.quantity} adds up in one direction: while is charging or discharging"
    if limit.flow and limit.quantity not in INTEGRALS and "current" in {limit.of, limit.quantity}:
        yield "a current cannot be the condition of its own limit"


def _unit(at: Path, limit: EnvelopeLimit) -> Complaints:
    if limit.quantity == "slope":
        unit = unit_of(limit.output, limit.of) or next(iter(quantity_units().get(limit.of, ())), "")
        if not unit:
            return
        base = {"degC": "K"}.get(unit, unit)
        name, units = f"slope of {limit.of}", [f"{base}/{time}" for time in TIMES]
    else:
        name, units = limit.quantity, list(UNITS[limit.quantity])
    if limit.unit and limit.unit not in units:
        listed = f"{', '.join(units[:-1])} or {units[-1]}"
        yield at, f"{name} is given in {listed} here, not in '{limit.unit}'{did_you_mean(limit.unit, units)}"


def _sources(spec: BenchSpec, limit: EnvelopeLimit) -> Iterator[str]:
    """What is derived needs what it is derived from."""
    role, units = role_of(limit.output), quantity_units()
    if limit.of and limit.of not in units:
        yield f"unknown quantity '{limit.of}'{did_you_mean(limit.of, units)}"
    made_of = {*MADE_OF.get(limit.quantity, ()), *({limit.of} & set(units)), *(("current",) if limit.flow else ())}
    for name in sorted(made_of) if role else ():
        if role and name not in role.quantities:
            yield f"{limit.output} has no {name}, of which this is made"
    outputs = [wire.name for wire in spec.wiring]
    if not limit.against:
        return
    other = role_of(limit.against)
    if limit.against not in outputs:
        yield f"unknown output '{limit.against}'{did_you_mean(limit.against, outputs)}"
    elif limit.against == limit.output:
        yield f"{limit.output} cannot be held against itself"
    elif limit.quantity in units and other and limit.quantity not in other.quantities:
        yield f"{limit.against} has no {limit.quantity}"


def _numbers(limit: EnvelopeLimit) -> Iterator[str]:
    if limit.quantity in (*INTEGRALS, "unchanged"):
        if limit.minimum is not None:
            yield f"{limit.quantity} begins at zero, it takes no min"
        if limit.maximum is not None and limit.maximum <= 0:
            yield f"the max of {limit.quantity} must be above zero"
    if limit.quantity == "slope" and not (limit.minimum or 0.0) <= 0 <= (limit.maximum or 0.0):
        yield "what does not change has a slope of zero, so min and max must let it be"
