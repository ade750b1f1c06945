"""Recordings back from HDF5 to rows: the same bytes as before."""

from __future__ import annotations

import math

import pytest
from typed_events import event_of

from hil.evidence.recordings.hdf5 import convert, revert
from hil.evidence.recordings.row_file import BLOCK
from hil.evidence.recordings.rows import Rows

CHANNELS = [{"name": "x", "unit": "uT", "instrument": "m"}, {"name": "y", "unit": "uT", "instrument": "m"}]
BEGUN = event_of("recording", recording="001-rest", name="rest", channels=CHANNELS, rate=10.0, source="simulated")


def converted(folder, count):
    """Write a recording, convert it, and return the bytes of its row file."""
    path = folder / "001-rest.rows"
    rows = Rows(path, recording="001-rest", channels=[("x", "uT"), ("y", "uT")], on_block=lambda *_: None)
    for place in range(count):
        rows.append((place / 10, math.sin(place), math.nan))
    end = rows.finish()
    ended = event_of("recording-end", rows=end.rows, sha256=end.sha256, complete=True, gaps=end.largest_gap_s)
    convert(path, folder / "001-rest.h5", begun=BEGUN, ended=ended)
    return path.read_bytes()


@pytest.mark.parametrize("count", [0, 1, BLOCK + 1])
def test_rows_come_back_byte_by_byte(tmp_path, count):
    """Header, rows and NaN are those that were converted, and the HDF5 file makes room for the next one."""
    before = converted(tmp_path, count)
    (tmp_path / "001-rest.rows").unlink()
    revert(tmp_path, [BEGUN, BEGUN])
    assert [path.name for path in tmp_path.iterdir()] == ["001-rest.rows"]
    assert (tmp_path / "001-rest.rows").read_bytes() == before


def test_rows_that_are_there_still_are_left_alone(tmp_path):
    """They are the original; an HDF5 file beside them may be of fewer rows than come now."""
    converted(tmp_path, 3)
    (tmp_path / "001-rest.rows").write_bytes(b"rows")
    revert(tmp_path, [BEGUN])
    assert (tmp_path / "001-rest.rows").read_bytes() == b"rows"
    assert not (tmp_path / "001-rest.h5").exists()
