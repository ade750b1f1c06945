"""What an audit would report after a change of catalogue, register or analysis, before anything is committed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from hil.audit.inputs import Asked, Register, World
from hil.audit.reading import Folders, asked_of, documents_of
from hil.audit.recorded import REPORTS, VERIFICATIONS, WAIVERS, approvals_of, baseline
from hil.audit.remembered import INSTRUMENTS, UNITS
from hil.documents.findings import Findings, shown
from hil.documents.node import Scalar, node_at
from hil.documents.strict_yaml import read_yaml
from hil.evidence.ledger.book import Ledger
from hil.model.errors import Refused
from hil.model.identity import Dut
from hil.registers.instruments import RegisteredInstrument, load_instruments
from hil.registers.nonconformances import NONCONFORMANCES, Nonconformance, Verification, Waiver, load_records
from hil.registers.nonconformances import VERIFICATIONS as VERIFICATIONS_FILE
from hil.registers.nonconformances import WAIVERS as WAIVERS_FILE
from hil.registers.signers import load_signers
from hil.registers.units import load_duts
from hil.requirements.lock import read_lock
from hil.requirements.schema import REQUIREMENTS, read_requirements

__all__ = ["ANALYSIS", "suppose"]

ANALYSIS = "analysis"
"""Stands for a change of the analysis, which no file of the workspace holds."""

_KINDS = {
    "requirements": "requirements",
    "duts": UNITS,
    "instruments": INSTRUMENTS,
    "nonconformances": REPORTS,
    "waivers": WAIVERS,
    "verifications": VERIFICATIONS,
}
_FILED: Mapping[str, type[Nonconformance | Waiver | Verification]] = {
    REPORTS: Nonconformance,
    WAIVERS: Waiver,
    VERIFICATIONS: Verification,
}
_FILES = {f"{name}.yaml" for name in _KINDS if name != "requirements"}


def suppose(world: World, folders: Folders, changed: str) -> tuple[World, World]:
    """Return what an audit is computed from before a change and after it.

    A file in its place in the workspace is the change itself: a catalogue is compared with its lock, a register with
    what was entered into the ledger last. Any other file is taken in the place of the one of the same document.

    Args:
        world: the workspace as it is now; its locks need not agree.
        folders: its folders.
        changed: a file, or `ANALYSIS`.

    Raises:
        ConfigurationError: with all errors in the file.
        Refused: if it is none of the files that can be supposed, or there is nothing to compare it with.
    """
    if changed == ANALYSIS:
        return world, replace(world, analysis="another")
    file = Path(changed).resolve()
    kind = _kind(file, changed)
    if kind == "requirements":
        return _requirements(world, folders, file, changed)
    if kind in _FILED:
        return _records(world, folders, file, kind)
    return _register(world, folders, file, kind)


def _kind(file: Path, named: str) -> str:
    findings = Findings()
    root = read_yaml(file, named, findings)
    findings.raise_if_any()
    head = root and node_at(root, ("schema",))
    schema = head.text if isinstance(head, Scalar) else ""
    kind = _KINDS.get(schema.split("/")[1] if schema.count("/") == 2 else "")
    if kind is None:
        raise Refused(
            f"{named} is neither a requirements.yaml nor a register (schema '{schema}')",
            f"name a changed requirements.yaml or a register ({', '.join(sorted(_FILES))}), or say --if {ANALYSIS}",
        )
    return kind


def _requirements(world: World, folders: Folders, file: Path, named: str) -> tuple[World, World]:
    if file.name == REQUIREMENTS and folders.testplans.resolve() in {file.parent, file.parent.parent}:
        plan = file.parent.name if file.parent != folders.testplans.resolve() else ""
        return replace(world, asked=_as_locked(world.asked, file.parent, folders, plan)), world
    findings = Findings()
    plans = {each.document: each.plan for each in world.asked if each.plan}
    read = read_requirements(file, named, "supposed", findings)
    findings.raise_if_any()
    if read is None or read.document.id not in plans:
        known = ", ".join(sorted(each for each in plans if each)) or "none"
        raise Refused(
            f"{named}: no plan of this workspace has its document id '{read.document.id if read else ''}'",
            f"the documents are: {known}",
        )
    plan = plans[read.document.id]
    new = tuple(asked_of(item, read.document, read.part_numbers) for item in read.requirements)
    others = tuple(each for each in world.asked if each.plan != plan)
    return world, replace(world, asked=(*others, *(msgspec.structs.replace(each, plan=plan) for each in new)))


def _as_locked(asked: Sequence[Asked], folder: Path, folders: Folders, plan: str) -> tuple[Asked, ...]:
    """Return the requirements with the meanings that the lock of a plan has."""
    findings = Findings()
    locked = read_lock(folder, shown(folder, folders.root), findings)
    findings.raise_if_any()
    if locked is None:
        raise Refused(
            f"{shown(folder, folders.root)} has no lock, so its earlier meaning is unknown",
            "give the changed file under another name, outside of the plan",
        )
    return tuple(
        each
        if each.plan != plan
        else msgspec.structs.replace(each, rev=locked[each.id].rev, fingerprint=locked[each.id].fingerprint)
        for each in asked
        if each.plan != plan or each.id in locked
    )


def _register(world: World, folders: Folders, file: Path, kind: str) -> tuple[World, World]:
    in_place = file.parent == folders.fixtures.resolve()
    if in_place:
        return replace(world, register=_recorded(world, folders, kind)), world
    findings = Findings()
    named = shown(file, folders.root)
    if kind == UNITS:
        duts = load_duts(file, named, findings)
        register = replace(world.register, duts={each.serial: each for each in duts})
    else:
        register = replace(world.register, instruments=load_instruments(file, named, findings))
    findings.raise_if_any()
    return world, replace(world, register=register)


def _records(world: World, folders: Folders, file: Path, kind: str) -> tuple[World, World]:
    """Return the worlds before and after a change of reports, waivers or verifications.

    Only approvals of these contents count, and only documents that lie below the folder of fixtures.
    """
    if file.parent == folders.fixtures.resolve():
        items = baseline(folders.reports, world.entries, kind, _FILED[kind])
        if items is None:
            raise _nothing_recorded(kind)
        return _with(world, folders, kind, {each.id: each for each in items}), world
    findings = Findings()
    kinds = {each.id: each.kind for each in world.asked}
    with TemporaryDirectory() as place:  # a register is read by its name
        for name in (NONCONFORMANCES, WAIVERS_FILE, VERIFICATIONS_FILE):
            source = file if name == f"{kind}.yaml" else folders.fixtures / name
            if source.exists():
                (Path(place) / name).write_bytes(source.read_bytes())
        found = load_records(Path(place), findings, requirements=kinds, duts=world.register.duts)
    findings.raise_if_any()
    return world, _with(world, folders, kind, getattr(found, kind))


def _with(world: World, folders: Folders, kind: str, items: Mapping[str, Any]) -> World:
    """Return a world with other reports, waivers or verifications, and the approvals that these contents have."""
    records = replace(world.filed.registers, **{kind: items})
    ledger = Ledger(reports=folders.reports, entries=world.entries)
    approvals = approvals_of(ledger, world.packages, load_signers(folders.fixtures), records)
    documents = documents_of(folders.fixtures, records)
    return replace(world, filed=replace(world.filed, registers=records, approvals=approvals, documents=documents))


def _recorded(world: World, folders: Folders, kind: str) -> Register:
    """Return the registers with the one of a kind as it was entered into the ledger last."""
    if kind == UNITS:
        duts = baseline(folders.reports, world.entries, UNITS, Dut)
        if duts is not None:
            return replace(world.register, duts={each.serial: each for each in duts})
    else:
        known = baseline(folders.reports, world.entries, INSTRUMENTS, RegisteredInstrument)
        if known is not None:
            return replace(world.register, instruments={each.id: each for each in known})
    raise _nothing_recorded(kind)


def _nothing_recorded(kind: str) -> Refused:
    return Refused(
        f"the ledger has no {kind} to compare with",
        "hil audit --record enters the present register; or give the changed one under another name",
    )
