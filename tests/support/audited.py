"""Worlds for the audit: a requirement that is closed, and everything by which it can be changed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import msgspec

from hil.audit.document import Document, Row
from hil.audit.engine import audit
from hil.audit.inputs import Approval, Asked, Instrument, Package, Register, Result, World
from hil.evidence.ledger.entries import Entry, Sealed
from hil.model.identity import Dut, Model, Purpose, Source
from hil.registers.instruments import AsFound, AsLeft, Certificate, RegisteredInstrument
from hil.registers.nonconformances import Nonconformance, Record, UnitName, Verification, Waiver

__all__ = [
    "ASKED",
    "DUT",
    "INSTRUMENT",
    "UNIT",
    "approval",
    "certificate",
    "changed_package",
    "closed_world",
    "codes",
    "package",
    "result",
    "row",
    "seal_of",
    "world_of",
]

ASKED = Asked(
    id="LOAD-010",
    rev=1,
    fingerprint="f" * 64,
    text="The load shall have 90 to 110 ohm.",
    kind="limit",
    method="test",
    parents=("EPS-001",),
    plan="load",
    part_numbers=("LOAD-1",),
    place="testplans/load/requirements.yaml:4",
)
PARENT = Asked(id="EPS-001", rev=1, fingerprint="e" * 64, text="There shall be a load.", kind="parent", method="test")
DUT = Dut(serial="FM-7", part="LOAD-1", model=Model.FM, hardware="B", firmware="1.0")
UNIT = UnitName(part=DUT.part, serial=DUT.serial)


def certificate(number: str, date: str, due: str, **changed: Any) -> Certificate:
    """Return a certificate that found and left its instrument in tolerance, but for what is changed."""
    fields: dict[str, Any] = {
        "number": number,
        "laboratory": "the laboratory",
        "file": f"certificates/{number}.txt",
        "sha256": "0" * 64,
        "date": date,
        "due": due,
        "as_found": AsFound.IN_TOLERANCE,
        "as_left": AsLeft.IN_TOLERANCE,
        "ranges": (),
    }
    return Certificate(**{**fields, **changed})


INSTRUMENT = RegisteredInstrument(
    id="dmm-1",
    maker="Keysight",
    model="34465A",
    serial="MY1",
    certificates=(certificate("C-1", "2026-01-10", "2027-01-10"),),
)


def result(**changed: Any) -> Result:
    """Return what a package says of a requirement that it closes, but for what is changed."""
    fields: dict[str, Any] = {
        "rev": 1,
        "fingerprint": ASKED.fingerprint,
        "verdict": "PASS",
        "failed": False,
        "eligible": True,
        "reasons": (),
        "cases": ("testplans/load/test_load.py::test_load",),
        "instruments": ("dmm",),
    }
    return Result(**{**fields, **changed})


def package(name: str = "run-1", day: str = "2026-06-01", **changed: Any) -> Package:
    """Return a package that closes LOAD-010, but for what is changed."""
    fields: dict[str, Any] = {
        "folder": name,
        "run": name,
        "sealed": True,
        "named": f"{name}-digest",
        "digest": f"{name}-digest",
        "source": Source.HARDWARE,
        "purpose": Purpose.ACCEPTANCE,
        "bench": "load",
        "began": f"{day}T10:00:00.000000Z",
        "ended": f"{day}T11:00:00.000000Z",
        "serial": DUT.serial,
        "part": DUT.part,
        "hardware": DUT.hardware,
        "firmware": DUT.firmware,
        "version": "1.0",
        "analysis": "a" * 64,
        "plans": ("load",),
        "instruments": {"dmm": Instrument(certificate="certificates/C-1.txt", entry="dmm-1")},
        "results": {ASKED.id: result()},
    }
    return Package(**{**fields, **changed})


def seal_of(item: Package, seq: int = 1) -> Sealed:
    """Return the ledger's entry of a package's seal."""
    return Sealed(
        seq=seq,
        utc=item.ended,
        run=item.run,
        evidence=item.digest or item.named,
        content="c",
        verdict="PASS",
        source=item.source,
        bench=item.bench,
        dut=item.serial,
    )


def world_of(packages: Sequence[Package], entries: Sequence[Entry] | None = None, **changed: Any) -> World:
    """Return a world with these packages, all of them known to the ledger unless its entries are given."""
    seals = [seal_of(each, seq) for seq, each in enumerate(packages, 1)] if entries is None else entries
    world = World(
        asked=(PARENT, ASKED),
        packages=tuple(packages),
        register=Register(duts={DUT.serial: DUT}, instruments={INSTRUMENT.id: INSTRUMENT}),
        entries=tuple(seals),
        analysis="a" * 64,
        date="2026-11-22",
        name="the workspace",
    )
    return replace(world, **changed)


def closed_world(**changed: Any) -> World:
    """Return a world in which LOAD-010 and its parent are closed, but for what is changed in its package."""
    return world_of([package(**changed)])


def row(world: World | Document, identifier: str = ASKED.id) -> Row:
    """Return the row of a requirement."""
    document = world if isinstance(world, Document) else audit(world)
    return next(each for each in document.rows if each.id == identifier)


def codes(world: World, identifier: str = ASKED.id) -> list[str]:
    """Return why a requirement is open, by codes; nothing if it is closed."""
    found = row(world, identifier)
    assert found.closed == (not found.reasons)
    return [str(reason.code) for reason in found.reasons]


def approval(of: Nonconformance | Waiver | Verification, **changed: Any) -> Approval:
    """Return a valid approval of a record by somebody else, in the role that it needs."""
    fields = {"record": of.id, "sha256": Record(of=of).sha256, "role": type(of).__name__.lower(), "principal": "bo@x"}
    return Approval(**{**fields, "utc": "2026-06-20T08:00:00Z", "seq": 5, **changed})


def changed_package(item: Package, **changed: Any) -> Package:
    """Return a package with changes."""
    return msgspec.structs.replace(item, **changed)
