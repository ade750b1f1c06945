"""Roles of instruments that acquire or generate signals: data acquisition, oscilloscope, function generator."""

from __future__ import annotations

from typing import Annotated, Protocol

from hil.instruments.marks import begins, drives, reads
from hil.instruments.role import Role
from hil.instruments.roles import Switched
from hil.instruments.sampled import Captured, Streamed
from hil.model.figure import Figure

__all__ = [
    "DATA_ACQUISITION",
    "FUNCTION_GENERATOR",
    "OSCILLOSCOPE",
    "DataAcquisition",
    "FunctionGenerator",
    "Oscilloscope",
]


class DataAcquisition(Streamed, Protocol):
    """Several inputs, analogue and digital, scanned one after the other by one instrument.

    The wiring defines their names and units; a digital input is a byte, unit 1. A row of a recording has the time of
    its first input, and for every other one a channel `NAME_after`: its delay in s.
    """

    @reads
    def read(self, channel: str) -> Figure:
        """Read one input in its unit; not observable where it is open or on overload."""
        ...


class Oscilloscope(Captured, Protocol):
    """An oscilloscope or digitiser; the wiring defines the names and units of its channels.

    A case configures and arms it, provokes the event, and reads the capture with `record.capture`.
    """

    @drives
    def vertical(
        self,
        channel: str,
        scale: Annotated[float, "V or A"],
        offset: Annotated[float, "V or A"] = 0.0,
        coupling: str = "DC",
    ) -> None:
        """Set the scale per division, the value at mid-screen, and the coupling `DC`, `AC` or `GND`."""
        ...

    @drives
    def window(self, before: Annotated[float, "s"], after: Annotated[float, "s"], points: int = 6000) -> None:
        """Set the time captured before and after the trigger [s], and the minimum number of points."""
        ...

    @drives
    def trigger(self, source: str, level: Annotated[float, "V or A"], slope: str = "rising") -> None:
        """Set the trigger: source channel, level [V or A], and slope, `rising` or `falling`."""
        ...

    @begins
    def arm(self) -> None:
        """Arm for a single trigger; return once the pre-trigger time is captured."""
        ...

    @drives
    def halt(self) -> None:
        """Stop waiting."""
        ...

    @reads
    def status(self) -> str:
        """Return `armed`, `waiting`, `triggered` or `stopped`."""
        ...


class FunctionGenerator(Switched, Protocol):
    """One output of a function generator, for a high-impedance load."""

    @drives
    def configure(
        self,
        shape: str,
        frequency: Annotated[float, "Hz"],
        amplitude: Annotated[float, "V"],
        offset: Annotated[float, "V"] = 0.0,
    ) -> None:
        """Set `sine`, `square`, `ramp` or `dc`, frequency [Hz], peak-to-peak amplitude [V] and offset [V]."""
        ...

    @reads
    def peak(self) -> Annotated[Figure, "V"]:
        """Return the peak voltage of its settings [V], as a magnitude, whether or not it is on."""
        ...


DATA_ACQUISITION = Role(name="data_acquisition", protocol=DataAcquisition)

FUNCTION_GENERATOR = Role(
    name="function_generator",
    protocol=FunctionGenerator,
    quantities={"peak": "V"},
    states={"off": "disable"},
    hazardous=True,
    clamped=("peak",),
)

OSCILLOSCOPE = Role(name="oscilloscope", protocol=Oscilloscope, part="channel")
