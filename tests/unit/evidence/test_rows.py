"""Row files: bytes, hashes, and how soon they are on the disk."""

from __future__ import annotations

import hashlib
import struct

import numpy as np
import pytest

from hil.evidence.recordings.row_file import BLOCK, read_rows, row_blocks, table
from hil.evidence.recordings.rows import Rows
from hil.model.errors import Diverged, EvidenceError


class Wall:
    """A wall clock that stands until it is moved."""

    def __init__(self):
        self.seconds = 100.0

    def __call__(self):
        """Return its seconds."""
        return self.seconds


def rows_of(path, blocks=None, **options):
    """Return a row file with one channel; `blocks` collects what it tells."""
    told = [] if blocks is None else blocks
    return Rows(
        path,
        recording="001",
        channels=[("x", "uT")],
        on_block=lambda *told_now: told.append(told_now),
        **options,
    )


def content(path):
    """Return the rows of a file as a list of tuples."""
    found = read_rows(path)
    return [tuple(row) for block in row_blocks(found) for row in table(block, found.width)]


def test_rows_are_packed_after_a_header(tmp_path):
    """A row is little-endian float64 time and channels, and the hash is over all rows' bytes."""
    blocks = []
    rows = rows_of(tmp_path / "a.rows", blocks)
    rows.append((0.0, 1.5))
    rows.append((0.5, -2.0))
    rows.append((2.0, 3.0))
    end = rows.finish()
    packed = struct.pack("<6d", 0.0, 1.5, 0.5, -2.0, 2.0, 3.0)
    assert (tmp_path / "a.rows").read_bytes().endswith(b"}\n" + packed)
    assert (end.rows, end.sha256, end.largest_gap_s) == (3, hashlib.sha256(packed).hexdigest(), 1.5)
    assert blocks == [(3, end.sha256)]
    assert content(tmp_path / "a.rows") == [(0.0, 1.5), (0.5, -2.0), (2.0, 3.0)]
    assert read_rows(tmp_path / "a.rows").header["channels"] == [{"name": "x", "unit": "uT"}]


def test_a_hash_is_told_every_65536_rows_and_at_the_end(tmp_path):
    """The hashes are over everything so far, and the rows they cover are in the file by then."""
    blocks, sizes = [], []
    path = tmp_path / "a.rows"
    rows = rows_of(path, blocks)
    for index in range(2 * BLOCK + 10):
        rows.append((index, index))
        if len(blocks) > len(sizes):
            sizes.append(read_rows(path).rows)
    end = rows.finish()
    assert [count for count, _ in blocks] == [BLOCK, 2 * BLOCK, 2 * BLOCK + 10]
    assert sizes == [BLOCK, 2 * BLOCK]
    data = path.read_bytes()[read_rows(path).start :]
    assert [hashlib.sha256(data[: count * 16]).hexdigest() for count, _ in blocks] == [digest for _, digest in blocks]
    assert end.largest_gap_s == 1.0


def test_an_empty_recording_has_an_end_too(tmp_path):
    """No row at all is told as such."""
    blocks = []
    end = rows_of(tmp_path / "a.rows", blocks).finish()
    assert (end.rows, end.largest_gap_s, blocks) == (0, 0.0, [(0, hashlib.sha256().hexdigest())])


def test_no_row_is_away_from_the_disk_for_a_second(tmp_path):
    """With a tick every half second, a row is in the file within one second, and at once again afterwards."""
    wall = Wall()
    path = tmp_path / "a.rows"
    rows = rows_of(path, now=wall)
    for _ in range(3):
        wall.seconds += 7.0
        rows.tick()
        rows.append((wall.seconds, 1.0))
        before = read_rows(path).rows
        rows.tick()
        assert read_rows(path).rows == before
        wall.seconds += 0.5
        rows.tick()
        assert read_rows(path).rows == before + 1
    rows.finish()


def test_a_torn_last_row_is_left_out(tmp_path):
    """Half a row after a power cut is counted and not read."""
    path = tmp_path / "a.rows"
    rows = rows_of(path)
    rows.append((0.0, 1.0))
    rows.append((1.0, 2.0))
    rows.finish()
    path.write_bytes(path.read_bytes()[:-3])
    assert (read_rows(path).rows, read_rows(path).torn) == (1, 13)
    assert content(path) == [(0.0, 1.0)]


def test_a_row_file_that_exists_is_continued(tmp_path):
    """Hash, count and gap go on after the last whole row; other channels are refused."""
    path = tmp_path / "a.rows"
    rows = rows_of(path)
    rows.append((0.0, 1.0))
    rows.finish()
    path.write_bytes(path.read_bytes() + b"half")
    rows = rows_of(path)
    assert rows.rows == 1
    rows.append((3.0, 2.0))
    end = rows.finish()
    assert (end.rows, end.largest_gap_s) == (2, 3.0)
    assert end.sha256 == hashlib.sha256(struct.pack("<4d", 0.0, 1.0, 3.0, 2.0)).hexdigest()
    with pytest.raises(EvidenceError, match="other channels"):
        Rows(path, recording="001", channels=[("y", "uT")], on_block=print)


@pytest.mark.parametrize("data", [b"", b"no newline", b"[]\n", b"{}\n", b"\xff\n"])
def test_what_is_no_row_file_says_so(tmp_path, data):
    """A missing or foreign header is an error with the file's name."""
    (tmp_path / "a.rows").write_bytes(data)
    with pytest.raises(EvidenceError, match="row file"):
        read_rows(tmp_path / "a.rows")
    with pytest.raises(EvidenceError, match="row file"):
        read_rows(tmp_path / "missing.rows")


def test_a_row_of_another_width_is_a_mistake(tmp_path):
    """A sample with a number too many does not shift the ones that follow."""
    rows = rows_of(tmp_path / "a.rows")
    with pytest.raises(struct.error):
        rows.append((0.0, 1.0, 2.0))
    assert rows.finish().rows == 0


def test_blocks_of_rows_are_stored_as_row_by_row(tmp_path):
    """Blocks of any size, single rows between them, give the same bytes, hashes and gaps."""
    table_of_all = np.random.default_rng(1).normal(size=(BLOCK + 9000, 2))
    table_of_all[:, 0] = np.arange(len(table_of_all)) / 100.0
    told = {}
    for name, sizes in (("single", None), ("blocks", (1, 50, 4096, 5000, len(table_of_all)))):
        told[name] = []
        rows = rows_of(tmp_path / name, told[name])
        done = 0
        for size in sizes or ():
            rows.append_rows(table_of_all[done : done + size - 1])
            done = min(done + size - 1, len(table_of_all))
            if done < len(table_of_all):
                rows.append(tuple(table_of_all[done]))
                done += 1
        for row in table_of_all[done:]:
            rows.append(tuple(row))
        told[name].append(rows.finish())
    assert told["single"] == told["blocks"]
    assert (tmp_path / "single").read_bytes() == (tmp_path / "blocks").read_bytes()


@pytest.mark.parametrize("shape", [(3,), (3, 1), (3, 3)])
def test_a_block_of_another_width_is_a_mistake(tmp_path, shape):
    """A block whose rows have a number too many or too few is refused."""
    rows = rows_of(tmp_path / "a.rows")
    with pytest.raises(ValueError, match="shape"):
        rows.append_rows(np.zeros(shape))
    assert rows.finish().rows == 0


def filled(path, count, *, first=0.0, **options):
    """Write `count` rows to a file and return how they ended."""
    rows = rows_of(path, **options)
    for index in range(count):
        rows.append((float(index), first + index))
    return rows.finish()


def test_rows_that_come_again_are_compared_and_not_written_twice(tmp_path):
    """Rows that are made again are followed to the file's end, and go on from there with the same hash."""
    whole = filled(tmp_path / "whole.rows", 10)
    filled(tmp_path / "r.rows", 6)
    with (tmp_path / "r.rows").open("ab") as stream:
        stream.write(b"half a row")
    assert filled(tmp_path / "r.rows", 10, again=True) == whole
    assert (tmp_path / "r.rows").read_bytes() == (tmp_path / "whole.rows").read_bytes()


def test_other_rows_than_recorded_are_refused(tmp_path):
    """A row that comes out otherwise than it was recorded is Diverged, and the file stays as it was."""
    filled(tmp_path / "r.rows", 6)
    before = (tmp_path / "r.rows").read_bytes()
    with pytest.raises(Diverged, match="other rows"):
        filled(tmp_path / "r.rows", 6, again=True, first=100.0)
    with pytest.raises(Diverged, match="more than the 3 rows"):
        filled(tmp_path / "r.rows", 3, again=True)
    assert (tmp_path / "r.rows").read_bytes() == before


@pytest.mark.parametrize("size", [0, 30])
def test_a_file_that_ended_in_its_header_is_begun_again(tmp_path, size):
    """A machine that lost power then leaves half a header, and no row."""
    whole = filled(tmp_path / "whole.rows", 3)
    (tmp_path / "r.rows").write_bytes((tmp_path / "whole.rows").read_bytes()[:size])
    assert filled(tmp_path / "r.rows", 3, again=True) == whole
    assert (tmp_path / "r.rows").read_bytes() == (tmp_path / "whole.rows").read_bytes()


def test_it_is_known_when_all_rows_have_come_again(tmp_path):
    """Also while no further row comes."""
    filled(tmp_path / "r.rows", 2)
    rows = rows_of(tmp_path / "r.rows", again=True)
    told = [rows.comes_again]
    for index in range(2):
        rows.append((float(index), float(index)))
        rows.tick()
        told.append(rows.comes_again)
    assert told == [True, True, False]
    rows.finish()


@pytest.mark.parametrize("held", [2, 6])
@pytest.mark.parametrize("made", [0, 3, 6])
def test_rows_that_do_not_come_again_are_taken_over(tmp_path, made, held):
    """However many have come again, the rest of those named is passed over; more than were on the disk are new."""
    whole = filled(tmp_path / "whole.rows", 8)
    filled(tmp_path / "r.rows", held)
    rows = rows_of(tmp_path / "r.rows", again=True)
    for index in range(made):
        rows.append((float(index), float(index)))
    rows.skip(held)
    assert rows.rows == max(made, held)
    for index in range(rows.rows, 8):
        rows.append((float(index), float(index)))
    assert rows.finish() == whole
    assert (tmp_path / "r.rows").read_bytes() == (tmp_path / "whole.rows").read_bytes()


def test_rows_named_that_came_again_already_pass_nothing_over(tmp_path):
    """A run that is entered where it was entered before holds rows after those that were void then."""
    whole = filled(tmp_path / "r.rows", 8)
    rows = rows_of(tmp_path / "r.rows", again=True)
    for index in range(4):
        rows.append((float(index), float(index)))
    rows.skip(3)
    assert rows.rows == 4
    for index in range(4, 8):
        rows.append((float(index), float(index)))
    assert rows.finish() == whole
