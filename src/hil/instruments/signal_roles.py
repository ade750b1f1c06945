"""Roles of instruments that see or make signals: data acquisition, oscilloscope, function generator."""

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
    """Several inputs, analogue and digital, that one instrument reads one after the other.

    They have the names and units that the wiring gives them; a digital input is a byte, unit 1. A row of a recording
    has the time of its first input, and a channel `NAME_after` for each other one: how much later that was read, in s.
    """

    @reads
    def read(self, channel: str) -> Figure:
        """Read one input in its unit; not observable where it is open or beyond its range."""
        ...


class Oscilloscope(Captured, Protocol):
    """An oscilloscope or digitiser; its channels have the names and units that the wiring gives them.

    A case sets it up and arms it, makes happen what it is to see, and reads it with `record.capture`.
    """

    @drives
    def vertical(
        self,
        channel: str,
        scale: Annotated[float, "V or A"],
        offset: Annotated[float, "V or A"] = 0.0,
        coupling: str = "DC",
    ) -> None:
        """Set how much of the channel's unit a division is, what is at the screen's middle, and `DC`, `AC` or `GND`."""
        ...

    @drives
    def window(self, before: Annotated[float, "s"], after: Annotated[float, "s"], points: int = 6000) -> None:
        """Set how long before and after the trigger is captured [s], and how many points that are at least."""
        ...

    @drives
    def trigger(self, source: str, level: Annotated[float, "V or A"], slope: str = "rising") -> None:
        """Set what triggers: a channel, its level [V or A], and the slope, `rising` or `falling`."""
        ...

    @begins
    def arm(self) -> None:
        """Wait for one trigger from now on; returns once the time before the trigger is captured."""
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
    """One output of a function generator, into a high impedance."""

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
        """Return the largest voltage away from zero that its settings give [V], whether or not it is on."""
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
