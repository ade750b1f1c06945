"""Ages a folder by the rules of systemd-tmpfiles, and lets a test be another user."""

from __future__ import annotations

import fcntl
import os
import shutil
import stat
import subprocess
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

DAY_S = 86_400
NOBODY = 65_534
as_root = pytest.mark.skipif(os.geteuid() != 0, reason="only root can be another user")


def make_old(folder, days):
    """Let everything in a folder look as if nobody had touched it for so long."""
    past = time.time() - days * DAY_S
    for path in sorted(folder.rglob("*"), reverse=True):
        os.utime(path, (past, past), follow_symlinks=False)
    os.utime(folder, (past, past))


def clean(folder, days):
    """Remove from a folder what `systemd-tmpfiles --clean` would: `dir_cleanup` of its tmpfiles.c.

    The time at which an inode was changed cannot be faked, and is left out: more is removed here, not less.
    """
    limit = time.time() - days * DAY_S
    for path in folder.iterdir():
        status = path.lstat()
        if path.is_dir() and not path.is_symlink():
            with _open(path) as file:
                if not _locked(file):
                    clean(path, days)
            old = max(status.st_atime, status.st_mtime) < limit
            if old and not any(path.iterdir()):
                path.rmdir()
        elif not status.st_mode & stat.S_ISVTX and max(status.st_atime, status.st_mtime) < limit:
            with _open(path) as file:
                if not _locked(file):
                    path.unlink()


@contextmanager
def _open(path):
    file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        yield file
    finally:
        os.close(file)


def _locked(file):
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    return False


@contextmanager
def another_user(uid=NOBODY):
    """Be another user in between."""
    before = os.geteuid()
    os.seteuid(uid)
    try:
        yield
    finally:
        os.seteuid(before)


@contextmanager
def folder_for_all():
    """Give a folder that every user can reach; those of pytest are this user's alone."""
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    try:
        yield folder
    finally:
        shutil.rmtree(folder)


def really_clean(folder, days):
    """Let systemd-tmpfiles itself clean a folder; by the times of modification alone, as those of change stay new."""
    line = f"d {folder} - - - m:{days}d"
    subprocess.run(["systemd-tmpfiles", "--clean", "-"], input=line, text=True, check=True, capture_output=True)


has_tmpfiles = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("systemd-tmpfiles") is None, reason="root's systemd-tmpfiles cleans it"
)
