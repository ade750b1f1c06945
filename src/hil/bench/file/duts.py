"""The register of devices under test."""

from __future__ import annotations

from pathlib import Path

from hil.documents.findings import Findings
from hil.documents.reader import MappingReader, read_document
from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused
from hil.model.identity import Dut, Model

__all__ = ["SCHEMA", "find_dut", "load_duts"]

SCHEMA = "hil/duts/1"


def load_duts(path: Path, shown: str, findings: Findings) -> tuple[Dut, ...]:
    """Read the register and add what is wrong to the findings."""
    document = read_document(path, shown, findings, schema=SCHEMA)
    if document is None:
        return ()
    duts: dict[str, Dut] = {}
    for reader in document.children("duts", required=True):
        dut = _dut(reader)
        if dut.serial and dut.serial in duts:
            findings.add(reader.place("serial"), f"serial number '{dut.serial}' is in the register twice")
        duts.setdefault(dut.serial, dut)
    document.done()
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


def _dut(reader: MappingReader) -> Dut:
    recognised = reader.child("recognised")
    devices = recognised.keys() if recognised else ()
    dut = Dut(
        serial=reader.text("serial", pattern="[A-Za-z0-9][A-Za-z0-9._-]*"),
        part=reader.text("part"),
        model=Model(reader.text("model", choices=tuple(Model)) or Model.EM),
        hardware=reader.text("hardware"),
        firmware=reader.text("firmware", ""),
        title=reader.text("title", ""),
        simulated=reader.flag("simulated", default=False),
        recognised={device: recognised.text(device) for device in devices} if recognised else {},
    )
    reader.done()
    return dut
