"""The recordings of a package, written for other programs."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.documents.canonical import canonical
from hil.evidence.durable import DISK_FULL, PART, sync_file, sync_folder
from hil.evidence.events import Recording
from hil.evidence.folder import RECORDINGS, is_sealed
from hil.evidence.package.contents import Package
from hil.evidence.package.listing import shown
from hil.evidence.package.verification import State, Verification, verify
from hil.model.errors import EvidenceError, Refused
from hil.report.export.csv_table import TableFormat, write_csv
from hil.report.export.mat_file import write_mat
from hil.report.export.selection import Facts, choose, facts_of

__all__ = ["ExportRequest", "Exported", "export_package"]

_HINTS = {
    State.RUNNING: "wait until it ends",
    State.INTERRUPTED: "hil seal seals it as it is",
    State.SAFED: "hil seal seals it as it is",
    State.DAMAGED: "hil verify shows what is wrong",
    State.UNKNOWN: "use a newer version of hil",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportRequest:
    """What is exported, and how.

    Attributes:
        output: the folder to write to.
        recordings: ids or names of recordings; all if empty.
        cases: cases whose recordings are exported; all if empty.
        table: how a text table is written, None for none.
        mat: whether a MATLAB file is written.
        compressed: whether its variables are compressed.
    """

    output: Path
    recordings: Sequence[str] = ()
    cases: Sequence[str] = ()
    table: TableFormat | None = None
    mat: bool = False
    compressed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """A recording that was written: its facts, and the names of its files."""

    facts: Facts
    files: tuple[str, ...]


def export_package(folder: Path, request: ExportRequest) -> Iterator[Exported]:
    """Verify a package, then write its recordings one by one; nothing is written until all are known to be possible.

    Raises:
        Refused: where the package is not sealed, holds no such recording, or a file cannot be written.
        EvidenceError: where it is damaged, or a recording cannot be read.
    """
    verified = _verified(folder)
    package = Package(folder)
    chosen = choose(package.of(Recording), request.recordings, request.cases)
    facts = [facts_of(package, verified, begun) for begun in chosen]
    _require_new(request.output, [name for told in facts for name in _names(told, request)])
    for told in facts:
        yield _exported(folder / RECORDINGS / f"{told['recording']}.h5", told, request)


def _verified(folder: Path) -> Verification:
    """Return the verification of an intact package: an export names its digest."""
    found = verify(folder)
    if found.state is State.SEALED:
        return found
    name, hint = shown(folder.name), _HINTS[found.state]
    if found.state is State.DAMAGED:
        raise EvidenceError(f"cannot export {name}: it is DAMAGED: {found.problem}", hint)
    raise Refused(f"cannot export {name}: it is {found.state}, not SEALED", hint)


def _names(facts: Mapping[str, Any], request: ExportRequest) -> list[str]:
    """Return the names of a recording's files: the id, which is one in every package that hil wrote, and the mark."""
    if not re.fullmatch(r"[\w\[\]-][\w.\[\]-]*", facts["recording"]):
        raise EvidenceError(
            f"{shown(facts['recording'])}: this id is not a file name", "hil did not write this package"
        )
    stem = "-".join(filter(None, (facts["recording"], facts["mark"])))
    endings = [".csv"] if request.table else []
    endings += [".json"] if request.table and not request.table.commented else []
    endings += [".mat"] if request.mat else []
    return [f"{stem}{ending}" for ending in endings]


def _exported(recording: Path, facts: Facts, request: ExportRequest) -> Exported:
    names = _names(facts, request)
    with _whole_files(request.output, names) as parts:
        files = dict(zip((Path(name).suffix for name in names), zip(names, parts, strict=True), strict=True))
        if request.table:
            table, part = files[".csv"]
            digest = write_csv(recording, part, facts, request.table)
            if ".json" in files:
                files[".json"][1].write_bytes(canonical(_beside(facts, table, digest, request.table)) + b"\n")
        if request.mat:
            write_mat(recording, files[".mat"][1], facts, compressed=request.compressed)
    return Exported(facts=facts, files=tuple(names))


def _beside(facts: Facts, table: str, digest: str, form: TableFormat) -> Facts:
    """Return the facts for the file beside a table, bound to it by its hash."""
    written = {"name": table, "sha256": digest, "separator": form.separator, "decimal": form.decimal}
    return facts | {"file": written | {"not_a_number": ""}}


def _require_new(folder: Path, names: Sequence[str]) -> None:
    """Refuse a folder to which these files cannot be added.

    Raises:
        Refused: where it is inside of a sealed package or is no folder, or where one of the files is there.
    """
    whole = Path(os.path.realpath(folder))
    for place in (whole, *whole.parents):
        if is_sealed(place):
            raise Refused(f"{folder}: this is inside the sealed package {place.name}", "choose another --output")
    if os.path.lexists(folder) and not folder.is_dir():
        raise Refused(f"{folder}: this is not a folder", "choose another --output")
    for name in names:
        if os.path.lexists(folder / name):
            raise Refused(f"{folder / name} exists already, and nothing is overwritten", "choose another --output")


@contextmanager
def _whole_files(folder: Path, names: Sequence[str]) -> Iterator[list[Path]]:
    """Give paths to write to, and rename the files once all of them are on disk.

    Args:
        folder: where they are written; it is made where it is not there, and removed again if nothing comes into it.
        names: the names that the files get.

    Raises:
        Refused: where the disk is full or a file cannot be written; nothing half written is left.
    """
    parts = [folder / f"{name}{PART}" for name in names]
    there = folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield parts
        for part in parts:
            sync_file(part)
        for part, name in zip(parts, names, strict=True):
            part.replace(folder / name)
        sync_folder(folder)
    except OSError as error:
        what = "disk full" if error.errno in DISK_FULL else f"cannot be written: {error.strerror or error}"
        raise Refused(f"{folder / names[0]}: {what}", "choose another --output, or free some space") from error
    finally:
        for part in parts:
            with suppress(OSError):
                part.unlink()
        if not there:
            with suppress(OSError):
                folder.rmdir()  # only an empty one can be removed
