"""Latches on disk: whole, damaged, hostile, unreadable."""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

import pytest
from tmpfiles import NOBODY, another_user, as_root, clean, folder_for_all, has_tmpfiles, make_old, really_clean

from hil.guardian import latch
from hil.guardian.latch import Latch
from hil.model.errors import Refused

ONE = Latch(bench="adcs", run="reports/1", why="the executive died", since="2026-11-21T12:00:00Z", outputs=("a", "b"))


@pytest.fixture
def path(tmp_path):
    """Return where a latch lies."""
    return latch.path_of("/dev/ttyUSB0", tmp_path / "latches")


def test_a_latch_is_read_as_it_was_written(path):
    """The folder is made, every user can change the latch, and a second writing replaces the first."""
    assert latch.read(path) is None
    latch.write(path, Latch(bench="x" * 500, run="", why="", since="", outputs=()))
    latch.write(path, ONE)
    assert latch.read(path) == ONE
    assert stat.S_IMODE(path.stat().st_mode) == 0o1666
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o1777


def test_every_key_has_its_own_place(tmp_path):
    """Places are the same in every process, and tell nothing of the key."""
    one, other = latch.path_of("socket://a:1", tmp_path), latch.path_of("socket://a:2", tmp_path)
    assert one != other
    assert one == latch.path_of("socket://a:1", tmp_path)
    assert one.parent == tmp_path
    assert latch.path_of("x").parent in latch.PLACES


def test_a_latch_is_taken_away(path):
    """Once, or again where there is none, or where its folder never was."""
    latch.clear(path)
    latch.write(path, ONE)
    latch.clear(path)
    latch.clear(path)
    assert latch.read(path) is None
    assert not path.exists()


@pytest.mark.parametrize("data", [b"{", b"[]", b"null", b'{"bench": "adcs"}', b"\xff\xfe", b"x" * 100_000])
def test_a_damaged_latch_latches(path, data):
    """Whoever doubts looks at the bench."""
    latch.share(path.parent)
    path.write_bytes(data)
    told = latch.read(path)
    assert told is not None
    assert "cannot read the latch" in told.why
    latch.clear(path)
    assert latch.read(path) is None


def test_an_empty_file_is_no_latch(path):
    """Another user cannot remove a file from a shared folder, but can empty it."""
    latch.share(path.parent)
    path.touch()
    assert latch.read(path) is None


@pytest.mark.parametrize("kind", ["link", "dangling link", "folder", "pipe"])
def test_what_is_no_file_latches_and_is_not_written_through(tmp_path, path, kind):
    """A link is never followed, a pipe never waited for."""
    victim = tmp_path / "victim"
    latch.share(path.parent)
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(victim)
    if kind == "link":
        victim.write_text("precious")
    assert latch.read(path) is not None
    with pytest.raises(OSError):  # noqa: PT011 - which one, the kernel says
        latch.write(path, ONE)
    assert victim.exists() is (kind == "link")
    if kind == "folder":
        with pytest.raises(Refused, match="cannot remove the latch"):
            latch.clear(path)
    else:
        latch.clear(path)
        assert latch.read(path) is None
    assert not victim.exists() or victim.read_text() == "precious"


@pytest.mark.parametrize("kind", ["link", "file"])
def test_a_folder_that_is_none_is_refused(tmp_path, kind):
    """Where somebody else put something in the folder's place, nothing can be latched, and that is said."""
    folder = tmp_path / "latches"
    if kind == "link":
        (tmp_path / "elsewhere").mkdir()
        folder.symlink_to(tmp_path / "elsewhere")
    else:
        folder.touch()
    with pytest.raises(Refused, match="it is not a folder; check who owns it"):
        latch.write(folder / "one.latch", ONE)


def test_what_cannot_be_read_latches(path, monkeypatch):
    """An error of the disk is no permission to go on."""
    latch.write(path, ONE)

    def broken(*_):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "pread", broken)
    told = latch.read(path)
    assert told is not None
    assert "Input/output error" in told.why


def test_a_latch_of_another_user_is_emptied_where_it_cannot_be_removed(path, monkeypatch):
    """In a shared folder only the owner removes a file."""
    latch.write(path, ONE)

    def not_permitted(*_, **__):
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(type(path), "unlink", not_permitted)
    latch.clear(path)
    assert latch.read(path) is None
    assert path.exists()


@pytest.mark.parametrize("cleaned", [clean, pytest.param(really_clean, marks=has_tmpfiles)], ids=["rules", "systemd"])
def test_ageing_takes_no_latch(path, cleaned):
    """Not after ninety days in a folder where 30 are allowed, whether or not its run lives."""
    latch.write(path, ONE)
    (path.parent / "other").touch()
    make_old(path.parent.parent, days=90)
    cleaned(path.parent.parent, 30)
    assert not (path.parent / "other").exists()
    assert latch.read(path) == ONE


def test_the_place_that_the_administrator_made_is_preferred_and_all_are_looked_into(tmp_path, monkeypatch):
    """A latch from before it was made still latches, and so does one of a version with one file for all users."""
    made, given = tmp_path / "lib/hil/latches", tmp_path / "tmp/hil-latches"
    monkeypatch.setattr(latch, "PLACES", (made, given))
    latch.write(latch.path_of("x"), ONE)
    (old,) = latch.latch_files("x")
    assert old.parent == given
    made.mkdir(parents=True)
    assert latch.path_of("x").parent == made
    assert latch.latch_files("x") == [old]
    latch.write(latch.path_of("x"), ONE)
    earlier = given / f"{hashlib.sha256(b'x').hexdigest()[:24]}.latch"
    old.rename(earlier)
    assert set(latch.latch_files("x")) == {made / old.name, earlier}
    assert latch.latch_files("y") == []
    assert len(latch.latch_files()) == 2
    made.rename(made.with_name("gone"))
    made.write_text("no folder")
    assert latch.path_of("x").parent == given


@as_root
def test_a_folder_that_cannot_be_read_latches():
    """Nobody knows what is in it."""
    with folder_for_all() as place:
        folder = place / "latches"
        latch.write(latch.path_of("x", folder), ONE)
        folder.chmod(0o700)
        with another_user():
            (found,) = latch.latch_files("y", folder)
            told = latch.read(found)
    assert told is not None
    assert "Permission denied" in told.why


@as_root
def test_another_user_clears_what_anyone_may():
    """The file stays, since only its owner removes one from a sticky folder; empty it is no latch."""
    with folder_for_all() as place:
        path = latch.path_of("x", place / "latches")
        latch.write(path, ONE)
        with another_user():
            assert latch.may_clear(path)
            latch.clear(path)
            assert latch.read(path) is None
            latch.write(latch.path_of("x", place / "latches"), ONE)
        assert path.exists()
        theirs = [each for each in latch.latch_files("x", place / "latches") if latch.read(each)]
        assert [each.stat().st_uid for each in theirs] == [NOBODY]
        latch.write(path, ONE, alone=True)
        assert stat.S_IMODE(path.stat().st_mode) == 0o1644


@as_root
def test_another_user_does_not_clear_what_the_owner_keeps():
    """Nor does the guardian, which writes more into it, make it anyone's."""
    with folder_for_all() as place:
        path = latch.path_of("x", place / "latches")
        latch.write(path, ONE, alone=True)
        latch.write(path, ONE)
        with another_user():
            assert not latch.may_clear(path)
            with pytest.raises(Refused, match="cannot remove the latch"):
                latch.clear(path)
        assert latch.read(path) == ONE
        assert latch.may_clear(path)
        latch.clear(path)
        assert not path.exists()


@as_root
def test_a_file_of_another_user_in_the_place_of_a_latch_is_not_written():
    """Its owner could take the latch back. Nothing is armed that cannot be latched."""
    with folder_for_all() as place:
        path = latch.path_of("x", place / "latches")
        latch.share(path.parent)
        path.touch()
        os.chown(path, NOBODY, NOBODY)
        path.chmod(0o666)
        with pytest.raises(PermissionError, match="it belongs to another user"):
            latch.write(path, ONE)
        assert Path(path).read_bytes() == b""
