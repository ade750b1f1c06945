"""Who is who: instruments and the device under test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Annotated

from hil.model.notation import AnyText, Flag, Text, matching

__all__ = ["DATE", "Day", "Dut", "Identity", "Model", "Purpose", "Source", "UnitEvent", "UnitEventKind"]

DATE = r"\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])"
"""A day as files write it, ISO 8601; every month may have 31 days here."""

Day = Annotated[str, matching(DATE, "a date such as 2027-09-30")]
"""A day of UTC, ISO 8601."""


class Source(StrEnum):
    """Where bytes come from; declared from strongest to weakest evidence."""

    HARDWARE = "hardware"
    SIMULATED = "simulated"
    REPLAYED = "replayed"


class Purpose(StrEnum):
    """Why a run is made; only the last two can close a requirement."""

    DEVELOPMENT = "development"
    COMMISSIONING = "commissioning"
    QUALIFICATION = "qualification"
    ACCEPTANCE = "acceptance"

    @property
    def closes(self) -> bool:
        """Whether a run for this purpose can close a requirement."""
        return self in {Purpose.QUALIFICATION, Purpose.ACCEPTANCE}


class Model(StrEnum):
    """Which model of its kind a DUT is: engineering, qualification or flight model."""

    EM = "EM"
    QM = "QM"
    FM = "FM"


_MARK = "SIM"
"""How the firmware of a simulated instrument begins; its serial number does with `SIM-`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """What an instrument says of itself; an empty string if it does not say.

    A simulated one says so: its serial number begins with `SIM-`, its firmware with `SIM`, or it says SIMULATED.
    """

    manufacturer: AnyText = ""
    model: AnyText = ""
    serial: AnyText = ""
    firmware: AnyText = ""

    def __str__(self) -> str:
        told = " ".join(part for part in (self.manufacturer, self.model, self.serial) if part) or "nobody"
        return f"{told}, SIMULATED" if self.simulated and _MARK not in told.upper() else told

    @property
    def simulated(self) -> bool:
        """Whether it says that it is simulated."""
        words = (self.manufacturer, self.model, self.serial)
        named = any("SIMULATED" in word.upper() for word in words)
        return named or self.serial.startswith(f"{_MARK}-") or self._firmware_is_mark

    @property
    def unmarked(self) -> Identity:
        """What it would say if it were not simulated, as far as it is compared with what a bench file expects."""
        firmware = "" if self._firmware_is_mark else self.firmware
        return replace(self, serial=self.serial.removeprefix(f"{_MARK}-"), firmware=firmware)

    @property
    def _firmware_is_mark(self) -> bool:
        return self.firmware.startswith(_MARK) or "SIMULATED" in self.firmware.upper()


class UnitEventKind(StrEnum):
    """What was done to a unit under test, or what happened to it."""

    REPAIR = "repair"
    REWORK = "rework"
    REFURBISHMENT = "refurbishment"
    MAINTENANCE = "maintenance"
    DEMATE = "demate"
    DESIGN_CHANGE = "design-change"
    FIRMWARE_UPDATE = "firmware-update"
    STORAGE = "storage"
    FLIGHT_USE = "flight-use"
    OTHER = "other"


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitEvent:
    """One entry in the history of a unit under test.

    Attributes:
        kind: what it was.
        date: the day of UTC on which it happened, or began.
        until: the day on which it ended, empty if that is the same day.
        text: what was done and why.
        reference: the record that says so: a nonconformance report, a work order, a minute.
        reverify: whether evidence from before it has to be obtained again.
    """

    kind: UnitEventKind
    date: Day
    until: Annotated[str, matching(f"({DATE})?", "a date such as 2027-09-30")] = ""
    text: Text
    reference: AnyText = ""
    reverify: Flag

    @property
    def last(self) -> str:
        """The last day of it."""
        return self.until or self.date


@dataclass(frozen=True, slots=True, kw_only=True)
class Dut:
    """The device under test: one entry of `fixtures/duts.yaml`.

    Attributes:
        serial: its serial number, unique in the register.
        part: part number.
        model: EM, QM or FM.
        hardware: hardware revision.
        firmware: firmware revision, empty if it has none.
        title: what it is, in words.
        simulated: whether it exists in simulated benches only.
        recognised: per device of the bench, what must be read there for this DUT to be the one.
        events: what has been done to it, in the order of the file.
    """

    serial: Annotated[
        str,
        matching("[A-Za-z0-9][A-Za-z0-9._-]*", "letters, digits, '.', '_' and '-', beginning with a letter or a digit"),
    ]
    part: Text
    model: Model
    hardware: Text
    firmware: AnyText = ""
    title: AnyText = ""
    simulated: Flag = False
    recognised: Mapping[str, Text] = field(default_factory=dict)
    events: tuple[UnitEvent, ...] = ()
