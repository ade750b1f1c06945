"""The register of devices under test."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused
from hil.model.identity import Dut

__all__ = ["SCHEMA", "find_dut", "load_duts"]

SCHEMA = "hil/duts/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Register:
    """The file of the register."""

    duts: tuple[Dut, ...]


def load_duts(path: Path, shown: str, findings: Findings) -> tuple[Dut, ...]:
    """Read the register and add what is wrong to the findings."""
    document = read_document(path, shown, findings, _Register, schema=SCHEMA)
    duts: dict[str, Dut] = {}
    for index, dut in enumerate(document.model.duts if document else ()):
        if document and dut.serial and dut.serial in duts:
            place = document.place(("duts", index, "serial"))
            findings.add(place, f"serial number '{dut.serial}' is in the register twice")
        duts.setdefault(dut.serial, dut)
    return tuple(duts.values())


def find_dut(duts: tuple[Dut, ...], serial: str, shown: str) -> Dut:
    """Return the article of that serial number.

    Raises:
        Refused: if it is not in the register.
    """
    for dut in duts:
        if dut.serial == serial:
            return dut
    known = [dut.serial for dut in duts]
    raise Refused(
        f"no device under test '{serial}' in {shown}{did_you_mean(serial, known)}",
        f"registered are: {', '.join(known) or 'none'}",
    )
