"""Full disks, torn tails, and processes that end between any two steps: nothing recorded is lost."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
from pathlib import Path

import pytest
import sweeps
from evidence_runs import begin, record, sealed_run, stamps, whole_case, write_report
from told_as_json import bodies
from typed_events import event_of

from hil.cli.died import why_not_resumed
from hil.evidence.folder import JOURNAL, RECORDINGS, RESERVE, RESULTS, TORN, create, hold
from hil.evidence.journal.reader import cut_torn_tail, read_journal
from hil.evidence.journal.writer import Journal
from hil.evidence.ledger.book import read
from hil.evidence.ledger.entries import Sealed
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import recover, seal
from hil.evidence.package.verification import State, verify
from hil.evidence.recordings.hdf5 import convert
from hil.evidence.recordings.row_file import read_rows
from hil.evidence.recordings.rows import Rows
from hil.model.errors import EvidenceError

KILLED = 9

# A child that only seals and exits takes no lock that another thread could hold.
pytestmark = pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")


class Disk:
    """A disk with so many bytes left; the reserve is worth some more."""

    def __init__(self, space, reserve, worth=10_000):
        self.space = space
        self.reserve = reserve
        self.worth = worth
        reserve.write_bytes(b"")

    def write(self, descriptor, data):
        """Write what fits, as a disk that fills up does."""
        if self.worth and not self.reserve.exists():
            self.space, self.worth = self.space + self.worth, 0
        if self.space <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        count = os.write(descriptor, bytes(data[: self.space]))
        self.space -= count
        return count


@pytest.mark.parametrize("space", [0, 1, 100, 250, 400])
def test_the_end_is_written_down_on_a_full_disk(tmp_path, space):
    """Wherever the disk fills up: the event is whole, the error comes once, and the safe end still goes in."""
    disk = Disk(space, tmp_path / "reserve.bin")
    told = 0
    with Journal(tmp_path / "j", reserve=disk.reserve, stamp=stamps(), write=disk.write) as journal:
        for number in range(5):
            try:
                journal.write(event_of("note", text=str(number), by=""), 0.0)
            except EvidenceError as error:
                told += "disk full" in str(error)
        journal.write(event_of("safe-end", ok=True), 1.0)
        assert journal.lost == 0
    reading = read_journal(tmp_path / "j")
    assert told == 1
    assert not disk.reserve.exists()
    assert (reading.findings, reading.torn) == ((), b"")
    assert [event["kind"] for event in bodies(reading)] == ["note"] * 5 + ["safe-end"]


def test_events_that_found_no_space_are_counted(tmp_path):
    """Without any reserve left, the journal stays whole, nothing raises again, and the loss is an event later."""
    disk = Disk(300, tmp_path / "reserve.bin", worth=0)
    with Journal(tmp_path / "j", reserve=disk.reserve, stamp=stamps(), write=disk.write) as journal:
        journal.write(event_of("note", text="fits"), 0.0)
        with pytest.raises(EvidenceError, match="disk full"):
            journal.write(event_of("note", text="x" * 300), 0.0)
        assert journal.write(event_of("note", text="y" * 300), 0.0) == -1
        assert journal.lost == 2
        assert read_journal(tmp_path / "j").torn == b""
        disk.space = 10_000
        journal.write(event_of("safe-end", ok=True), 1.0)
        assert journal.lost == 0
    reading = read_journal(tmp_path / "j")
    assert reading.findings == ()
    assert [event["kind"] for event in bodies(reading)] == ["note", "anomaly", "safe-end"]
    assert "2 events before this one" in bodies(reading)[1]["text"]


def test_a_sync_that_finds_no_space_is_a_full_disk_too(tmp_path):
    """A file system that tells only at the sync gets the reserve, and tells once."""
    (tmp_path / "reserve.bin").write_bytes(b"")

    def sync(_):
        if (tmp_path / "reserve.bin").exists():
            raise OSError(errno.ENOSPC, "No space left on device")

    with Journal(tmp_path / "j", reserve=tmp_path / "reserve.bin", stamp=stamps(), sync=sync) as journal:
        with pytest.raises(EvidenceError, match="disk full"):
            journal.write(event_of("step"), 0.0)
        assert journal.write(event_of("step-end"), 0.0) == 1


def test_a_broken_disk_is_no_full_disk(tmp_path):
    """An input/output error keeps the reserve and says what it is."""
    (tmp_path / "reserve.bin").write_bytes(b"")

    def fail(*_):
        raise OSError(errno.EIO, "Input/output error")

    with Journal(tmp_path / "j", reserve=tmp_path / "reserve.bin", stamp=stamps(), write=fail) as journal:
        for _ in range(2):
            with pytest.raises(EvidenceError, match="Input/output error"):
                journal.write(event_of("note"), 0.0)
    assert (tmp_path / "reserve.bin").exists()


def test_rows_wait_where_the_disk_is_full(tmp_path):
    """No half row is left behind, and rows that found no space are written once there is some."""
    disk = Disk(150, tmp_path / "reserve.bin", worth=0)
    wall = iter(range(100))
    rows = Rows(
        tmp_path / "a.rows", recording="1", channels=[("x", "uT")], on_block=print,
        reserve=disk.reserve, now=lambda: float(next(wall)), write=disk.write,
    )  # fmt: skip
    for index in range(4):
        rows.append((index, index))
    with pytest.raises(EvidenceError, match="disk full"):
        rows.tick()
    assert (read_rows(tmp_path / "a.rows").rows, read_rows(tmp_path / "a.rows").torn) == (0, 0)
    disk.space = 1000
    assert rows.finish().rows == 4
    assert read_rows(tmp_path / "a.rows").rows == 4


@pytest.fixture
def small_disk(tmp_path):
    """Return a file system of 12 MB."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = shutil.which("mount")
    done = mount and subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=12m", "tmpfs", place], capture_output=True, check=False
    )
    if not done or done.returncode:
        pytest.skip("mounting a small file system needs rights that this user does not have")
    yield place
    subprocess.run(["umount", "--lazy", place], check=True)


def test_a_real_full_disk_can_be_written_an_end_on(small_disk):
    """With the last byte taken by somebody else, the run's end goes into the reserve, and the package is sealed."""
    folder = create(small_disk, bench="b", dut="d")
    journal = begin(folder)
    whole_case(folder, journal)
    with (small_disk / "somebody").open("wb", buffering=0) as stream, pytest.raises(OSError, match="No space left"):
        while True:
            stream.write(bytes(4096))
    with pytest.raises(EvidenceError, match="disk full"):
        for number in range(10_000):
            journal.write(event_of("note", text=str(number), by=""), 6.0)
    journal.write(event_of("stop", reason="disk full", urgent=False), 6.0)
    seal(folder, journal, exit_code=1, write_reports=write_report)
    verification = verify(folder)
    assert (verification.state, verification.complete, verification.verdict) == (State.SEALED, False, "ABORTED")


@pytest.mark.system
@pytest.mark.parametrize("pages", [0, 1, 2, 3, 40])
def test_a_real_disk_with_little_space_is_full_and_nothing_worse(small_disk, pages):
    """HDF5 that found no space for its last page ended the process, or was a traceback; every row is still there."""
    folder = create(small_disk, bench="b", dut="d")
    with begin(folder) as journal:
        whole_case(folder, journal)
    (folder / RESERVE).unlink()
    somebody = small_disk / "somebody"
    with somebody.open("wb") as stream:
        os.posix_fallocate(stream.fileno(), 0, shutil.disk_usage(small_disk).free - pages * 4096)
    with pytest.raises(EvidenceError, match="cannot be sealed: disk full") as full:
        recover(folder, write_reports=write_report)
    assert full.value.hint == "nothing is lost; free some space and seal it with hil seal"
    assert why_not_resumed(folder / JOURNAL) == "because it is sealed in part"
    somebody.unlink()
    recover(folder, write_reports=write_report)
    assert verify(folder).findings == ()
    assert len(read(small_disk).of(Sealed)) == 1


def seventy(tmp_path):
    """Return the folder and journal of a run of seventy recordings, about to be sealed."""
    folder = create(tmp_path, bench="b", dut="d")
    journal = begin(folder)
    whole_case(folder, journal)
    for number in range(69):
        record(folder, journal, 5, identifier=f"{number + 100}-rest")
    return folder, journal


def test_rows_go_once_the_names_of_their_hdf5_are_synced(tmp_path, monkeypatch):
    """Sealing syncs the folder for 64 recordings at once, and removes no rows before that."""
    folder, journal = seventy(tmp_path)
    there = []

    def sync(path):
        if path == folder / RECORDINGS:
            there.append((len(list(path.glob("*.rows"))), len(list(path.glob("*.h5")))))

    monkeypatch.setattr("hil.evidence.package.sealing.sync_folder", sync)
    seal(folder, journal, exit_code=0, write_reports=write_report)
    assert there == [(70, 64), (6, 70), (0, 70)]
    assert verify(folder).findings == ()


def test_a_disk_that_is_full_at_the_conversion_gets_the_space_of_converted_rows(tmp_path, monkeypatch):
    """Rows that wait for their removal are removed, and the conversion goes on."""
    folder, journal = seventy(tmp_path)

    def small(rows, hdf5, **facts):
        if len(list(hdf5.parent.glob("*.h5"))) + len(list(hdf5.parent.glob("*.rows"))) > 80:
            raise OSError(errno.ENOSPC, "No space left on device")
        convert(rows, hdf5, **facts)

    monkeypatch.setattr("hil.evidence.package.sealing.convert", small)
    seal(folder, journal, exit_code=0, write_reports=write_report)
    assert verify(folder).findings == ()


def test_a_row_file_whose_beginning_was_lost_is_kept(tmp_path):
    """The power fails before the event that begins a recording is on the disk: the file is set aside, and told."""
    folder = create(tmp_path, bench="b", dut="d")
    begin(folder).close()
    Rows(folder / RECORDINGS / "002-rest.rows", recording="002-rest", channels=[("x", "V")], on_block=print)
    recover(folder, write_reports=write_report)
    verification = verify(folder)
    assert (verification.state, verification.findings) == (State.SEALED, ())
    assert (tmp_path / ".aside" / folder.name / RECORDINGS / "002-rest.rows").exists()
    assert "002-rest.rows: no event introduced this file" in bodies(Package(folder), "anomaly")[0]["text"]


def test_a_seal_without_space_can_be_finished_later(tmp_path, monkeypatch):
    """A disk that is full at the conversion is an error in words; with space again the run is sealed."""
    folder = create(tmp_path, bench="b", dut="d")
    journal = begin(folder)
    whole_case(folder, journal)

    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr("hil.evidence.package.sealing.convert", full)
        with pytest.raises(EvidenceError, match="disk full"):
            seal(folder, journal, exit_code=0, write_reports=write_report)
    journal.close()
    recover(folder, write_reports=write_report)
    assert verify(folder).state is State.SEALED


def test_a_torn_tail_is_cut_at_every_byte(tmp_path):
    """Wherever a line was torn: the lines before stay, and the tail is kept once, and told until an event tells it."""
    folder = tmp_path / "run"
    begin(folder).close()
    data = (folder / JOURNAL).read_bytes()
    start = data.rindex(b"\n", 0, -1) + 1
    whole = data[:start].count(b"\n")
    for end in range(start, len(data)):
        (folder / JOURNAL).write_bytes(data[:end])
        (folder / TORN).unlink(missing_ok=True)
        assert cut_torn_tail(folder) == end - start
        reading = read_journal(folder / JOURNAL)
        assert (len(reading.lines), reading.torn, reading.findings) == (whole, b"", ())
        assert cut_torn_tail(folder) == end - start
        assert ((folder / TORN).read_bytes() if end > start else b"") == data[start:end]


def test_a_tail_that_was_kept_and_not_cut_is_kept_once(tmp_path):
    """A process that ended between keeping and cutting leaves one copy of the tail, not two."""
    begin(tmp_path).close()
    with (tmp_path / JOURNAL).open("ab") as stream:
        stream.write(b'{"body":')
    (tmp_path / TORN).write_bytes(b'{"body":')
    assert cut_torn_tail(tmp_path) == 8
    assert (tmp_path / TORN).read_bytes() == b'{"body":'


def test_a_second_tail_like_the_first_is_kept_as_well(tmp_path):
    """Two lines that were torn at the same place are two, where an event tells of the first."""
    journal = begin(tmp_path)
    journal.write(event_of("recovered", torn_bytes=8, text="sealed as it is"), 1.0)
    journal.close()
    with (tmp_path / JOURNAL).open("ab") as stream:
        stream.write(b'{"body":')
    (tmp_path / TORN).write_bytes(b'{"body":')
    assert cut_torn_tail(tmp_path) == 8
    assert (tmp_path / TORN).read_bytes() == b'{"body":' * 2


def test_a_torn_run_is_recovered_and_says_so(tmp_path):
    """The package holds the tail, and an event tells how long it was."""
    folder = create(tmp_path, bench="b", dut="d")
    begin(folder).close()
    with (folder / JOURNAL).open("ab") as stream:
        stream.write(b'{"body":{"kind":"che')
    recover(folder, write_reports=write_report)
    assert verify(folder).findings == ()
    package = Package(folder)
    assert bodies(package, "recovered")[0]["torn_bytes"] == 20
    assert package.text(TORN) == '{"body":{"kind":"che'


def dies_at(step, work):
    """Run `work` in a child that is gone at its n-th touch of the disk; return whether it came to its end."""
    child = os.fork()
    if child == 0:  # pragma: no cover - another process
        left = step

        def counted(original):
            def touch(*arguments, **options):
                nonlocal left
                if left == 0:
                    os._exit(KILLED)
                left -= 1
                return original(*arguments, **options)

            return touch

        try:
            for owner, name in (
                (Path, "replace"), (Path, "unlink"), (Path, "chmod"),
                (os, "fsync"), (os, "truncate"), (shutil, "rmtree"),
            ):  # fmt: skip
                setattr(owner, name, counted(getattr(owner, name)))
            Journal._put_some = counted(Journal._put_some)
            work()
        except BaseException:  # noqa: BLE001 - the parent sees the exit code
            os._exit(1)
        os._exit(0)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in {0, KILLED}
    return code == 0


def unsealed(tmp_path, step):
    """Return the folder and journal of a run that is about to be sealed, and kept open."""
    folder = tmp_path / str(step)
    (folder / "inbox/files").mkdir(parents=True)
    (folder / RESERVE).write_bytes(b"reserve")
    journal = begin(folder)
    whole_case(folder, journal)
    return folder, journal


STRIDE = sweeps.chosen(9, 1)  # of the steps after which a seal or a recovery is killed


@pytest.mark.system
def test_a_seal_that_dies_anywhere_is_finished(tmp_path):
    """Whichever step of sealing was the last one, recovery seals a package without findings."""
    verdicts = set()
    for step in range(0, 500, STRIDE):
        folder, journal = unsealed(tmp_path, step)

        def work(folder=folder):
            with hold(folder):
                journal = Journal(folder / JOURNAL, reserve=folder / RESERVE)  # one writer: this child
                seal(folder, journal, exit_code=0, write_reports=write_report)

        journal.close()
        done = dies_at(step, work)
        decided = (folder / RESULTS).exists() and b'"kind":"results"' in (folder / JOURNAL).read_bytes()
        recover(folder, write_reports=write_report)
        verification = verify(folder)
        assert (verification.state, verification.findings) == (State.SEALED, ()), step
        assert verification.verdict == ("PASS" if decided else "ABORTED"), step
        assert not (folder / RESERVE).exists()
        verdicts.add(verification.verdict)
        if done:
            break
    assert step > 30
    assert verdicts == {"PASS", "ABORTED"}


@pytest.mark.system
def test_a_recovery_that_dies_anywhere_is_finished(tmp_path):
    """Whichever step of a recovery was the last one, the next recovery seals the run; its tail and rows are there."""
    for step in range(0, 500, STRIDE):
        folder, journal = unsealed(tmp_path, step)
        journal.write(event_of("case", case="test_rest", attempt=2), 6.0)
        channels = [{"name": "x", "unit": "1", "instrument": "psu1", "calibration": "", "uncertainty": None}]
        journal.write(
            event_of(
                "recording",
                case="test_rest",
                step="1",
                recording="002",
                name="r",
                channels=channels,
                rate=1,
                duration=2,
                source="hardware",
            ),
            6.0,
        )
        Rows(folder / "data/recordings/002.rows", recording="002", channels=[("x", "1")], on_block=print).finish()
        journal.close()
        with (folder / JOURNAL).open("ab") as stream:
            stream.write(b"half")
        done = dies_at(step, lambda folder=folder: recover(folder, write_reports=write_report))
        recover(folder, write_reports=write_report)
        verification = verify(folder)
        assert (verification.state, verification.findings) == (State.SEALED, ()), step
        assert (verification.verdict, verification.complete) == ("ABORTED", False)
        assert Package(folder).text(TORN) == "half"
        assert [event["recording"] for event in bodies(Package(folder), "recording-end")] == ["001-rest", "002"]
        if done:
            break
    assert step > 30


def test_a_sealed_run_is_left_alone(tmp_path):
    """Recovering a sealed package changes no byte of it."""
    digest = sealed_run(tmp_path / "run")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "run").rglob("*")}
    assert recover(tmp_path / "run", write_reports=write_report) == digest
    assert {path: path.stat().st_mtime_ns for path in (tmp_path / "run").rglob("*")} == before
