"""What must hold where a supply charges a battery: two guards against too high a voltage."""

from __future__ import annotations

from collections.abc import Iterator

from hil.bench.file.complaints import Complaints, known, listed
from hil.instruments.capabilities import OVER_VOLTAGE_LEVEL, offers
from hil.instruments.registry import DRIVERS
from hil.model.bench import BenchSpec, Wire

__all__ = ["charging"]


def charging(spec: BenchSpec) -> Complaints:
    """Check that every battery has a charger, and that something besides its setting keeps the voltage down.

    The first guard is the supply's own over-voltage protection. Where that has no level of its own, which a wrong
    setting would raise with it, the cycler's measurement in the envelope has to be the guard.
    """
    cyclers = [wire.name for wire in spec.wiring if wire.role == "cycler"]
    charged = {wire.charges for wire in spec.wiring}
    for at, wire in listed("wiring", spec.wiring):
        if wire.role == "cycler" and wire.name not in charged:
            yield at, f"{wire.name}: no supply charges its battery; write 'charges: {wire.name}' at the one that does"
        if wire.charges:
            yield from known(at, "cycler", wire.charges, cyclers)
            for problem in _problems(spec, wire):
                yield at, f"{wire.name} {problem}"


def _problems(spec: BenchSpec, wire: Wire) -> Iterator[str]:
    if wire.role != "supply":
        yield "charges nothing: only a supply does"
        return
    drivers = [item.driver for item in spec.instruments if item.name == wire.instrument]
    if not drivers or drivers[0] not in DRIVERS:
        return
    if offers(DRIVERS[drivers[0]], OVER_VOLTAGE_LEVEL):
        if "over_voltage" not in wire.settings:
            yield "charges a battery: give it the setting over_voltage, little above the highest voltage of the battery"
    elif not _measured(spec, wire.charges):
        yield (
            f"charges a battery, and a {drivers[0]} has no over-voltage protection with a level of its own: add a"
            f" second guard, a limit of the envelope with max on the voltage of {wire.charges}"
        )


def _measured(spec: BenchSpec, cycler: str) -> bool:
    """Return whether the envelope holds the battery's voltage down."""
    return any(
        (limit.output, limit.quantity, limit.derived) == (cycler, "voltage", None) and limit.maximum is not None
        for limit in spec.envelope
    )
