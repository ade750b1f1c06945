"""The role of a thermometer."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.sampled import Sampled
from hil.model.figure import Figure

__all__ = ["THERMOMETER", "Thermometer"]


class Thermometer(Sampled, Protocol):
    """A sensor of one temperature: channel temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor at the averaging of the wiring, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the sensor into shutdown."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the next temperature in degC."""
        ...


THERMOMETER = Role(
    name="thermometer", protocol=Thermometer, quantities={"temperature": "degC"}, states={"asleep": "stop"}
)
