"""Readiness: what arm looks at, and tries, before anybody relies on the bench."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

from hil.bench.binding import BoundBench
from hil.bench.envelope import self_test
from hil.bench.safe_off import make_safe
from hil.instruments.roles import Supply
from hil.model.bench import InstrumentSpec, ReducedLevel, Wire
from hil.model.errors import HilError
from hil.model.identity import Dut, Identity

__all__ = ["Gate", "energised_gates", "unpowered_gates"]

_SETTLE_S = 0.2
_VOLTAGE_TOLERANCE = 0.05


@dataclass(frozen=True, slots=True)
class Gate:
    """One condition of readiness, whether it holds, and what was seen."""

    name: str
    ok: bool
    detail: str


def unpowered_gates(bench: BoundBench) -> Iterator[Gate]:
    """Look without driving anything: identities, and outputs found on.

    Instruments that the bench itself feeds are identified later, under power.
    """
    for instrument in bench.spec.instruments:
        if not instrument.powered_by:
            yield _identity(bench, instrument, None)
    yield from _found_on(bench)


def energised_gates(bench: BoundBench, dut: Dut | None) -> Iterator[Gate]:
    """Make the bench safe, then try one output at a time at its reduced level, then the envelope.

    Whatever is tried is off again when its gate is given.
    """
    safe = True
    for step in bench.spec.safe_off:
        safe &= make_safe([step], bench.roles, bench.clock, lambda _: None)
    yield Gate("safe state reached", safe, "every line of safe_off is proven" if safe else "see the safe-off")
    for wire in bench.spec.wiring:
        if wire.reduced is not None:
            yield from _reduced_level(bench, wire, wire.reduced, dut)
    for limit in bench.spec.envelope:
        yield Gate(f"envelope {limit.id}", self_test(limit), "trips on what it must trip on, and only on that")


def _identity(bench: BoundBench, instrument: InstrumentSpec, dut: Dut | None) -> Gate:
    name = f"identity of {instrument.name}"
    try:
        found = bench.drivers[instrument.name].identify()
    except HilError as error:
        return Gate(name, ok=False, detail=str(error))
    if difference := _difference(instrument.identity, found):
        return Gate(name, ok=False, detail=difference)
    expected = dut.recognised.get(instrument.name, "") if dut else ""
    if expected and expected not in {found.serial, found.model}:
        return Gate(name, ok=False, detail=f"{found} answers, but DUT {dut.serial if dut else ''} is '{expected}'")
    return Gate(name, ok=True, detail=str(found))


def _difference(expected: Identity, found: Identity) -> str:
    for what in ("manufacturer", "model", "serial", "firmware"):
        wanted, got = getattr(expected, what), getattr(found, what)
        if wanted and wanted != got:
            return f"expected {what} '{wanted}', found '{got}'"
    return ""


def _found_on(bench: BoundBench) -> Iterator[Gate]:
    """An output found on is somebody else's state: it is reported and made safe, never taken over."""
    made_safe = [bench.spec.wire(step.output) for step in bench.spec.safe_off]
    safe_places = {
        (wire.instrument, place) for wire in made_safe for place in (wire.contacts.values() or (wire.channel,))
    }
    for name, driver in bench.drivers.items():
        if bench.spec.instrument(name).powered_by:
            continue
        try:
            on = [outlet.channel for outlet in driver.outlets() if outlet.on]
        except HilError as error:
            yield Gate(f"outputs of {name}", ok=False, detail=str(error))
            continue
        stray = [channel for channel in on if (name, channel) not in safe_places and (name, 0) not in safe_places]
        if stray:
            detail = f"channel {stray[0]} is on and not wired here: switch it off by hand"
            yield Gate(f"outputs of {name}", ok=False, detail=detail)
        else:
            detail = f"channels {on} found on, switched off" if on else "all off"
            yield Gate(f"outputs of {name}", ok=True, detail=detail)


def _reduced_level(bench: BoundBench, wire: Wire, level: ReducedLevel, dut: Dut | None) -> Iterator[Gate]:
    supply = cast("Supply", bench.roles[wire.name])
    name = f"reduced level of {wire.name}"
    try:
        supply.configure(level.voltage, level.current)
        supply.enable()
        bench.clock.sleep(_SETTLE_S)
        yield _level_gate(name, supply, level)
        for instrument in bench.spec.instruments:
            if instrument.powered_by == wire.name:
                yield _identity(bench, instrument, dut)
    except HilError as error:
        yield Gate(name, ok=False, detail=str(error))
    finally:
        _switch_off(supply)


def _level_gate(name: str, supply: Supply, level: ReducedLevel) -> Gate:
    voltage, current = supply.voltage().value, supply.current().value
    detail = f"{voltage:.4g} V, {current:.4g} A"
    limited = supply.mode() == "CC"
    near = abs(voltage - level.voltage) <= _VOLTAGE_TOLERANCE * level.voltage
    if not (near or (limited and voltage > 0)):
        return Gate(name, ok=False, detail=f"{detail}, {level.voltage:g} V was set: polarity or wiring?")
    if not level.lowest_current <= current <= level.highest_current:
        bounds = f"{level.lowest_current:g} to {level.highest_current:g} A"
        return Gate(name, ok=False, detail=f"{detail}, {bounds} expected: load or wiring?")
    return Gate(name, ok=True, detail=detail)


def _switch_off(supply: Supply) -> None:
    try:
        supply.disable()
    except HilError:
        # The gate already failed on the same silence; safe-off follows in any case and is judged.
        return
