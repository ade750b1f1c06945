"""The register of units under test, `fixtures/duts.yaml`: who they are, and what has been done to them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from hil.clock.wall import is_date
from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused
from hil.model.identity import Dut, UnitEvent
from hil.model.notation import Path as Keys

__all__ = ["DUTS", "find_dut", "load_duts"]

DUTS = "duts.yaml"
"""The file's name, in the folder of fixtures."""

_SCHEMA = "hil/duts/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Register:
    """The file of the register."""

    duts: tuple[Dut, ...]


def load_duts(path: Path, shown: str, findings: Findings) -> tuple[Dut, ...]:
    """Read the register and add what is wrong to the findings.

    Args:
        path: the file.
        shown: its path as shown to a person.
        findings: where all errors are noted.
    """
    document = read_document(path, shown, findings, _Register, schema=_SCHEMA)
    if document is None:
        return ()
    duts: dict[str, Dut] = {}
    spelled: dict[str, str] = {}
    for index, dut in enumerate(document.model.duts):
        at: Keys = ("duts", index)
        first = spelled.setdefault(dut.serial.casefold(), dut.serial)
        if dut.serial and (dut.serial in duts or first != dut.serial):
            told = "twice" if first == dut.serial else f"as '{first}' already"
            findings.add(document.place((*at, "serial")), f"serial number '{dut.serial}' is in the register {told}")
        duts.setdefault(dut.serial, dut)
        for number, event in enumerate(dut.events):
            for key, problem in _problems(event):
                findings.add(document.place((*at, "events", number, key)), f"{dut.serial}: {problem}")
    return tuple(duts.values())


def _problems(event: UnitEvent) -> Iterator[tuple[str, str]]:
    """Yield the errors of an event: key and sentence."""
    for key, day in (("date", event.date), ("until", event.until)):
        if day and not is_date(day):
            yield key, f"the date {day} does not exist"
    if event.until and event.until < event.date:
        yield "until", f"the {event.kind} ends on {event.until}, before it begins on {event.date}"
    if not event.reverify and not event.reference:
        yield (
            "reverify",
            f"the {event.kind} of {event.date} leaves earlier evidence valid: give the reference that decided so",
        )


def find_dut(duts: tuple[Dut, ...], serial: str, shown: str) -> Dut:
    """Return the device of that serial number.

    Raises:
        Refused: if it is not in the register.
    """
    for dut in duts:
        if dut.serial == serial:
            return dut
    known = [dut.serial for dut in duts]
    if not serial:
        raise Refused(
            "no device under test is named", f"add --dut SERIAL; {shown} has {', '.join(known) or 'none yet'}"
        )
    raise Refused(
        f"no device under test '{serial}' in {shown}{did_you_mean(serial, known)}",
        f"registered are: {', '.join(known) or 'none'}",
    )
