"""Files given as answers: the accepted kinds, how they are examined, and how the run keeps them."""

from __future__ import annotations

import codecs
import hashlib
import os
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import BinaryIO

from hil.documents.suggest import did_you_mean
from hil.documents.text import visible
from hil.evidence.durable import DISK_FULL, PART, open_plain, sha256_of, sync_folder, sync_open
from hil.evidence.events import GivenFile
from hil.evidence.inbox import LARGEST_ATTACHMENT
from hil.model.errors import HilError, Misused

__all__ = ["KINDS", "PICTURES", "Shelf", "Unfit", "kinds_of", "problem_of", "said_path", "spoken_kinds"]

KINDS = {
    "pdf": "PDF",
    "png": "PNG",
    "jpeg": "JPEG",
    "step": "STEP",
    "csv": "CSV",
    "text": "text",
}
"""The accepted kinds of files, and what people call them."""

PICTURES = ("png", "jpeg")
_WORDS = {"picture": PICTURES, "document": tuple(KINDS)}
_ENDINGS = {"pdf": "pdf", "png": "png", "jpeg": "jpg", "step": "step", "csv": "csv", "text": "txt"}
_TABLES = (".csv", ".tsv")

_BLOCK = 1 << 20
_EDGE = 1 << 12
_SPARE = 16_000_000
"""Space that a copy leaves free on the disk, for the end of the run."""

_PNG = b"\x89PNG\r\n\x1a\n"
_JPEG = b"\xff\xd8\xff"
_SIZED = frozenset({0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF})
_SCAN, _PADDING, _END = 0xDA, 0xFF, 0xD9
_ALONE = frozenset({0x01, *range(0xD0, 0xD8)})


class Unfit(HilError):
    """A file cannot be accepted as an answer."""


def kinds_of(accepts: Sequence[str]) -> tuple[str, ...]:
    """Return the kinds of files that a plan accepts, all if it names none; `picture` is PNG and JPEG.

    Raises:
        Misused: for a kind that cannot be accepted.
    """
    for word in accepts:
        if word not in KINDS and word not in _WORDS:
            known = (*KINDS, *_WORDS)
            raise Misused(
                f"operator.attach takes no files of kind {word!r}{did_you_mean(str(word), known)}",
                f"name some of {', '.join(known)}",
            )
    named = [kind for word in accepts or ("document",) for kind in _WORDS.get(word, (word,))]
    return tuple(kind for kind in KINDS if kind in named)


def spoken_kinds(kinds: Sequence[str]) -> str:
    """Return the kinds in words, such as `PDF, PNG or JPEG`."""
    *first, last = (KINDS.get(kind, kind) for kind in kinds)
    return f"{', '.join(first)} or {last}" if first else last


def said_path(line: str, folder: Path) -> Path:
    """Return the path that a person typed, or dropped on the terminal, which may quote it.

    Args:
        line: what was typed.
        folder: the base of a relative path.
    """
    said = line.strip()
    if len(said) > 1 and said[0] == said[-1] and said[0] in "'\"":
        said = said[1:-1]
    elif not os.path.lexists(folder / said):
        said = said.replace("\\ ", " ")
    path = Path(said)
    with suppress(RuntimeError):  # there is no such user
        path = path.expanduser()
    return folder / path


def problem_of(path: Path, kinds: Sequence[str]) -> str:
    """Return why a file cannot be accepted, and what to do; empty if it can."""
    try:
        with _opened(path) as stream:
            _examined(stream, path, kinds)
    except Unfit as error:
        return str(error)
    return ""


class Shelf:
    """Store of the files that people gave: complete copies, under names of the run's own, with their hashes.

    Args:
        folder: `data/attachments` of the run.
        recorded: the folder of files that come from a record, in a replay that of the package; None for `folder`.
        point: the scheduling point; it is passed between the blocks of a copy.
        made: the files that the run has created or kept there; those kept here are added.

    Attributes:
        folder: as given.
        point: as given.
    """

    def __init__(self, folder: Path, recorded: Path | None, point: Callable[[], None], made: set[Path]) -> None:
        self.folder = folder
        self.point = point
        self._recorded = recorded or folder
        self._made = made

    def take(self, path: Path, stem: str, kinds: Sequence[str], given: str = "") -> GivenFile:
        """Copy a file into the run, and return its description.

        The copy gets its name only once it is complete and on disk. A file that is on the shelf already, because it
        came through the run's inbox, is moved.

        Args:
            path: the file.
            stem: what its name on the shelf begins with.
            kinds: the accepted kinds.
            given: its original name; by default that of `path`.

        Raises:
            Unfit: if it cannot be accepted, changes while it is copied, or does not fit on the disk.
        """
        part = self.folder / f"{stem}{PART}"
        try:
            with _opened(path) as source:
                before = os.fstat(source.fileno())
                digest, size = self._copy(source, path, part, before.st_size)
                if _differs(before, path):
                    raise Unfit(f"{_shown(path)}: it changed while it was copied", "close what writes it, then give it")
            with _opened(part) as copied:
                kind = _examined(copied, path, kinds)
            kept = self._place(part, stem, _ENDINGS[kind], digest)
        except OSError as error:
            raise _unfit(path, error) from error
        finally:
            part.unlink(missing_ok=True)
        if path.parent == self.folder:
            path.unlink(missing_ok=True)
        self._made.add(kept)
        name = visible(given or path.name.encode(errors="backslashreplace").decode())
        return GivenFile(file=kept.name, given=name.replace("\n", "\\n"), type=kind, size=size, sha256=digest)

    def content(self, file: str, sha256: str) -> bytes:
        """Return the content of a file on the shelf.

        Raises:
            Unfit: if it is missing, or has changed since it was given.
        """
        here = self.folder / file
        path = here if here.exists() else self._recorded / file
        try:
            with open_plain(path) as stream:
                data = stream.read()
        except OSError as error:
            raise _unfit(path, error) from error
        if hashlib.sha256(data).hexdigest() != sha256:
            raise Unfit(f"{file}: this is no longer the file that was given", "see hil verify")
        return data

    def _copy(self, source: BinaryIO, path: Path, part: Path, due: int) -> tuple[str, int]:
        free = shutil.disk_usage(self.folder).free
        if free < due + _SPARE:
            raise Unfit(
                f"{_shown(path)}: its {due / 1e6:.1f} MB do not fit on the run's disk, {free / 1e6:.0f} MB are free",
                "free some space",
            )
        digest, size = hashlib.sha256(), 0
        with part.open("wb") as copy:
            while size <= due and (block := source.read(_BLOCK)):
                digest.update(block)
                size += copy.write(block)
                self.point()
            copy.flush()
            sync_open(copy.fileno())
        return digest.hexdigest(), size

    def _place(self, part: Path, stem: str, ending: str, digest: str) -> Path:
        """Give a complete copy a name not in use, or that of the same file from before an interruption."""
        names = chain([f"{stem}.{ending}"], (f"{stem}-{number}.{ending}" for number in count(2)))
        for path in map(self.folder.joinpath, names):
            if path not in self._made and (not os.path.lexists(path) or sha256_of(path) == digest):
                part.replace(path)
                sync_folder(self.folder)
                return path
        raise AssertionError  # the names are endless


def _opened(path: Path) -> BinaryIO:
    """Open a file named by a person; a link is followed, a pipe or a device is not read.

    Raises:
        Unfit: with what is wrong with it.
    """
    try:
        found = path.resolve(strict=True)
        if found.is_dir():
            raise Unfit(f"{_shown(path)}: this is a folder", "give one file")
        stream = open_plain(found)
    except (OSError, ValueError, RuntimeError) as error:
        raise _unfit(path, error) from error
    size = os.fstat(stream.fileno()).st_size
    if 0 < size <= LARGEST_ATTACHMENT:
        return stream
    stream.close()
    if size:
        most = f"{LARGEST_ATTACHMENT / 1e6:.0f} MB"
        raise Unfit(f"{_shown(path)}: {size / 1e6:,.0f} MB are more than {most}", "give a part of it, or its digest")
    raise Unfit(f"{_shown(path)}: the file is empty", "give one that holds something")


def _unfit(path: Path, error: Exception) -> Unfit:
    if isinstance(error, FileNotFoundError):
        return Unfit(f"{_shown(path)}: there is no such file", "check its path")
    if isinstance(error, OSError) and error.errno in DISK_FULL:
        return Unfit(f"{_shown(path)}: the disk of the run is full", "free some space")
    why = getattr(error, "strerror", None) or str(error)
    return Unfit(f"{_shown(path)}: it cannot be read: {visible(why)}", "give a regular file that you may read")


def _shown(path: Path) -> str:
    return visible(str(path).encode(errors="backslashreplace").decode()).replace("\n", "\\n")


def _differs(before: os.stat_result, path: Path) -> bool:
    """Return whether the file at this path was replaced or written to."""
    after = path.stat()
    return any(
        getattr(before, field) != getattr(after, field) for field in ("st_dev", "st_ino", "st_size", "st_mtime_ns")
    )


def _examined(stream: BinaryIO, path: Path, kinds: Sequence[str]) -> str:
    """Return the kind of a file, by its content.

    Raises:
        Unfit: if it is not an accepted one, or the file is incomplete.
    """
    shown = _shown(path)
    try:
        kind = _kind(stream, path)
    except ValueError as error:
        raise Unfit(f"{shown}: {error}", f"give a whole file: {spoken_kinds(kinds)}") from error
    if kind in kinds or (kind == "csv" and "text" in kinds):
        return kind if kind in kinds else "text"
    if not kind:
        raise Unfit(f"{shown}: this is no {spoken_kinds(kinds)} file", "give one, or export it as one")
    raise Unfit(f"{shown}: this is a {KINDS[kind]} file", f"give {spoken_kinds(kinds)}")


def _kind(stream: BinaryIO, path: Path) -> str:
    """Return the kind of a file, empty for an unknown one.

    Raises:
        ValueError: for a file that begins like a kind but does not continue like it.
    """
    head = stream.read(_EDGE)
    tail = _tail(stream)
    if head.startswith(_PNG):
        _require_png(stream)
        return "png"
    if head.startswith(_JPEG):
        _require_jpeg(stream, tail)
        return "jpeg"
    if b"%PDF-" in head[:1024]:
        if b"%%EOF" not in tail:
            raise ValueError("this PDF is cut off")
        return "pdf"
    if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"ISO-10303-21;"):
        if b"END-ISO-10303-21;" not in tail:
            raise ValueError("this STEP file is cut off")
        return "step"
    if not _is_text(stream):
        return ""
    first = head.decode(errors="ignore").splitlines()
    separated = bool(first) and any(mark in first[0] for mark in ",;\t")
    return "csv" if separated and path.suffix.lower() in _TABLES else "text"


def _tail(stream: BinaryIO) -> bytes:
    end = stream.seek(0, os.SEEK_END)
    stream.seek(max(0, end - _EDGE))
    return stream.read()


def _is_text(stream: BinaryIO) -> bool:
    """Return whether a file is UTF-8 text of nothing but letters, tabs and line ends."""
    stream.seek(0)
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        while block := stream.read(_BLOCK):
            decoder.decode(block)
            if any(byte in block for byte in b"\0\x01\x02\x03\x04\x05\x06\x07\x08\x0b\x0e\x1b\x7f"):
                return False
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return False
    return True


def _require_png(stream: BinaryIO) -> None:
    """Require that the chunks of a PNG are intact by their checksums, and that it has a size and an end."""
    stream.seek(len(_PNG))
    for number, (name, data) in enumerate(_chunks(stream)):
        if number == 0 and (name != b"IHDR" or 0 in struct.unpack(">II", data[:8])):
            break
        if name == b"IEND":
            return
    raise ValueError("this PNG is damaged")


def _chunks(stream: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yield the name and the content of every chunk, up to an incomplete one."""
    while len(head := stream.read(8)) == 8:
        length, name = struct.unpack(">I4s", head)
        if length > LARGEST_ATTACHMENT:
            return
        data, check = stream.read(length), stream.read(4)
        if len(data) < length or check != struct.pack(">I", zlib.crc32(name + data)):
            return
        yield name, data


def _require_jpeg(stream: BinaryIO, tail: bytes) -> None:
    """Require that the segments of a JPEG lead to a scan, after a size, and that it has an end."""
    stream.seek(2)
    sized = False
    while len(head := stream.read(2)) == 2 and head[0] == _PADDING:
        mark = head[1]
        if mark == _PADDING:
            stream.seek(-1, os.SEEK_CUR)
            continue
        if mark in _ALONE:
            continue
        length = stream.read(2)
        if mark == _SCAN and sized and bytes((_PADDING, _END)) in tail:
            return
        if mark in {_SCAN, _END} or len(length) < 2:
            break
        content = stream.read(max(0, struct.unpack(">H", length)[0] - 2))
        sized = sized or (mark in _SIZED and len(content) >= 6 and 0 not in struct.unpack(">HH", content[1:5]))
    raise ValueError("this JPEG is damaged")
