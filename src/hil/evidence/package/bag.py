"""The package as a BagIt 1.0 bag (RFC 8493): manifests, seal, digest, and a strict reader."""

from __future__ import annotations

import hashlib
import os
import re
import stat
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

from hil.evidence.durable import read_plain, sha256_of, sync_file, sync_folder, write_whole
from hil.evidence.folder import JOURNAL, REPORT, SEAL
from hil.evidence.package.listing import list_folder, shown
from hil.model.errors import Finding

__all__ = [
    "DECLARATION",
    "INFO",
    "MANIFEST",
    "TAG_MANIFEST",
    "digest_of_manifest",
    "evidence_digest",
    "hash_payload",
    "identifier_of",
    "info_text",
    "inventory",
    "is_named",
    "make_read_only",
    "manifest_text",
    "payload_of",
    "payload_oxum",
    "put_seal",
    "read_manifest",
    "tag_manifest_text",
    "write_manifests",
]

DECLARATION = b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
_WRITE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH
MANIFEST = "manifest-sha256.txt"
TAG_MANIFEST = "tagmanifest-sha256.txt"
INFO = "bag-info.txt"

_IDENTIFIER = "External-Identifier: "
_ENCODED = {"%": "%25", "\n": "%0A", "\r": "%0D"}
_LINE = re.compile(r"([0-9a-f]{64})  ([^\r\n]+)")


def payload_of(files: Iterable[str]) -> tuple[str, ...]:
    """Return the paths of a folder that are below `data`."""
    return tuple(path for path in files if path.startswith("data/"))


def hash_payload(folder: Path) -> dict[str, str]:
    """Return path and SHA-256 of every regular file below `data`, sorted as manifests are.

    Raises:
        OSError: if one cannot be read.
    """
    return {path: sha256_of(folder / path) for path in payload_of(list_folder(folder).files)}


def inventory(folder: Path) -> dict[str, str]:
    """Return path and SHA-256 of every file below `data` that is final before the journal's last event.

    The journal cannot name itself, nor the report, which prints the evidence digest. Nor can it hold a name that is
    not valid text: the run wrote no such file, and verification finds it.

    Raises:
        OSError: if a file cannot be read.
    """
    return {path: digest for path, digest in hash_payload(folder).items() if is_named(path) and _is_text(path)}


def is_named(path: str) -> bool:
    """Return whether the journal's last event names a file below `data`."""
    return path != JOURNAL and not path.startswith(f"{REPORT}/")


def manifest_text(hashes: Mapping[str, str]) -> bytes:
    """Return a manifest: hash, two spaces, path; sorted by the path's bytes."""
    lines = (f"{hashes[path]}  {_encode(path)}\n" for path in sorted(hashes, key=os.fsencode))
    return b"".join(os.fsencode(line) for line in lines)


def digest_of_manifest(manifest: bytes) -> str:
    """Return the evidence digest: SHA-256 over the manifest's lines without those of the report."""
    kept = (line for line in manifest.splitlines(keepends=True) if not line[66:].startswith(f"{REPORT}/".encode()))
    return hashlib.sha256(b"".join(kept)).hexdigest()


def evidence_digest(folder: Path) -> str:
    """Return the evidence digest of the present content of a run's folder; reports name it before the seal."""
    return digest_of_manifest(manifest_text(hash_payload(folder)))


def info_text(folder: Path, *, identifier: str, date: str, content: str, version: str) -> bytes:
    """Return `bag-info.txt`.

    Args:
        folder: the run's folder; its payload is measured.
        identifier: the name that the folder had at the seal.
        date: the day of the run's end, ISO 8601.
        content: the content digest.
        version: the version of the product that made the run.
    """
    fields = {
        "Bag-Software-Agent": f"hil {version}",
        "Bagging-Date": date,
        "Content-Digest": content,
        "External-Identifier": shown(identifier),
        "Payload-Oxum": payload_oxum(folder, list_folder(folder).files),
    }
    return "".join(f"{name}: {value}\n" for name, value in fields.items()).encode()


def payload_oxum(folder: Path, files: Iterable[str]) -> str:
    """Return total size in bytes and number of a folder's files below `data`, as `bag-info.txt` has them."""
    sizes = [(folder / path).lstat().st_size for path in payload_of(files)]
    return f"{sum(sizes)}.{len(sizes)}"


def identifier_of(info: str) -> str:
    """Return the name that a folder had at its seal, from its `bag-info.txt`; empty if it is not there."""
    names = [line.removeprefix(_IDENTIFIER) for line in info.splitlines() if line.startswith(_IDENTIFIER)]
    return names[0] if names else ""


def tag_manifest_text(folder: Path) -> bytes:
    """Return the manifest of the tag files; `bagit.txt` is always the same, so it need not be there yet."""
    hashes = {name: sha256_of(folder / name) for name in (INFO, MANIFEST)}
    return manifest_text(hashes | {SEAL: hashlib.sha256(DECLARATION).hexdigest()})


def write_manifests(folder: Path, info: bytes) -> None:
    """Write everything that makes the folder a bag, except the seal; the payload is already on disk."""
    hashes = hash_payload(folder)
    for path in hashes:
        sync_file(folder / path)
    for inner in sorted({PurePosixPath(path).parent for path in hashes}):
        sync_folder(folder / inner)
    write_whole(folder / MANIFEST, manifest_text(hashes))
    write_whole(folder / INFO, info)
    write_whole(folder / TAG_MANIFEST, tag_manifest_text(folder))


def put_seal(folder: Path) -> None:
    """Seal the bag: write the declaration atomically, as the last file."""
    write_whole(folder / SEAL, DECLARATION)


def make_read_only(folder: Path) -> None:
    """Remove write permission for everybody, from files first and then from their folders; links are left alone.

    Read permission does not change: a run under a umask such as 077 stays private.
    """
    for root, _, names in os.walk(folder, topdown=False):
        for name in names:
            path = Path(root, name)
            if not path.is_symlink():
                _protect(path)
        _protect(Path(root))


def _protect(path: Path) -> None:
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & _WRITE:  # a read-only file system refuses even a change to what is there
        path.chmod(mode & ~_WRITE)


def read_manifest(folder: Path, name: str) -> tuple[dict[str, str], list[Finding]]:
    """Read a manifest strictly; return what it names, and everything that is wrong with it."""
    entries: dict[str, str] = {}
    findings: list[Finding] = []
    try:
        lines = read_plain(folder / name).decode("utf-8", errors="surrogateescape").split("\n")
    except OSError as error:
        return {}, [_finding(name, f"cannot be read: {error.strerror}")]
    if lines.pop() != "":
        findings.append(_finding(name, "the last line is cut off"))
    for number, line in enumerate(lines, 1):
        match = _LINE.fullmatch(line)
        path = _decode(match[2]) if match else ""
        if not match:
            findings.append(_finding(name, "expected a SHA-256, two spaces and a path", number))
        elif _leaves(path):
            findings.append(_finding(name, f"{shown(path)} leads out of the package", number))
        elif path in entries:
            findings.append(_finding(name, f"{shown(path)} is named twice", number))
        else:
            entries[path] = match[1]
    return entries, findings


def _is_text(path: str) -> bool:
    return not any("\ud800" <= letter <= "\udfff" for letter in path)


def _leaves(path: str) -> bool:
    parts = path.split("/")
    return path.startswith(("/", "~")) or "\\" in path or any(part in {"", ".", ".."} for part in parts)


def _encode(path: str) -> str:
    return re.sub(r"[%\r\n]", lambda match: _ENCODED[match[0]], path)


def _decode(text: str) -> str:
    for character, code in reversed(_ENCODED.items()):
        text = text.replace(code, character)
    return text


def _finding(path: str, message: str, line: int = 0) -> Finding:
    return Finding(path=shown(path), line=line, column=1 if line else 0, message=message)
