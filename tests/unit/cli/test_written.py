"""Files that a command writes: a full disk leaves the one of before, and nothing that looks whole."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.cli import written
from hil.cli.main import cli
from hil.cli.written import whole, write_whole_file
from hil.model.errors import Refused

DATA = Path(__file__).parents[3] / "docs" / "data"
_SOLAR = (
    *("analyse", "solar", str(DATA / "solar-panel-simulated.csv"), "--voltage", "1", "--voltage-unit", "V"),
    *("--current", "2", "--current-unit", "A"),
)


@pytest.fixture
def full(monkeypatch):
    """A disk that is full at the end of every file."""

    def fsync(_descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(written.os, "fsync", fsync)


def test_a_file_is_replaced_with_its_rights(tmp_path):
    """Nothing else is left beside it; a link stays one."""
    path, link = tmp_path / "a.txt", tmp_path / "link.txt"
    path.write_bytes(b"before")
    path.chmod(0o640)
    link.symlink_to(path)
    write_whole_file(link, b"after")
    assert (path.read_bytes(), link.is_symlink(), path.stat().st_mode & 0o777) == (b"after", True, 0o640)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.txt", "link.txt"]


def test_a_full_disk_leaves_the_file_of_before(tmp_path, full):
    """And no part; where there was none, there is none."""
    path = tmp_path / "a.txt"
    path.write_bytes(b"before")
    for each in (path, tmp_path / "new.txt"):
        with pytest.raises(OSError, match="No space left"):
            write_whole_file(each, b"after")
    assert path.read_bytes() == b"before"
    assert [each.name for each in tmp_path.iterdir()] == ["a.txt"]


def test_what_ends_in_the_middle_leaves_nothing(tmp_path):
    """Also where it is no error of the disk."""
    with pytest.raises(KeyboardInterrupt), whole(tmp_path / "a.txt") as stream:
        stream.write(b"half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_a_pipe_is_written_to(tmp_path):
    """It is no file that could be replaced."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole_file(pipe, b"through")
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.parametrize("option", ["--export", "--plot"])
def test_an_analysis_costs_nobody_the_file_of_before(tmp_path, full, option):
    """It was cut to nothing before the disk was found to be full."""
    path = tmp_path / "curve.svg"
    path.write_bytes(b"before")
    with pytest.raises(Refused, match="No space left on device"):
        CliRunner().invoke(cli, (*_SOLAR, option, str(path)), standalone_mode=False, catch_exceptions=False)
    assert path.read_bytes() == b"before"
