"""Checks of the numbers in a bench file: ratings, clamps, levels, certificates, envelope, safe-off."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from hil.bench.derived.derivation import INTEGRALS, TIMES, UNITS
from hil.bench.file.complaints import Complaints, known, listed, named, quantities_told, quantity, quantity_of
from hil.clock.wall import is_date
from hil.documents.suggest import did_you_mean
from hil.instruments.registry import ROLES, inputs_of, quantity_units, role_of, unit_of
from hil.model.bench import BenchSpec, Clamp, Proof, ReducedLevel, SafeStep, Wire
from hil.model.envelope import MADE_OF, EnvelopeLimit
from hil.model.notation import Path

__all__ = [
    "air",
    "certificates",
    "clamped_levels",
    "clamps",
    "covered",
    "envelope",
    "rated",
    "ratings",
    "reduced_levels",
    "safe_steps",
]

_NEEDED = {
    **dict.fromkeys(INTEGRALS, ("while", "threshold", "since")),
    "slope": ("of", "over"),
    "unchanged": ("of", "band"),
}
_FLOW = ("while", "threshold")
_ALLOWED = {**dict.fromkeys(INTEGRALS, ()), "slope": _FLOW, "unchanged": _FLOW}
_OF_WHAT_IS_READ = (*_FLOW, "against")


def _derived(spec: BenchSpec, at: Path, limit: EnvelopeLimit) -> Complaints:
    """Check one limit on a derived quantity."""
    inputs = _inputs(spec, limit.output)
    if limit.quantity in MADE_OF:
        yield from _unit(at, limit, inputs)
    elif inputs:
        yield from quantity_of(at, limit.output, limit.quantity, limit.unit, inputs)
    else:
        units = quantity_units()
        yield from known(at, "quantity", limit.quantity, (*units, *MADE_OF))
        if limit.quantity in units:
            yield from quantity_of(at, limit.output, limit.quantity, limit.unit)
    sources = _of_inputs(limit, inputs) if inputs else _sources(spec, limit)
    for problem in (*_keys(limit), *sources, *_numbers(limit)):
        yield at, f"{limit.id}: {problem}"


def air(spec: BenchSpec) -> Complaints:
    """Check that nothing is cooled below the dew point of the air around it, if the bench measures that."""
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
    """Check the keys of a limit: those that its quantity needs, and none that it does not take."""
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


def _unit(at: Path, limit: EnvelopeLimit, inputs: Mapping[str, str]) -> Complaints:
    if limit.quantity == "slope":
        unit = (
            inputs.get(limit.of)
            or unit_of(limit.output, limit.of)
            or next(iter(quantity_units().get(limit.of, ())), "")
        )
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
    """Check that the sources of a derived quantity exist."""
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
        yield f"{limit.against} has no {limit.quantity}: {quantities_told(other)}"


def _of_inputs(limit: EnvelopeLimit, inputs: Mapping[str, str]) -> Iterator[str]:
    """Check a quantity derived from the inputs that a wire names: it takes one, and none is known to be a current."""
    if limit.of and limit.of not in inputs:
        yield f"{limit.output} has no {limit.of}: its wire names {', '.join(inputs)}"
    if limit.quantity in INTEGRALS or limit.flow:
        yield f"no input of {limit.output} is known to be a current: limit a slope, or the time unchanged"
    if limit.against:
        yield f"an input of {limit.output} cannot be held against another output: give each a limit of its own"


def _numbers(limit: EnvelopeLimit) -> Iterator[str]:
    if limit.quantity in (*INTEGRALS, "unchanged"):
        if limit.minimum is not None:
            yield f"{limit.quantity} begins at zero, it takes no min"
        if limit.maximum is not None and limit.maximum <= 0:
            yield f"the max of {limit.quantity} must be above zero"
    if limit.quantity == "slope" and not (limit.minimum or 0.0) <= 0 <= (limit.maximum or 0.0):
        yield "what does not change has a slope of zero, so min and max must let it be"


def ratings(spec: BenchSpec) -> Complaints:
    """Check that clamps can be compared with every rating."""
    for path, item in named(spec.instruments, "instruments"):
        for at, rating in listed("ratings", item.ratings):
            yield from quantity((*path, *at), rating.quantity, rating.unit)


def certificates(spec: BenchSpec) -> Complaints:
    """Check that the due date of every calibration exists, and that none of its ranges is empty."""
    for path, item in named(spec.instruments, "instruments"):
        if item.register:
            continue  # the register was checked when it was read
        if item.calibration and item.calibration.due and not is_date(item.calibration.due):
            yield (*path, "calibration", "due"), f"calibration: the date {item.calibration.due} does not exist"
        for at, entry in listed("ranges", item.calibration.ranges if item.calibration else ()):
            if entry.low > entry.high:
                span = f"{item.name}: the range begins at {entry.low:g} {entry.unit} and ends below, at {entry.high:g}"
                yield (*path, "calibration", *at), f"{span}; exchange from and to"


def clamps(spec: BenchSpec) -> Complaints:
    """Check the outputs, quantities and bounds of clamps."""
    for at, clamp in listed("clamps", spec.clamps):
        yield from known(at, "output", clamp.output, _outputs(spec))
        yield from quantity_of(at, clamp.output, clamp.quantity, clamp.unit)
        if clamp.minimum > clamp.maximum:
            yield at, f"{clamp.output}: min {clamp.minimum:g} is above max {clamp.maximum:g}"


def rated(spec: BenchSpec) -> Complaints:
    """Check that no clamp allows more than the instrument's rating."""
    for at, clamp in listed("clamps", spec.clamps):
        for rating in _ratings_of(spec, clamp):
            if (largest := max(abs(clamp.minimum), abs(clamp.maximum))) > rating:
                beyond = f"{largest:g} {clamp.unit} exceeds the rating {rating:g} {clamp.unit}"
                yield at, f"{clamp.output}: a clamp at {beyond}"


def _ratings_of(spec: BenchSpec, clamp: Clamp) -> list[float]:
    wire = next((wire for wire in spec.wiring if wire.name == clamp.output), None)
    instrument = next((item for item in spec.instruments if wire and item.name == wire.instrument), None)
    if wire is None or instrument is None:
        return []
    return [
        rating.maximum
        for rating in instrument.ratings
        if rating.quantity == clamp.quantity and rating.channel in {0, wire.channel}
    ]


def reduced_levels(spec: BenchSpec) -> Complaints:
    """Check that arm can try every reduced level, and that it would show something."""
    for at, wire in listed("wiring", spec.wiring):
        if wire.reduced is not None:
            for problem in _level_problems(spec, wire, wire.reduced):
                yield at, f"{wire.name}: {problem}"


def clamped_levels(spec: BenchSpec) -> Complaints:
    """Check that every reduced level is inside the clamps of its output."""
    for at, wire in listed("wiring", spec.wiring):
        level = wire.reduced
        for clamp in spec.clamps if level is not None else ():
            setting = {"voltage": level.voltage, "current": level.current}.get(clamp.quantity) if level else None
            if clamp.output == wire.name and setting is not None and not clamp.minimum <= setting <= clamp.maximum:
                bounds = f"{clamp.minimum:g} to {clamp.maximum:g} {clamp.unit}"
                beyond = f"the reduced {clamp.quantity} {setting:g} {clamp.unit} is outside its clamp {bounds}"
                yield at, f"{wire.name}: {beyond}"


def _level_problems(spec: BenchSpec, wire: Wire, level: ReducedLevel) -> Iterator[str]:
    if wire.role != "supply":
        yield "only a supply has a reduced level"
    if level.lowest_current > level.highest_current:
        yield f"lowest_current {level.lowest_current:g} is above highest_current {level.highest_current:g}"
    yield from _position_problems(spec, level)


def _position_problems(spec: BenchSpec, level: ReducedLevel) -> Iterator[str]:
    if level.positions and level.lowest_current <= 0:
        yield "with positions, lowest_current must be above 0, or no position would show anything"
    contacts = {wire.name: wire.contacts for wire in spec.wiring if wire.role == "relays"}
    made_safe = {step.output for step in spec.safe_off}
    for position in level.positions:
        if position.relays and position.relays not in contacts:
            yield f"unknown relays '{position.relays}'{did_you_mean(position.relays, contacts)}"
            continue
        for contact in position.closed:
            if contact not in contacts.get(position.relays, ()):
                hint = did_you_mean(contact, contacts[position.relays])
                yield f"{position.relays} has no contact '{contact}'{hint}"
        if position.relays and position.relays not in made_safe:
            yield f"{position.relays} is missing from safe_off, so nothing would undo a position"


def envelope(spec: BenchSpec) -> Complaints:
    """Check that every limit of the envelope can be watched."""
    seen: set[str] = set()
    for at, limit in listed("envelope", spec.envelope):
        yield from known(at, "output", limit.output, _outputs(spec))
        if limit.is_derived:
            yield from _derived(spec, at, limit)
        else:
            yield from quantity_of(at, limit.output, limit.quantity, limit.unit, _inputs(spec, limit.output))
        for problem in _bound_problems(limit):
            yield at, f"{limit.id}: {problem}"
        if limit.id and limit.id in seen:
            yield at, f"the envelope has two limits called '{limit.id}'"
        seen.add(limit.id)


def _inputs(spec: BenchSpec, output: str) -> Mapping[str, str]:
    wire = next((wire for wire in spec.wiring if wire.name == output), None)
    item = next((item for item in spec.instruments if wire and item.name == wire.instrument), None)
    return inputs_of(item.driver, wire) if wire and item else {}


def _bound_problems(limit: EnvelopeLimit) -> Iterator[str]:
    if limit.minimum is None and limit.maximum is None:
        yield "a limit needs min, max or both"
    elif limit.minimum is not None and limit.maximum is not None and limit.minimum > limit.maximum:
        yield f"min {limit.minimum:g} is above max {limit.maximum:g}"
    if limit.max_age_s < 2 * limit.period_s:
        yield "max_age must be at least twice the period"


def safe_steps(spec: BenchSpec) -> Complaints:
    """Check that every line of safe-off, rest and hold can be executed, and its proof read."""
    steps = (*listed("safe_off", spec.safe_off), *listed("rest", spec.rest), *listed("hold", spec.hold))
    for at, step in steps:
        yield from known(at, "output", step.output, _outputs(spec))
        role = role_of(step.output)
        if role and role.states:
            yield from known(at, "state", step.state, role.states)
        if step.proof:
            yield from _proof(at, step, step.proof, _outputs(spec))


def _proof(at: Path, step: SafeStep, proof: Proof, outputs: Collection[str]) -> Complaints:
    yield from known(at, "output", proof.output, outputs)
    yield from quantity_of(at, proof.output, proof.quantity, proof.unit)
    if proof.minimum > proof.maximum:
        yield at, f"proof of {step.output}: min {proof.minimum:g} is above max {proof.maximum:g}"


def covered(spec: BenchSpec) -> Complaints:
    """Check that every output that can do harm is in the safe-off, clamped and proven as its role requires."""
    made_safe = {step.output for step in spec.safe_off}
    proven = {step.output for step in spec.safe_off if step.proof}
    for at, wire in listed("wiring", spec.wiring):
        role = ROLES.find(wire.role)
        if role is None:
            continue
        if role.hazardous and wire.name not in made_safe:
            yield at, f"{wire.name} is missing from safe_off"
        elif role.proven and wire.name not in proven:
            yield at, f"{wire.name}: its line in safe_off needs a proof, such as its current near zero"
        clamped = {clamp.quantity for clamp in spec.clamps if clamp.output == wire.name}
        if not clamped.issuperset(role.clamped):
            yield at, f"{wire.name} needs clamps for {' and '.join(role.clamped)}"


def _outputs(spec: BenchSpec) -> list[str]:
    return [wire.name for wire in spec.wiring]
