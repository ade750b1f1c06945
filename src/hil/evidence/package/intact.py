"""Whether a sealed folder is what was sealed: every file, every name, every byte of its manifests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from hil.evidence.durable import read_plain, sha256_of
from hil.evidence.folder import SEAL
from hil.evidence.package.bag import (
    DECLARATION,
    INFO,
    MANIFEST,
    TAG_MANIFEST,
    manifest_text,
    read_manifest,
    tag_manifest_text,
)
from hil.evidence.package.listing import Listing, shown
from hil.model.errors import Finding

__all__ = ["bag_findings"]

_TAG_FILES = frozenset({SEAL, INFO, MANIFEST, TAG_MANIFEST})


def bag_findings(folder: Path, listing: Listing, hashes: Mapping[str, str]) -> Iterator[Finding]:
    """Compare a folder with its manifests and with what a seal writes.

    Args:
        folder: the run's folder.
        listing: what is in it.
        hashes: path and SHA-256 of every file below `data`, as they are now.
    """
    for name in listing.files:
        if name not in hashes and name not in _TAG_FILES:
            yield Finding(shown(name), 0, 0, "no manifest names this file")
    missing = sorted(_TAG_FILES - {*listing.files})
    for name in missing:
        yield Finding(name, 0, 0, "this file is missing, and every package has it")
    if SEAL not in missing and read_plain(folder / SEAL) != DECLARATION:
        yield Finding(SEAL, 0, 0, "this is not the declaration of a sealed package")
    if MANIFEST not in missing:
        yield from _compare(folder, MANIFEST, hashes, manifest_text(hashes))
    if not missing:
        tags = {name: sha256_of(folder / name) for name in (SEAL, INFO, MANIFEST)}
        yield from _compare(folder, TAG_MANIFEST, tags, tag_manifest_text(folder))


def _compare(folder: Path, manifest: str, hashes: Mapping[str, str], due: bytes) -> Iterator[Finding]:
    named, findings = read_manifest(folder, manifest)
    for path in sorted(named.keys() - hashes.keys()):
        findings.append(Finding(shown(path), 0, 0, f"{manifest} names it, and it is missing"))
    for path, digest in hashes.items():
        if path not in named:
            findings.append(Finding(shown(path), 0, 0, f"{manifest} does not name it"))
        elif named[path] != digest:
            what = f"it is not the file that was sealed: {manifest} has another hash"
            findings.append(Finding(shown(path), 0, 0, what))
    yield from findings
    if not findings and read_plain(folder / manifest) != due:
        yield Finding(manifest, 0, 0, "its text is not the one that is written at a seal")
