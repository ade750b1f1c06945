"""Identities of instruments and of the device under test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Annotated

from hil.model.notation import AnyText, Flag, Text, matching

__all__ = ["DATE", "Day", "Dut", "Identity", "Model", "Purpose", "Source", "UnitEvent", "UnitEventKind"]

DATE = r"\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])"
"""Pattern of an ISO 8601 date; it allows 31 days in every month."""

Day = Annotated[str, matching(DATE, "a date such as 2027-09-30")]
"""A day of UTC, ISO 8601."""


class Source(StrEnum):
    """Source of bytes, declared from strongest to weakest evidence."""

    HARDWARE = "hardware"
    SIMULATED = "simulated"
    REPLAYED = "replayed"


class Purpose(StrEnum):
    """Purpose of a run; only the last two can close a requirement."""

    DEVELOPMENT = "development"
    COMMISSIONING = "commissioning"
    QUALIFICATION = "qualification"
    ACCEPTANCE = "acceptance"

    @property
    def closes(self) -> bool:
        """Whether a run for this purpose can close a requirement."""
        return self in {Purpose.QUALIFICATION, Purpose.ACCEPTANCE}


class Model(StrEnum):
    """Model of a DUT: engineering, qualification or flight model."""

    EM = "EM"
    QM = "QM"
    FM = "FM"


_MARK = "SIM"
"""Prefix of a simulated instrument's firmware; its serial number has `SIM-`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Identity reported by an instrument; empty strings for anything not reported.

    A simulated one is marked: its serial number begins with `SIM-`, its firmware with `SIM`, or it reports SIMULATED.
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
        """Whether it is marked as simulated."""
        words = (self.manufacturer, self.model, self.serial)
        named = any("SIMULATED" in word.upper() for word in words)
        return named or self.serial.startswith(f"{_MARK}-") or self._firmware_is_mark

    @property
    def unmarked(self) -> Identity:
        """The identity without its simulation mark, for comparison with a bench file."""
        firmware = "" if self._firmware_is_mark else self.firmware
        return replace(self, serial=self.serial.removeprefix(f"{_MARK}-"), firmware=firmware)

    @property
    def _firmware_is_mark(self) -> bool:
        return self.firmware.startswith(_MARK) or "SIMULATED" in self.firmware.upper()


class UnitEventKind(StrEnum):
    """Kind of event in the history of a unit under test."""

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
        kind: kind of event.
        date: UTC date on which it happened, or began.
        until: date on which it ended, empty if the same day.
        text: what was done and why.
        reference: the supporting record: a nonconformance report, a work order, a minute.
        reverify: whether it invalidates earlier evidence.
    """

    kind: UnitEventKind
    date: Day
    until: Annotated[str, matching(f"({DATE})?", "a date such as 2027-09-30")] = ""
    text: Text
    reference: AnyText = ""
    reverify: Flag

    @property
    def last(self) -> str:
        """The last day of the event."""
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
        recognised: per device of the bench, the expected reading that identifies this DUT.
        events: its history, in the order of the file.
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
