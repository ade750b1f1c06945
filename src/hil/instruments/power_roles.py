"""Roles of a power bench beside its supplies: multimeter, thermometer, electronic load."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.roles import Switched
from hil.instruments.sampled import Sampled
from hil.model.figure import Figure

__all__ = ["ELECTRONIC_LOAD", "MULTIMETER", "THERMOMETER", "ElectronicLoad", "Multimeter", "Thermometer"]


class Multimeter(Sampled, Protocol):
    """One quantity at the terminals of a multimeter: its wire says which one, in which range, for how long.

    Its only channel is that quantity. Reading another one is refused: the leads are not connected for it.
    """

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Measure the direct voltage in V; not observable where it is beyond the range."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Measure the direct current in A; not observable where it is beyond the range."""
        ...

    @reads
    def resistance(self) -> Annotated[Figure, "ohm"]:
        """Measure the resistance in ohm with two wires; not observable where it is beyond the range."""
        ...


class Thermometer(Sampled, Protocol):
    """A sensor of one temperature: channel temperature in degC."""

    @drives
    def start(self) -> None:
        """Wake the sensor as the wiring says, and wait for its first valid sample."""
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
    """The input of an electronic load: it takes a current from whatever it is connected to.

    A mode can be chosen only if the bench file clamps its quantity, so that a slip in a case cannot ask for more.
    """

    @drives
    def constant_current(self, current: Annotated[float, "A"]) -> None:
        """Take a constant current [A]; mode and level are read back."""
        ...

    @drives
    def constant_resistance(self, resistance: Annotated[float, "ohm"]) -> None:
        """Be a resistor [ohm]; mode and level are read back."""
        ...

    @drives
    def constant_power(self, power: Annotated[float, "W"]) -> None:
        """Take a constant power [W]; mode and level are read back."""
        ...

    @drives
    def constant_voltage(self, voltage: Annotated[float, "V"]) -> None:
        """Take as much current as brings the voltage down to this one [V]; mode and level are read back."""
        ...

    @reads
    def mode(self) -> str:
        """Return `CC`, `CR`, `CP` or `CV`."""
        ...

    @reads
    def voltage(self) -> Annotated[Figure, "V"]:
        """Return the measured voltage in V; NaN where the instrument has no number."""
        ...

    @reads
    def current(self) -> Annotated[Figure, "A"]:
        """Return the measured current in A; NaN where the instrument has no number."""
        ...

    @reads
    def power(self) -> Annotated[Figure, "W"]:
        """Return the measured power in W; NaN where the instrument has no number."""
        ...

    @reads
    def resistance(self) -> Annotated[Figure, "ohm"]:
        """Return measured voltage over measured current in ohm; NaN where the instrument has no number."""
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
