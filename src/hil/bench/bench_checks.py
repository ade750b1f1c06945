"""What must hold between the sections of a bench file."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TypeVar

from hil.documents.findings import Findings
from hil.documents.node import Place
from hil.documents.suggest import did_you_mean
from hil.instruments.registry import driver_names
from hil.instruments.roles import ROLES, STATES
from hil.model.bench import BenchSpec, Clamp, EnvelopeLimit, InstrumentSpec, Proof, SafeStep, Wire

__all__ = ["QUANTITIES", "Located", "check_bench"]

QUANTITIES = {"voltage": "V", "current": "A"}
"""The quantities that clamps, envelope and proofs may name, and their unit."""

_HAZARDOUS = frozenset({"supply", "relays"})
_Thing = TypeVar("_Thing")


class Located:
    """Remembers where in the file each thing was read."""

    def __init__(self) -> None:
        self._places: dict[int, Place] = {}
        self._things: list[object] = []

    def keep(self, thing: _Thing, place: Place) -> _Thing:
        """Remember and return the thing."""
        self._places[id(thing)] = place
        self._things.append(thing)
        return thing

    def of(self, thing: object) -> Place:
        """Return the place of a thing that was kept."""
        return self._places[id(thing)]


def check_bench(spec: BenchSpec, places: Located, findings: Findings) -> None:
    """Add everything that does not fit together."""
    for check in (_instruments, _addresses, _wiring, _clamps, _envelope, _safe_steps, _covered, _twin):
        for thing, message in check(spec):
            findings.add(places.of(thing), message)


_Complaints = Iterator[tuple[object, str]]


def _instruments(spec: BenchSpec) -> _Complaints:
    drivers, buses, outputs = driver_names(), [bus.name for bus in spec.buses], [wire.name for wire in spec.wiring]
    for item in spec.instruments:
        yield from _known(item, "driver", item.driver, drivers)
        if bool(item.port) == bool(item.bus):
            yield item, f"{item.name} needs either a port or a bus with an address"
        if item.bus:
            yield from _known(item, "bus", item.bus, buses)
            if not 0x08 <= item.address <= 0x77:
                yield item, f"{item.name}: 0x{item.address:02X} is no 7-bit I2C address (0x08 to 0x77)"
        if item.powered_by:
            yield from _known(item, "output", item.powered_by, outputs)


def _addresses(spec: BenchSpec) -> _Complaints:
    seen: dict[str, InstrumentSpec] = {}
    for item in spec.instruments:
        key = f"bus {item.bus}, address 0x{item.address:02X}" if item.bus else f"port {item.port}"
        if key in seen:
            yield item, f"{item.name} and {seen[key].name} are both at {key}"
        seen.setdefault(key, item)


def _wiring(spec: BenchSpec) -> _Complaints:
    seen: dict[str, Wire] = {}
    taken: dict[tuple[str, int], Wire] = {}
    by_role: dict[str, set[str]] = {}
    for wire in spec.wiring:
        yield from _known(wire, "role", wire.role, ROLES)
        yield from _known(wire, "instrument", wire.instrument, [item.name for item in spec.instruments])
        if wire.name in seen:
            yield wire, f"{wire.name} is wired twice"
        by_role.setdefault(wire.role, set()).add(wire.instance)
        if "" in by_role[wire.role] and len(by_role[wire.role]) > 1:
            yield wire, f"role '{wire.role}' has several instances, so each needs an 'instance' name"
        place = (wire.instrument, wire.channel)
        if place in taken and not wire.contacts:
            yield wire, f"{wire.name} and {taken[place].name} are both on channel {wire.channel} of {wire.instrument}"
        seen.setdefault(wire.name, wire)
        taken.setdefault(place, wire)


def _clamps(spec: BenchSpec) -> _Complaints:
    for clamp in spec.clamps:
        yield from _known(clamp, "output", clamp.output, [wire.name for wire in spec.wiring])
        yield from _quantity(clamp, clamp.quantity, clamp.unit)
        if clamp.minimum > clamp.maximum:
            yield clamp, f"{clamp.output}: min {clamp.minimum:g} is above max {clamp.maximum:g}"
        for rating in _ratings(spec, clamp):
            if clamp.maximum > rating:
                beyond = f"{clamp.maximum:g} {clamp.unit} exceeds the rating {rating:g} {clamp.unit}"
                yield clamp, f"{clamp.output}: a clamp at {beyond}"


def _ratings(spec: BenchSpec, clamp: Clamp) -> list[float]:
    wire = next((wire for wire in spec.wiring if wire.name == clamp.output), None)
    instrument = next((item for item in spec.instruments if wire and item.name == wire.instrument), None)
    if wire is None or instrument is None:
        return []
    return [
        rating.maximum
        for rating in instrument.ratings
        if rating.quantity == clamp.quantity and rating.channel in {0, wire.channel}
    ]


def _envelope(spec: BenchSpec) -> _Complaints:
    seen: set[str] = set()
    for limit in spec.envelope:
        yield from _known(limit, "output", limit.output, [wire.name for wire in spec.wiring])
        yield from _quantity(limit, limit.quantity, limit.unit)
        yield from _bounds(limit)
        if limit.id in seen:
            yield limit, f"the envelope has two limits called '{limit.id}'"
        seen.add(limit.id)


def _bounds(limit: EnvelopeLimit) -> _Complaints:
    if limit.minimum is None and limit.maximum is None:
        yield limit, f"{limit.id}: a limit needs min, max or both"
    elif limit.minimum is not None and limit.maximum is not None and limit.minimum > limit.maximum:
        yield limit, f"{limit.id}: min {limit.minimum:g} is above max {limit.maximum:g}"
    if limit.max_age_s < 2 * limit.period_s or limit.period_s <= 0:
        yield limit, f"{limit.id}: max_age must be at least twice the period"
    if limit.debounce < 1:
        yield limit, f"{limit.id}: debounce counts readings, from 1"


def _safe_steps(spec: BenchSpec) -> _Complaints:
    for step in (*spec.safe_off, *spec.rest):
        names = [wire.name for wire in spec.wiring]
        yield from _known(step, "output", step.output, names)
        role = step.output.partition(".")[0]
        if role in STATES:
            yield from _known(step, "state", step.state, STATES[role])
        if step.proof:
            yield from _proof(step, step.proof, names)


def _proof(step: SafeStep, proof: Proof, names: Collection[str]) -> _Complaints:
    yield from _known(step, "output", proof.output, names)
    yield from _quantity(step, proof.quantity, proof.unit)
    if proof.minimum > proof.maximum:
        yield step, f"proof of {step.output}: min {proof.minimum:g} is above max {proof.maximum:g}"


def _covered(spec: BenchSpec) -> _Complaints:
    """Every output that can do harm is in the safe-off; a supply is proven by more than its word."""
    made_safe = {step.output for step in spec.safe_off}
    proven = {step.output for step in spec.safe_off if step.proof}
    for wire in spec.wiring:
        if wire.role in _HAZARDOUS and wire.name not in made_safe:
            yield wire, f"{wire.name} is missing from safe_off"
        elif wire.role == "supply" and wire.name not in proven:
            yield wire, f"{wire.name}: its line in safe_off needs a proof, such as its current near zero"


def _twin(spec: BenchSpec) -> _Complaints:
    if spec.simulated is None:
        return
    names = [item.name for item in spec.instruments]
    simulated = {peer.device for peer in spec.simulated.peers}
    for peer in spec.simulated.peers:
        yield from _known(peer, "instrument", peer.device, names)
    for item in spec.instruments:
        if item.name not in simulated:
            yield item, f"{item.name} has no peer in the simulated twin"
    for plant in spec.simulated.plants:
        if plant.grid_s <= 0:
            yield plant, f"plant {plant.name}: its grid must be longer than zero"


def _known(thing: object, what: str, name: str, known: Collection[str]) -> _Complaints:
    if name not in known:
        yield thing, f"unknown {what} '{name}'{did_you_mean(name, known)}"


def _quantity(thing: object, quantity: str, unit: str) -> _Complaints:
    yield from _known(thing, "quantity", quantity, QUANTITIES)
    if quantity in QUANTITIES and unit != QUANTITIES[quantity]:
        yield thing, f"{quantity} is given in {QUANTITIES[quantity]} here, not in '{unit}'"
