"""Recordings: the same numbers in HDF5, and rows removed only when that is proven."""

from __future__ import annotations

import errno
import hashlib
import os

import h5py
import numpy as np
import pytest
from evidence_runs import begin, record

from hil.evidence.events import Recording, RecordingEnd
from hil.evidence.package.contents import Package
from hil.evidence.recordings.hdf5 import convert, hashes_of, read_hdf5, read_recording
from hil.evidence.recordings.row_file import BLOCK
from hil.model.errors import EvidenceError


def ended_recording(folder, rows=100):
    """Write a recording, and return its folder, `recording` and `recording-end`."""
    with begin(folder) as journal:
        record(folder, journal, rows)
    package = Package(folder)
    return folder / "data/recordings", package.of(Recording)[0], package.of(RecordingEnd)[0]


def test_hdf5_holds_what_the_rows_held(tmp_path):
    """Numbers, NaN included, units and instruments are those that were recorded; the rows stay until somebody syncs."""
    place, begun, ended = ended_recording(tmp_path)
    before = Package(tmp_path).recording("001-rest")
    convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
    assert sorted(path.name for path in place.iterdir()) == ["001-rest.h5", "001-rest.rows"]
    after = Package(tmp_path).recording("001-rest")
    assert np.array_equal(before.time, after.time)
    assert np.array_equal(before["x"], after["x"], equal_nan=True)
    assert (after.channels, after.unit("x"), after.rate, len(after), after.complete) == (
        ("x",),
        "deg/s",
        100.0,
        100,
        True,
    )
    assert (before.instruments, after.source) == ({"x": "psu1"}, "hardware")
    with h5py.File(place / "001-rest.h5") as file:
        assert dict(file["channels/x"].attrs) == {
            "calibration": "C-1", "instrument": "psu1", "unit": "deg/s",
        }  # fmt: skip
        assert (file.attrs["rate"], file.attrs["source"], file.attrs["sha256"]) == (100.0, "hardware", ended.sha256)


@pytest.mark.parametrize("rows", [0, 1, BLOCK + 5])
def test_any_number_of_rows_is_converted(tmp_path, monkeypatch, rows):
    """No row, one row, and more than a block give back their hash; the disk was asked for more than they take."""
    asked = []
    monkeypatch.setattr(os, "posix_fallocate", lambda _, start, size: asked.append(start + size), raising=False)
    place, begun, ended = ended_recording(tmp_path, rows)
    convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
    assert hashes_of(place / "001-rest.h5", [rows]) == [(rows, ended.sha256)]
    assert len(read_hdf5(place / "001-rest.h5")["x"]) == rows
    assert asked == [64_000 + 2 * (8 * 16_384 + 16_000 + 8 * rows)]
    assert asked[0] > (place / "001-rest.h5").stat().st_size


def test_what_a_disk_refuses_is_told_by_its_number(tmp_path, monkeypatch):
    """h5py knows a disk's error as a sentence only, where it closes a file."""
    place, begun, ended = ended_recording(tmp_path)

    def refuse(*_):
        raise RuntimeError("Disable slist on flush dest failure failed (file write failed: errno = 28, error message")

    monkeypatch.setattr("hil.evidence.recordings.hdf5.describe", refuse)
    with pytest.raises(OSError, match="No space left on device") as full:
        convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
    assert full.value.errno == errno.ENOSPC


def test_the_same_rows_give_the_same_bytes(tmp_path):
    """No time of writing and no free space with old content is in the file."""
    digests = set()
    for name in "ab":
        (tmp_path / name).mkdir()
        place, begun, ended = ended_recording(tmp_path / name, 20_000)
        convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
        digests.add(hashlib.sha256((place / "001-rest.h5").read_bytes()).hexdigest())
    assert len(digests) == 1


def test_rows_stay_where_they_are_not_those_of_the_journal(tmp_path):
    """A changed row is told, and nothing is removed."""
    place, begun, ended = ended_recording(tmp_path)
    rows = place / "001-rest.rows"
    data = bytearray(rows.read_bytes())
    data[-1] ^= 1
    rows.write_bytes(data)
    with pytest.raises(EvidenceError, match="but the journal names"):
        convert(rows, place / "001-rest.h5", begun=begun, ended=ended)
    assert rows.exists()
    assert not (place / "001-rest.h5").exists()


def test_what_is_no_recording_says_so(tmp_path):
    """A foreign HDF5 file, or none at all, is an error with the file's name."""
    (tmp_path / "a.h5").write_bytes(b"nonsense")
    h5py.File(tmp_path / "b.h5", "w").close()
    for name in ("a.h5", "b.h5", "missing.h5"):
        with pytest.raises(EvidenceError, match=name):
            read_hdf5(tmp_path / name)
        with pytest.raises(EvidenceError, match=name):
            hashes_of(tmp_path / name, [1])


def test_a_recording_of_a_run_killed_amid_its_seal_is_read(tmp_path):
    """Its rows are converted and gone already, and whoever makes it again does not know its end yet."""
    place, begun, ended = ended_recording(tmp_path)
    convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
    (place / "001-rest.rows").unlink()
    assert len(read_recording(place, begun, ended)) == 100
