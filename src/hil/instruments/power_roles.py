"""Roles of a power bench besides supplies: multimeter, thermometer, electronic load."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.roles import Switched
from hil.instruments.sampled import Sampled
from hil.model.figure import Figure

__all__ = ["ELECTRONIC_LOAD", "MULTIMETER", "THERMOMETER", "ElectronicLoad", "Multimeter", "Thermometer"]


class Multimeter(Sampled, Protocol):
    """A multimeter wired for one quantity; the wire sets quantity, range and integration time.

    That quantity is its only channel. Reading another is refused: the leads are not connected for it.
    """

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Measure the DC voltage in V; not observable on overload."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Measure the DC current in A; not observable on overload."""
        ...

    @reads
    def resistance(self) -> Annotated[Figure, "ohm"]:
        """Measure the two-wire resistance in ohm; not observable on overload."""
        ...


class Thermometer(Sampled, Protocol):
    """A temperature sensor: channel temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor with the wiring's settings, and wait for its first valid sample."""
        ...

    @drives
    def stop(self) -> None:
        """Put the sensor to sleep."""
        ...

    @reads
    def temperature(self) -> Annotated[Figure, "degC"]:
        """Return the next temperature in degC."""
        ...


class ElectronicLoad(Switched, Protocol):
    """The input of an electronic load, which sinks current from the connected source.

    A mode can be selected only if the bench file clamps its quantity, so that a mistake in a case cannot exceed it.
    """

    @drives
    def constant_current(self, current: Annotated[float, "A"]) -> None:
        """Sink a constant current [A]; mode and level are read back."""
        ...

    @drives
    def constant_resistance(self, resistance: Annotated[float, "ohm"]) -> None:
        """Act as a constant resistance [ohm]; mode and level are read back."""
        ...

    @drives
    def constant_power(self, power: Annotated[float, "W"]) -> None:
        """Sink a constant power [W]; mode and level are read back."""
        ...

    @drives
    def constant_voltage(self, voltage: Annotated[float, "V"]) -> None:
        """Sink as much current as holds the voltage at this level [V]; mode and level are read back."""
        ...

    @reads
    def mode(self) -> str:
        """Return `CC`, `CR`, `CP` or `CV`."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the measured voltage in V; NaN where the instrument has no reading."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the measured current in A; NaN where the instrument has no reading."""
        ...

    @reads
    def power(self) -> Annotated[Figure, "W"]:
        """Return the measured power in W; NaN where the instrument has no reading."""
        ...

    @reads
    def resistance(self) -> Annotated[Figure, "ohm"]:
        """Return measured voltage over measured current in ohm; NaN where the instrument has no reading."""
        ...


ELECTRONIC_LOAD = Role(
    name="electronic_load",
    protocol=ElectronicLoad,
    quantities={"voltage": "V", "current": "A", "power": "W", "resistance": "ohm"},
    states={"off": "disable"},
    hazardous=True,
    clamped=("current",),
    proven=True,
)

MULTIMETER = Role(
    name="multimeter", protocol=Multimeter, quantities={"voltage": "V", "current": "A", "resistance": "ohm"}
)

THERMOMETER = Role(
    name="thermometer", protocol=Thermometer, quantities={"temperature": "degC"}, states={"asleep": "stop"}
)
