"""Cross-checks of facts recorded twice in a package: in the frozen files, and in what was written about them."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

import msgspec

from hil.documents.canonical import canonical, parse_strict
from hil.documents.declared import validated
from hil.documents.findings import Findings
from hil.documents.node import Mapping as MappingNode
from hil.documents.node import Node, Scalar, ScalarKind, node_at
from hil.documents.node import Sequence as SequenceNode
from hil.documents.strict_yaml import read_yaml
from hil.evidence.durable import read_plain
from hil.evidence.events import Armed, Effect, Entry, Frozen, Gate, Resumed, Run
from hil.evidence.folder import CALIBRATION, CATALOGUE, JOURNAL, PARAMETERS, REGISTERS
from hil.evidence.package.listing import shown
from hil.evidence.results.derived import Sources
from hil.evidence.results.facts import (
    FrozenCalibration,
    FrozenRequirement,
    entries_of,
    frozen_calibration,
    read_json,
)
from hil.model.bench import Calibration
from hil.model.errors import EvidenceError, Finding
from hil.registers.instruments import INSTRUMENTS, load_instruments
from hil.registers.units import load_duts
from hil.requirements.lock import LOCK, locked_revs
from hil.requirements.parameters import PARAMETERS as PARAMETERS_FILE
from hil.requirements.parameters import Parameters, load_parameters
from hil.requirements.schema import REQUIREMENTS, parse_requirements

__all__ = ["LOOKS", "Look"]

_BENCH = "data/bench/bench.yaml"
_DUTS = "data/bench/duts.yaml"
_DUT = "data/dut.json"
_INSTRUMENTS = f"{REGISTERS}/{INSTRUMENTS}"
_PLANS = "data/catalogue"
_SOURCES = "data/sources"
_PLACE = "data/place.json"
_BENCH_ITSELF = "data/bench"
_MADE = frozenset({CALIBRATION, _DUTS})
"""Files among those of the bench that are not the bench's."""

_LONGEST = 60
_KEPT = 64
"""Size of the cache of plan files."""
_OLDEST = frozenset({"rev", "text", "kind", "method", "source", "plan", "parents", "fingerprint", "limits"})
"""Fields of a requirement in the catalogue of every package; others came later."""

Look = Callable[[Sources, Run], Iterator[Finding]]
"""Compares the content of a run's folder with its first event and its journal."""


def _digests(sources: Sources, run: Run) -> Iterator[Finding]:
    """Recompute the two hashes over many files in the first event."""
    frozen = {
        path: digest
        for event in sources.reading.events
        if isinstance(event, Frozen)
        for path, digest in event.files.items()
    }
    if not frozen:
        return
    of_bench = {
        str(PurePosixPath(path).relative_to(_BENCH_ITSELF)): digest
        for path, digest in frozen.items()
        if path.startswith(f"{_BENCH_ITSELF}/") and path not in _MADE
    }
    if run.bench_files is not None and _digest(of_bench) != run.bench_files:
        yield _of_journal("field 'bench_files' is not the hash over the frozen files of the bench")
    if _digest(_sources(sources.folder, frozen)) != run.sources:
        yield _of_journal("field 'sources' is not the hash over the frozen sources")


def _sources(folder: Path, frozen: Mapping[str, str]) -> dict[str, str]:
    """Return the frozen sources by their paths in the workspace."""
    layout = _object(folder, _PLACE).get("workspace")
    testplans = PurePosixPath(layout.get("testplans", "") if isinstance(layout, dict) else "")
    found = {}
    for path, digest in frozen.items():
        where = PurePosixPath(path)
        if where.is_relative_to(_SOURCES):
            found[str(where.relative_to(_SOURCES))] = digest
        elif where.is_relative_to(_PLANS) and path not in {CATALOGUE, PARAMETERS}:
            found[str(testplans / where.relative_to(_PLANS))] = digest
    return found


def _digest(files: Mapping[str, str]) -> str:
    ordered = sorted(map(PurePosixPath, files))
    return hashlib.sha256("".join(f"{files[str(path)]}  {path}\n" for path in ordered).encode()).hexdigest()


def _dut(sources: Sources, run: Run) -> Iterator[Finding]:
    """Compare the device under test in the journal, in its frozen file, and in the register."""
    frozen = _object(sources.folder, _DUT)
    for field, value in _as_json(run.dut).items():
        if frozen.get(field) != value:
            yield _differs(_DUT, field, frozen.get(field), "the journal", value)
    if run.recorded_elsewhere and not (sources.folder / _DUTS).exists():
        return
    register = {dut.serial: dut for dut in load_duts(sources.folder / _DUTS, _DUTS, Findings())}
    if (entry := register.get(run.dut.serial)) is None:
        yield Finding(_DUTS, 0, 0, f"it has no entry '{shown(run.dut.serial)}', which the run was for")
        return
    registered = _as_json(asdict(entry))
    for field in sorted((frozen.keys() & registered.keys()) - {"format"}):
        if frozen[field] != registered[field]:
            yield _differs(_DUT, field, frozen[field], _DUTS, registered[field])


def _calibration(sources: Sources, run: Run) -> Iterator[Finding]:
    """Compare every instrument's certificate and due date with the bench file, or the register that it names."""
    if run.recorded_elsewhere:
        if (given := (sources.folder / _BENCH).exists()) or sources.facts.calibration:
            sentence = (
                "the journal says that the run was recorded elsewhere, without a bench file: no instrument is known"
            )
            yield Finding(_BENCH if given else CALIBRATION, 0, 0, sentence)
        return
    root = _tree(sources.folder, _BENCH)
    if (name := _scalar(root, "bench", "name")) != run.bench:
        yield _differs(_BENCH, "bench.name", name, "the journal", run.bench)
    frozen = sources.facts.calibration
    if run.calibration is None:
        return  # the oldest packages have none
    listed = {str(key.text) for key, _ in getattr(node_at(root, ("instruments",)), "entries", ())}
    register = load_instruments(sources.folder / _INSTRUMENTS, _INSTRUMENTS, Findings())
    by_hand = {name for name in frozen.keys() - listed if name in register and frozen[name].register == name}
    for name in sorted((frozen.keys() ^ listed) - by_hand):
        where, other = (CALIBRATION, _BENCH) if name in frozen else (_BENCH, CALIBRATION)
        yield Finding(where, 0, 0, f"instrument '{shown(name)}' is missing in {other}")
    whole = _object(sources.folder, CALIBRATION).get("format") != 1  # which had only these three
    for name in sorted(frozen.keys() & listed | by_hand):
        at = ("instruments", name)
        registered = name if name in by_hand else _scalar(root, *at, "register")
        dut = _scalar(root, *at, "dut") == "true"
        source = _INSTRUMENTS if registered else _BENCH
        if whole:
            record = register[registered].calibration if registered in register else _record(root, name)
            due = frozen_calibration(sources.folder, record, dut=dut, register=registered)
        else:
            certificate, day = (_scalar(root, *at, "calibration", key) for key in ("certificate", "due"))
            due = FrozenCalibration(certificate=certificate, due=day, dut=dut)
        was, right = _as_json(frozen[name]), _as_json(due)
        for field in sorted(right):
            if was[field] != right[field]:
                yield _differs(CALIBRATION, f"{name}.{field}", was[field], source, right[field])


def _record(root: Node, name: str) -> Calibration | None:
    """Return the calibration of an instrument in the bench file itself."""
    node = node_at(root, ("instruments", name, "calibration"))
    found = None if node is None else _plain(node)
    return validated(Calibration, found, "calibration") if isinstance(found, dict) else None


def _catalogue(sources: Sources, run: Run) -> Iterator[Finding]:
    """Compare the frozen requirements with the plans' own files and their locks."""
    frozen = sources.facts.catalogue
    of_plan: dict[str, list[str]] = {}
    for name, entry in frozen.items():
        of_plan.setdefault(entry.plan, []).append(name)
    due: dict[str, FrozenRequirement] = {}
    for plan in run.plans:
        path = f"{_PLANS}/{plan}/{REQUIREMENTS}"
        asked = _asked(read_plain(sources.folder / path), plan) if (sources.folder / path).exists() else None
        if asked is None:
            yield Finding(shown(path), 0, 0, "its requirements cannot be read, and not be compared")
            return
        due |= asked
        yield from _lock(sources.folder, plan, {name: frozen[name] for name in of_plan.get(plan, ())})
    for name in sorted(frozen.keys() ^ due.keys()):
        where = "the plans do not have it" if name in frozen else "it is missing, and the plans have it"
        yield Finding(CATALOGUE, 0, 0, f"requirement {shown(name)}: {where}")
    different = sorted(name for name in frozen.keys() & due.keys() if frozen[name] != due[name])
    known = _known_fields(sources.folder) if different else frozenset()
    for name in different:
        was, right = _as_json(frozen[name]), _as_json(due[name])
        for field in sorted(known & right.keys()):
            if was.get(field) != right[field]:
                source = f"{REQUIREMENTS} of {right['plan']}"
                yield _differs(CATALOGUE, f"{name}.{field}", was.get(field), source, right[field])


@lru_cache(maxsize=_KEPT)
def _asked(data: bytes, plan: str) -> dict[str, FrozenRequirement] | None:
    """Return the requirements of a plan's own file in frozen form; runs of one plan have the same file."""
    file = parse_requirements(data, "", plan, Findings())
    return None if file is None else entries_of(file.requirements)


def _known_fields(folder: Path) -> frozenset[str]:
    """Return the fields of requirements in this package's catalogue."""
    raw = _object(folder, CATALOGUE).get("requirements")
    return _OLDEST.union(*(each for each in raw.values() if isinstance(each, dict)) if isinstance(raw, dict) else ())


def _lock(folder: Path, plan: str, frozen: Mapping[str, FrozenRequirement]) -> Iterator[Finding]:
    path = f"{_PLANS}/{plan}/{LOCK}"
    if not (folder / path).exists():
        return
    locked = locked_revs(read_plain(folder / path))
    for name, entry in frozen.items():
        recorded = locked.get(name, (None, None))
        if recorded == (entry.fingerprint, entry.rev):
            continue
        for field, was, value in zip(("fingerprint", "rev"), (entry.fingerprint, entry.rev), recorded, strict=True):
            if value != was:
                yield _differs(CATALOGUE, f"{name}.{field}", was, shown(path), value)


def _parameters(sources: Sources, run: Run) -> Iterator[Finding]:
    """Compare the frozen parameters with the plans' own files and the overrides of the command line."""
    if run.overrides is None or run.skips is None:
        return  # the oldest packages do not record them
    frozen = _object(sources.folder, PARAMETERS).get("plans")
    if not isinstance(frozen, dict) or sorted(frozen) != sorted(run.plans):
        yield Finding(PARAMETERS, 0, 0, "its plans are not those of the run")
        return
    parameters = {plan: load_parameters(sources.folder, sources.folder / _PLANS / plan) for plan in run.plans}
    for name, text in run.overrides.items():
        for plan, each in parameters.items():
            if name in {row.name for row in each.rows()}:
                parameters[plan] = each.override(name, text)
    for plan, each in parameters.items():
        yield from _rows(plan, frozen[plan], each)
    changed = sum(len(each.deviations) for each in parameters.values())
    if len(run.deviations) < changed + len(run.skips) + bool(run.only):
        yield _of_journal("field 'deviations' does not name every changed parameter and every skipped case")


def _rows(plan: str, frozen: object, parameters: Parameters) -> Iterator[Finding]:
    due = parameters.facts()
    rows = frozen if isinstance(frozen, list) else []
    if len(rows) != len(due) or not all(isinstance(row, dict) for row in rows):
        many = "parameter" if len(due) == 1 else "parameters"
        text = f"plan {shown(plan)} has {len(due)} {many} in {PARAMETERS_FILE}, and {len(rows)} here"
        yield Finding(PARAMETERS, 0, 0, text)
        return
    for row, right in zip(rows, due, strict=True):
        for field, value in right.items():
            if row.get(field) != value:
                source = f"{PARAMETERS_FILE} of {plan}"
                yield _differs(PARAMETERS, f"{right['name']}.{field}", row.get(field), source, value)


def _armed(sources: Sources, _: Run) -> Iterator[Finding]:
    """Yield a finding if a case drove the bench before it was armed, at the start or after a stop."""
    armed = gated = False
    for line in sources.reading.lines:
        match line.event:
            case Gate(ok=True):
                gated = True
            case Armed():
                if not gated:
                    yield Finding(JOURNAL, line.number, 1, "the bench was armed without a gate")
                armed = True
            case Resumed(entry=Entry()):  # a killed run continues where it was
                armed = False
            case Effect(effect="drives", name=name) if not armed:
                yield Finding(JOURNAL, line.number, 1, f"{shown(name)} drives the bench, which is not armed")
                return


def _of_journal(text: str) -> Finding:
    return Finding(JOURNAL, 1, 1, text)


def _differs(path: str, field: str, found: object, where: str, due: object) -> Finding:
    return Finding(path, 0, 0, f"field '{shown(field)}' is {_short(found)}, and {where} has {_short(due)}")


def _short(value: object) -> str:
    text = shown(canonical(value).decode())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _as_json(value: object) -> dict[str, Any]:
    """Return an object as it would be read back from a canonical file."""
    found: dict[str, Any] = parse_strict(canonical(msgspec.to_builtins(value)))  # type: ignore[assignment]
    return found


def _object(folder: Path, path: str) -> dict[str, Any]:
    found = read_json(folder / path)
    if not isinstance(found, dict):
        raise EvidenceError(f"{path}: not an object", "see hil verify")
    return found


def _tree(folder: Path, path: str) -> Node:
    findings = Findings()
    root = read_yaml(folder / path, path, findings)
    findings.raise_if_any()
    if root is None:
        raise EvidenceError(f"{path}: cannot be read", "see hil verify")
    return root


def _plain(node: Node) -> object:
    """Return a part of a document as texts, flags, lists and mappings."""
    if isinstance(node, MappingNode):
        return {key.text: _plain(value) for key, value in node.entries}
    if isinstance(node, SequenceNode):
        return [_plain(item) for item in node.items]
    if isinstance(node, Scalar) and node.kind is ScalarKind.FLAG:
        return node.text == "true"
    return node.text if isinstance(node, Scalar) else None


def _scalar(root: Node, *keys: str) -> str:
    """Return the text at a place in a document, empty if there is none."""
    node = node_at(root, keys)
    return node.text if isinstance(node, Scalar) else ""


LOOKS: tuple[tuple[Look, str], ...] = (
    (_digests, JOURNAL),
    (_dut, _DUT),
    (_calibration, CALIBRATION),
    (_catalogue, CATALOGUE),
    (_parameters, PARAMETERS),
    (_armed, JOURNAL),
)
"""Every comparison with the path that it is about."""
