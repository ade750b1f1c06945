"""What an audit knows of files that it has read before, and when it reads them again."""

from __future__ import annotations

import os

import pytest
from audited import package

from hil.audit.cache import Cache

WAS, IS = b"what was measured\n", b"what was written \n"


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a package with one file."""
    found = tmp_path / "run-1"
    found.mkdir()
    (found / "journal.jsonl").write_bytes(WAS)
    return found


@pytest.fixture
def reads(tmp_path, folder):
    """Return a function that asks the cache for the package, and tells whether it was read."""

    def ask(version: str = "1", place: str = "cache") -> bool:
        read = []
        cache = Cache(tmp_path / place, version)
        assert cache.package(folder, lambda: read.append(True) or package()) == package()
        return bool(read)

    return ask


def test_what_did_not_change_is_not_read_again(reads):
    """By the same product, as long as the cache is there."""
    assert [reads(), reads(), reads(version="2"), reads(place="other")] == [True, False, True, True]


def test_a_file_that_was_changed_and_set_back_is_read_again(reads, folder):
    """Same length, same inode, and both times set to what they were: only the time of the inode tells."""
    file = folder / "journal.jsonl"
    was = file.stat()
    assert [reads(), reads()] == [True, False]
    with file.open("r+b") as stream:
        stream.write(IS)
    while file.stat().st_ctime_ns == was.st_ctime_ns or file.stat().st_mtime_ns != was.st_mtime_ns:
        os.utime(file, ns=(was.st_atime_ns, was.st_mtime_ns))  # the clock of a file system has ticks
    now = file.stat()
    assert (now.st_size, now.st_mtime_ns, now.st_ino) == (was.st_size, was.st_mtime_ns, was.st_ino)
    assert file.read_bytes() == IS
    assert reads()


def test_a_file_that_came_or_went_is_found(reads, folder):
    """A file more, and another name."""
    assert reads()
    (folder / "note.txt").write_bytes(b"")
    assert reads()
    (folder / "note.txt").rename(folder / "other.txt")
    assert reads()


def test_what_is_not_whole_is_never_kept(tmp_path, folder):
    """A damaged package is read every time."""
    cache, read = Cache(tmp_path / "cache", "1"), []
    for _ in range(2):
        cache.package(folder, lambda: read.append(True) or package(sealed=False))
    assert len(read) == 2
