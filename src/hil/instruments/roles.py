"""Roles: what a case asks for, whichever instrument fills it.

A role's operations either drive the bench or read it. The decorators say which, because the
executive journals both, and issues only the last driving call again when a case is run again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar

from hil.model.figure import Figure

__all__ = ["ROLES", "STATES", "Channel", "Magnetometer", "Relays", "Sampled", "Supply", "drives", "reads"]

_Operation = TypeVar("_Operation", bound=Callable[..., object])


def drives(operation: _Operation) -> _Operation:
    """Mark an operation that changes the bench."""
    operation.effect = "drives"  # type: ignore[attr-defined]  # a mark on a function, read by the façade
    return operation


def reads(operation: _Operation) -> _Operation:
    """Mark an operation that only looks."""
    operation.effect = "reads"  # type: ignore[attr-defined]  # a mark on a function, read by the façade
    return operation


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of a sampled role: its name, and the unit of its numbers."""

    name: str
    unit: str


class Sampled(Protocol):
    """Anything that `record` can sample."""

    def channels(self) -> tuple[Channel, ...]:
        """Return the channels, in the order of a sample's numbers."""
        ...

    def sample(self) -> tuple[float, ...]:
        """Return the newest number of every channel; NaN where the device marks it invalid."""
        ...


class Supply(Protocol):
    """One output of a power supply. Volts and amperes."""

    @drives
    def configure(self, voltage: float, current: float) -> None:
        """Set the voltage [V] and the current limit [A]; both are read back."""
        ...

    @drives
    def enable(self) -> None:
        """Switch the output on; it is read back."""
        ...

    @drives
    def disable(self) -> None:
        """Switch the output off; it is read back."""
        ...

    @reads
    def enabled(self) -> bool:
        """Return whether the instrument says that the output is on."""
        ...

    @reads
    def voltage(self) -> Figure:
        """Return the measured voltage in V; NaN where the instrument has no number."""
        ...

    @reads
    def current(self) -> Figure:
        """Return the measured current in A; NaN where the instrument has no number."""
        ...

    @reads
    def mode(self) -> str:
        """Return `CV`, `CC`, `off` or `unregulated`."""
        ...


class Relays(Protocol):
    """A set of named relay contacts."""

    @drives
    def close(self, contact: str) -> None:
        """Energise one contact; it is read back."""
        ...

    @drives
    def open(self, contact: str) -> None:
        """Release one contact; it is read back."""
        ...

    @drives
    def release_all(self) -> None:
        """Release every contact of the board; they are read back."""
        ...

    @reads
    def closed(self) -> tuple[str, ...]:
        """Return the names of the energised contacts, sorted."""
        ...


class Magnetometer(Sampled, Protocol):
    """A three-axis magnetometer: channels x, y, z in uT and temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the range and rate of the wiring, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the sensor into power-down."""
        ...


ROLES: dict[str, type] = {"magnetometer": Magnetometer, "relays": Relays, "supply": Supply}
"""Every role by the name that bench files and cases use."""

STATES: dict[str, dict[str, str]] = {
    "magnetometer": {"asleep": "stop"},
    "relays": {"released": "release_all"},
    "supply": {"off": "disable"},
}
"""Per role the states that safe-off and rest may name, and the operation that leads there."""
