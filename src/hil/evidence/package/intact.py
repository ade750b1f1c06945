"""Whether a sealed folder is what was sealed: every file, every name, every byte of its manifests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from hil.evidence.durable import sha256_of
from hil.evidence.folder import SEAL
from hil.evidence.package.bag import (
    DECLARATION,
    INFO,
    MANIFEST,
    TAG_MANIFEST,
    manifest_text,
    odd_entries,
    read_manifest,
    tag_manifest_text,
    top_entries,
)
from hil.model.errors import Finding

__all__ = ["bag_findings"]

_TAG_FILES = frozenset({SEAL, INFO, MANIFEST, TAG_MANIFEST})


def bag_findings(folder: Path, hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Compare a folder with its manifests and with what a seal writes.

    Args:
        folder: the run's folder.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    yield from odd_entries(folder)
    for name in top_entries(folder):
        if name not in _TAG_FILES:
            yield Finding(name, 0, 0, "no manifest names this file")
    if (folder / SEAL).read_bytes() != DECLARATION:
        yield Finding(SEAL, 0, 0, "this is not the declaration of a sealed package")
    yield from _compare(folder, MANIFEST, hashes, manifest_text(hashes))
    tags = {name: sha256_of(folder / name) for name in (SEAL, INFO, MANIFEST) if (folder / name).is_file()}
    if len(tags) == len(_TAG_FILES) - 1:
        yield from _compare(folder, TAG_MANIFEST, tags, tag_manifest_text(folder))
    else:
        yield Finding(TAG_MANIFEST, 0, 0, "tag files are missing")


def _compare(folder: Path, manifest: str, hashes: Mapping[str, str], due: bytes) -> Iterator[Finding]:
    named, findings = read_manifest(folder, manifest)
    for path in named.keys() - hashes.keys():
        findings.append(Finding(path, 0, 0, f"{manifest} names it, and it is missing"))
    for path, digest in hashes.items():
        if path not in named:
            findings.append(Finding(path, 0, 0, f"{manifest} does not name it"))
        elif named[path] != digest:
            findings.append(Finding(path, 0, 0, f"it is not the file that was sealed: {manifest} has another hash"))
    yield from findings
    if not findings and (folder / manifest).read_bytes() != due:
        yield Finding(manifest, 0, 0, "its text is not the one that is written at a seal")
