"""The role of a power monitor."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.sampled import Sampled
from hil.model.figure import Figure

__all__ = ["POWER_MONITOR", "PowerMonitor"]


class PowerMonitor(Sampled, Protocol):
    """A chip on a rail: channels voltage in V and current in A."""

    @drives
    def start(self) -> None:
        """Wake the chip at the averaging of the wiring, and wait for its first sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the chip into power-down."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the next voltage in V."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the next current in A."""
        ...


POWER_MONITOR = Role(
    name="power_monitor",
    protocol=PowerMonitor,
    quantities={"voltage": "V", "current": "A"},
    states={"asleep": "stop"},
)
