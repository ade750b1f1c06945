"""Readiness: what arming checks and tries before a run relies on the bench."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from hil.bench.bound import BoundBench
from hil.bench.connections import stays_on
from hil.bench.cut_trials import cut_path_gates
from hil.bench.gate import Gate
from hil.bench.port_identity import difference_of
from hil.bench.safe_off import SafeResult, left_on
from hil.bench.self_test import self_test
from hil.instruments.cycler_role import Cycler
from hil.instruments.roles import Relays, Supply, Watched
from hil.model.bench import InstrumentSpec, Position, ReducedLevel, SafeStep, Wire
from hil.model.cutting import CutPath
from hil.model.errors import HilError
from hil.model.identity import Dut, Identity, Source
from hil.model.prefixed import prefixed

__all__ = ["energised_gates", "unpowered_gates"]

_SETTLE_S = 0.2
_VOLTAGE_TOLERANCE = 0.05
_LEAST_SHARE = 0.05
_LEAST_CELL_V = 0.5
"""Below this, a cell is reversed (a tester that cannot measure below zero reads zero), or there is none."""

_DEFECTS = (ArithmeticError, AttributeError, LookupError, NameError, RuntimeError, TypeError, ValueError, struct.error)
_GATE_FAILURES = (HilError, *_DEFECTS)
"""Errors that fail a gate: those of the bench, and defects of a third-party driver; a full disk is not one."""


def unpowered_gates(bench: BoundBench, dut: Dut | None = None) -> Iterator[Gate]:
    """Check without driving anything: identities, outputs found on, and battery polarity.

    Instruments that the bench itself feeds are identified later, under power.
    """
    for instrument in bench.spec.instruments:
        if not instrument.powered_by:
            yield _identity(bench, instrument, dut)
    if dut and dut.recognised and not dut.recognised.keys() & bench.drivers.keys():
        detail = f"it is recognised by {', '.join(sorted(dut.recognised))}, and this bench has no such instrument"
        yield Gate(f"identity of {dut.serial}", ok=False, detail=detail)
    yield from _found_on(bench)
    for wire in bench.spec.wiring:
        if wire.role == "cycler":
            yield _polarity(bench, wire)
    for path in bench.spec.cut_paths:
        if path.watchdog:
            yield _watchdog(bench, path)
    if kept := stays_on(bench.spec):
        yield Gate("if run and guardian end at once", ok=True, detail=_without_host(kept))


def energised_gates(bench: BoundBench, dut: Dut | None) -> Iterator[Gate]:
    """Make the bench safe, then try one output at a time at its reduced level, then the envelope.

    Whatever is tried is off again, and proven to be, when its gates are yielded. Nothing is tried on a bench
    that cannot be made safe, and nothing more once an output stayed on.
    """
    taken: list[SafeResult] = []
    stayed = left_on(bench.spec.safe_off, bench, taken.append)
    detail = "; ".join([*stayed, *_too_slow(bench.spec.safe_off, taken)])
    yield Gate("safe state reached", not stayed, detail or "every line of safe_off is proven")
    if stayed:
        return
    for wire in bench.spec.wiring:
        if wire.reduced is not None:
            gates, on = _reduced_level(bench, wire, wire.reduced, dut)
            yield from gates
            if on:
                yield Gate(f"{wire.name} off again", ok=False, detail=on)
                return
        elif wire.role == "supply":
            told = f"{wire.name} was not tried at a reduced level: its wire has none"
            yield Gate(f"reduced level of {wire.name}", ok=True, detail="not tried", unproven=told)
    for gate in cut_path_gates(bench):
        yield gate
        if not gate.ok:
            return
    for limit in bench.spec.envelope:
        trips = self_test(limit)
        detail = (
            "trips on a reading outside it, and not on one inside"
            if trips
            else "does not trip on the readings that it should"
        )
        yield Gate(f"envelope {limit.id}", trips, detail)


def _too_slow(lines: Sequence[SafeStep], taken: Sequence[SafeResult]) -> Iterator[str]:
    """Yield the lines whose time limit is shorter than they just took: after a run, that would be an unsafe bench."""
    for number, (line, result) in enumerate(zip(lines, taken, strict=True), 1):
        if result.late:
            needs = f"line {number} of safe_off needs at least {result.seconds:.3g} s with the replies of this bench"
            yield f"{needs}; it allows {line.within_s:g} s: give it more time with 'within'"


def _identity(bench: BoundBench, instrument: InstrumentSpec, dut: Dut | None) -> Gate:
    name = f"identity of {instrument.name}"
    try:
        found = bench.drivers[instrument.name].identify()
        difference = difference_of(instrument.identity, found) or _other_serial(instrument, found)
    except _GATE_FAILURES as error:
        return Gate(name, ok=False, detail=_message_of(error))
    if difference:
        return Gate(name, ok=False, detail=difference)
    expected = dut.recognised.get(instrument.name, "") if dut else ""
    if expected and expected not in {found.unmarked.serial, found.model}:
        return Gate(name, ok=False, detail=f"{found} answers, but the DUT is recognised by '{expected}'")
    return Gate(
        name,
        ok=True,
        detail=_who(instrument, found),
        instrument=instrument.name,
        unproven=_left_open(instrument, found),
        source=Source.SIMULATED if found.simulated else None,
    )


def _who(instrument: InstrumentSpec, found: Identity) -> str:
    """Return the identity that an instrument reports; one that cannot is known by its own USB device."""
    own = _own_device(instrument)
    return f"whatever is at the USB device {own}" if own and _says_nothing(found) else str(found)


def _own_device(instrument: InstrumentSpec) -> str:
    return instrument.usb.serial if instrument.usb else ""


def _says_nothing(found: Identity) -> bool:
    said = found.unmarked
    return not any((said.manufacturer, said.model, said.serial))


def _left_open(instrument: InstrumentSpec, found: Identity) -> str:
    """Return why it is not proven that this is the instrument whose certificate the bench has, empty if it is.

    For an instrument that cannot identify itself, a bench file that names its USB device by serial number is enough:
    the gate of its port compares that.
    """
    expected, said = instrument.identity, found.unmarked
    if _own_device(instrument) and _says_nothing(found):
        return ""
    if not any((expected.manufacturer, expected.model, expected.serial)):
        return f"the bench file does not say who {instrument.name} is"
    if _says_nothing(found):
        return f"{instrument.name} does not say who it is, and no serial number of a USB device stands for it"
    record = instrument.calibration
    if said.serial and record and not record.registered and not expected.serial:
        return f"{instrument.name} has the serial number {said.serial}, and the bench file does not name it"
    return ""


def _other_serial(instrument: InstrumentSpec, found: Identity) -> str:
    """Return a sentence if the serial number that an instrument reports is not the register's."""
    registered = instrument.calibration.registered if instrument.calibration else None
    if registered is None or found.simulated or found.serial in {"", registered.serial}:
        return ""
    return f"the certificate of {registered.id} is for serial '{registered.serial}', found '{found.serial}'"


def _message_of(error: Exception) -> str:
    return str(error) if isinstance(error, HilError) else f"{type(error).__name__} in the driver: {error}"


def _watchdog(bench: BoundBench, path: CutPath) -> Gate:
    """Compare the watchdog that the bench file counts on with the one that the wire's settings configure."""
    name, role = f"watchdog of {path.watchdog} for {path.output}", bench.roles[path.watchdog]
    seconds = role.watchdog_s if isinstance(role, Watched) else 0.0
    if not seconds:
        hint = "give its wire the setting beat" if isinstance(role, Watched) else "its driver offers none"
        return Gate(name, ok=False, detail=f"{path.watchdog} has no watchdog: {hint}")
    detail = f"opens {path.watchdog} {seconds:g} s after its last heartbeat"
    if seconds > path.within_s:
        return Gate(name, ok=False, detail=f"{detail}, and the cut path allows {path.within_s:g} s")
    return Gate(name, ok=True, detail=detail)


def _without_host(kept: Mapping[str, CutPath | None]) -> str:
    """Return what opens which output if the host is gone, and what stays on."""
    told = [f"{output} off within {path.within_s:g} s ({path.means})" for output, path in kept.items() if path]
    left = [output for output, path in kept.items() if path is None]
    return "; ".join([*told, *([f"STAYS ON until somebody comes: {', '.join(left)}"] if left else [])])


def _polarity(bench: BoundBench, wire: Wire) -> Gate:
    """Check a cell before anything is connected to it: a reversed one must not be charged."""
    name, cycler = f"polarity at {wire.name}", cast("Cycler", bench.roles[wire.name])
    try:
        if cycler.level() == "1":
            told = "not looked at: a device of level 1 measures in a test only"
            return Gate(name, ok=True, detail=told, unproven=f"the polarity at {wire.name} was {told}")
        volts = cycler.voltage().value
    except HilError as error:
        return Gate(name, ok=False, detail=str(error))
    detail = f"the cell has {volts:.3f} V"
    if volts >= _LEAST_CELL_V:
        return Gate(name, ok=True, detail=detail)
    return Gate(name, ok=False, detail=f"{detail}: is it reversed, is it connected, is its fuse whole?")


def _found_on(bench: BoundBench) -> Iterator[Gate]:
    """Report outputs found on: somebody else left them so; they are made safe, never taken over."""
    made_safe = [bench.spec.wire(step.output) for step in bench.spec.safe_off]
    safe_places = {
        (wire.instrument, place) for wire in made_safe for place in (wire.contacts.values() or (wire.channel,))
    }
    for name, driver in bench.drivers.items():
        if bench.spec.instrument(name).powered_by:
            continue
        try:
            on = [outlet.channel for outlet in driver.outlets() if outlet.on]
        except _GATE_FAILURES as error:
            yield Gate(f"outputs of {name}", ok=False, detail=_message_of(error))
            continue
        stray = [channel for channel in on if (name, channel) not in safe_places and (name, 0) not in safe_places]
        if stray:
            detail = f"on, and not wired here: channel {_listed(stray)}; switch it off by hand"
            yield Gate(f"outputs of {name}", ok=False, detail=detail)
        else:
            detail = f"found on: channel {_listed(on)}, safe-off comes before anything else" if on else "all off"
            yield Gate(f"outputs of {name}", ok=True, detail=detail)


def _listed(channels: Sequence[int]) -> str:
    return ", ".join(map(str, channels))


def _reduced_level(bench: BoundBench, wire: Wire, level: ReducedLevel, dut: Dut | None) -> tuple[list[Gate], str]:
    """Try one output in every position; return its gates, and why it is not off again, empty if it is."""
    gates: list[Gate] = []
    for position in level.positions or (None,):
        tried, stayed = _position(bench, wire, level, position, dut)
        gates += tried
        if stayed:
            return gates, stayed
    return gates, ""


def _position(
    bench: BoundBench, wire: Wire, level: ReducedLevel, position: Position | None, dut: Dut | None
) -> tuple[list[Gate], str]:
    """Try one output in one position; relays move before it is on, and are released after it is off."""
    supply = cast("Supply", bench.roles[wire.name])
    name = f"reduced level of {wire.name}{_described(position)}"
    gates: list[Gate] = []
    try:
        if position:
            _move(cast("Relays", bench.roles[position.relays]), position)
        supply.configure(level.voltage, level.current)
        supply.enable()
        bench.clock.sleep(_SETTLE_S)
        gates.append(_level_gate(name, supply, level, conducts=position is None or position.conducts))
        fed = [instrument for instrument in bench.spec.instruments if instrument.powered_by == wire.name]
        gates += [_identity(bench, instrument, dut) for instrument in fed]
    except _GATE_FAILURES as error:
        gates.append(Gate(name, ok=False, detail=_message_of(error)))
    finally:
        moved = {wire.name, position.relays} if position else {wire.name}
        stayed = "; ".join(left_on([step for step in bench.spec.safe_off if step.output in moved], bench))
    return gates, stayed


def _move(relays: Relays, position: Position) -> None:
    relays.release_all()
    for contact in position.closed:
        relays.close(contact)


def _described(position: Position | None) -> str:
    if position is None:
        return ""
    return f", {position.relays} {' and '.join(position.closed)} closed" if position.closed else ", relays released"


def _level_gate(name: str, supply: Supply, level: ReducedLevel, *, conducts: bool) -> Gate:
    voltage, current = supply.voltage().value, supply.current().value
    detail = f"{prefixed(voltage, 'V')}, {prefixed(current, 'A')}"
    # A load may hold an output in its current limit below the voltage that was set; a short or a wrong sign may not.
    near = abs(voltage - level.voltage) <= _VOLTAGE_TOLERANCE * level.voltage
    limited = supply.mode() == "CC" and _LEAST_SHARE * level.voltage <= voltage < level.voltage
    if not (near or limited):
        return Gate(name, ok=False, detail=f"{detail}, {level.voltage:g} V was set: short, polarity or wiring?")
    if not conducts:
        if abs(current) < level.lowest_current:
            return Gate(name, ok=True, detail=f"{detail}, nothing flows")
        return Gate(name, ok=False, detail=f"{detail}, and nothing should flow: a contact that is welded, or wiring?")
    if not level.lowest_current <= current <= level.highest_current:
        bounds = f"{level.lowest_current:g} to {level.highest_current:g} A"
        return Gate(name, ok=False, detail=f"{detail}, {bounds} expected: load, contacts or wiring?")
    return Gate(name, ok=True, detail=detail)
