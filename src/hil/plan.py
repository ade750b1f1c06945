"""What cases and fixtures are written with besides their fixtures: numbers, errors, and the types to annotate with.

A name is looked up when it is asked for: collecting a plan loads no instrument.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.executive.cases.artifacts import Artifacts
    from hil.executive.cases.charts import Charts, Curve
    from hil.executive.cases.checks import Checks
    from hil.executive.cases.operator import Operator
    from hil.executive.cases.recorder import Recorder
    from hil.executive.cases.recording import Recording
    from hil.executive.cases.steps import Steps
    from hil.instruments.cycler_role import Cycler
    from hil.instruments.power_roles import ElectronicLoad, Multimeter, Thermometer
    from hil.instruments.roles import (
        Accelerometer,
        Gyroscope,
        Magnetometer,
        Obc,
        Relays,
        RotationTable,
        Supply,
        Thermal,
    )
    from hil.instruments.signal_roles import DataAcquisition, FunctionGenerator, Oscilloscope
    from hil.model.errors import Implausible, NoReply, NotInTime, NotMet, NotTriggered, Refused
    from hil.model.figure import Figure, FigureStatus

__all__ = [
    "Accelerometer",
    "Artifacts",
    "Charts",
    "Checks",
    "Curve",
    "Cycler",
    "DataAcquisition",
    "ElectronicLoad",
    "Figure",
    "FigureStatus",
    "FunctionGenerator",
    "Gyroscope",
    "Implausible",
    "Magnetometer",
    "Multimeter",
    "NoReply",
    "NotInTime",
    "NotMet",
    "NotTriggered",
    "Obc",
    "Operator",
    "Oscilloscope",
    "Recorder",
    "Recording",
    "Refused",
    "Relays",
    "RotationTable",
    "Steps",
    "Supply",
    "Thermal",
    "Thermometer",
]

_MODULES = {
    "executive.cases.artifacts": ("Artifacts",),
    "executive.cases.charts": ("Charts", "Curve"),
    "executive.cases.checks": ("Checks",),
    "executive.cases.operator": ("Operator",),
    "executive.cases.recorder": ("Recorder",),
    "executive.cases.recording": ("Recording",),
    "executive.cases.steps": ("Steps",),
    "instruments.cycler_role": ("Cycler",),
    "instruments.power_roles": ("ElectronicLoad", "Multimeter", "Thermometer"),
    "instruments.roles": (
        "Accelerometer",
        "Gyroscope",
        "Magnetometer",
        "Obc",
        "Relays",
        "RotationTable",
        "Supply",
        "Thermal",
    ),
    "instruments.signal_roles": ("DataAcquisition", "FunctionGenerator", "Oscilloscope"),
    "model.errors": ("Implausible", "NoReply", "NotInTime", "NotMet", "NotTriggered", "Refused"),
    "model.figure": ("Figure", "FigureStatus"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'hil.plan' has no attribute '{name}'")
    return getattr(import_module(f"hil.{_HOMES[name]}"), name)
