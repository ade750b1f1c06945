"""Leases: one executive per instrument, whoever dies."""

from __future__ import annotations

import fcntl
import getpass
import hashlib
import json
import os
import shutil
import stat
import subprocess
import sys

import pytest
from tmpfiles import NOBODY, another_user, as_root, clean, folder_for_all, has_tmpfiles, make_old, really_clean

from hil.bench.lease import Lease, holds_a_lease
from hil.model.errors import Refused

HOLD = """
import sys
from pathlib import Path
from hil.bench.lease import Lease
lease = Lease(["psu1"], "a run of jig", Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def note_of(key, folder):
    """Return where this user notes that it holds a key."""
    return folder / f"{hashlib.sha256(key.encode()).hexdigest()[:24]}-{os.geteuid()}.note"


def test_second_holder_is_told_who_the_first_is(tmp_path):
    """The refusal names key, run, process and since when, and what to do; the run once it has a name."""
    first = Lease(["psu1", "mag1"], "a run of magnetorquer", tmp_path)
    who = rf"a run of magnetorquer \(process {os.getpid()} of user {getpass.getuser()}\)"
    since = r"since \d{4}-\d\d-\d\dT\d\d:\d\d:\d\d"
    with pytest.raises(Refused, match=rf"mag1 is held by {who} {since}.*; wait for it to end$"):
        Lease(["mag1"], "a run of jig", tmp_path)
    first.name("20260101T080000Z-adcs-SN1-ab12")
    told = rf"mag1 is held by {who} {since}.*, as 20260101T080000Z-adcs-SN1-ab12; wait .* 'hil stop 2026.*-ab12'"
    with pytest.raises(Refused, match=told):
        Lease(["mag1"], "a run of jig", tmp_path)
    first.release()


def test_released_lease_can_be_taken_again(tmp_path):
    """After release the next one gets it, and its words stand there; releasing twice is harmless."""
    first = Lease(["psu1"], "a run with a very long name", tmp_path)
    first.release()
    first.release()
    assert list(tmp_path.iterdir()) == []
    second = Lease(["psu1"], "short", tmp_path)
    with pytest.raises(Refused, match=r"held by short \(process"):
        Lease(["psu1"], "third", tmp_path)
    second.release()


def test_what_was_taken_before_a_refusal_is_let_go(tmp_path):
    """Of several keys one is held: the others are free again."""
    held = Lease(["m"], "the first", tmp_path)
    with pytest.raises(Refused, match="m is held by the first"):
        Lease(["a", "m", "z"], "the second", tmp_path)
    Lease(["a", "z"], "the third", tmp_path).release()
    held.release()


def test_one_key_twice_is_one_lease(tmp_path):
    """Two instruments behind one key do not block each other."""
    Lease(["psu1", "psu1"], "a run", tmp_path).release()


def test_killed_process_blocks_nobody(tmp_path):
    """While it lives, another process holds its lease; killed, it holds nothing."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with process:
        assert process.stdout.readline() == "held\n"
        with pytest.raises(Refused, match=rf"held by a run of jig \(process {process.pid} of user .*\)"):
            Lease(["psu1"], "another", tmp_path)
        process.kill()
        process.wait()
        Lease(["psu1"], "another", tmp_path).release()


def test_note_that_nobody_can_read_does_not_hide_the_refusal(tmp_path):
    """A holder that died while writing its note is still another run."""
    first = Lease(["psu1"], "a run", tmp_path)
    (note,) = tmp_path.iterdir()
    note.write_text("{", encoding="utf-8")
    with pytest.raises(Refused, match="psu1 is held by another run"):
        Lease(["psu1"], "another", tmp_path)
    first.release()


def test_notes_are_for_every_user_of_the_host(tmp_path):
    """Others can read them and write their own beside, whatever the umask was, and cannot change them."""
    folder = tmp_path / "leases"
    before = os.umask(0o077)
    try:
        lease = Lease(["psu1"], "a run", folder)
    finally:
        os.umask(before)
    (file,) = folder.iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o1777
    assert stat.S_IMODE(file.stat().st_mode) == 0o1644
    lease.release()


@pytest.mark.parametrize("kind", ["a file", "a link"])
def test_a_lease_needs_no_note(tmp_path, kind):
    """Where notes cannot be written, the kernel keeps out others all the same; and a link is not followed."""
    folder, victim = tmp_path / "leases", tmp_path / "victim"
    victim.touch()
    if kind == "a file":
        folder.write_text("", encoding="utf-8")
    else:
        folder.mkdir()
        note_of("psu1", folder).symlink_to(victim)
    lease = Lease(["psu1"], "a run", folder)
    with pytest.raises(Refused, match=rf"psu1 is held by another run \(process {os.getpid()} of user"):
        Lease(["psu1"], "another", folder)
    assert victim.read_bytes() == b""
    lease.release()


def test_no_removed_file_gives_a_lease_away(tmp_path):
    """While the holder lives a second one is refused, whatever becomes of the files; the kernel says who holds it."""
    folder = tmp_path / "leases"
    lease = Lease(["psu1"], "a run", folder)
    lease.name("20260101T080000Z-adcs-SN1-ab12")
    shutil.rmtree(folder)
    who = rf"psu1 is held by another run \(process {os.getpid()} of user {getpass.getuser()}\); wait"
    with pytest.raises(Refused, match=who):
        Lease(["psu1"], "another", folder)
    assert holds_a_lease("20260101T080000Z-adcs-SN1-ab12", folder)
    lease.release()
    assert not holds_a_lease("20260101T080000Z-adcs-SN1-ab12", folder)
    Lease(["psu1"], "another", folder).release()


@pytest.mark.parametrize("cleaned", [clean, pytest.param(really_clean, marks=has_tmpfiles)], ids=["rules", "systemd"])
def test_ageing_takes_no_lease_of_a_living_run(tmp_path, cleaned):
    """After 35 days the second run is refused, and who holds the bench is still told."""
    folder = tmp_path / "leases"
    lease = Lease(["psu1"], "a run of cycles", folder)
    (folder / "other").touch()
    make_old(tmp_path, days=35)
    cleaned(tmp_path, 10)
    assert not (folder / "other").exists()
    with pytest.raises(Refused, match="psu1 is held by a run of cycles"):
        Lease(["psu1"], "another", folder)
    lease.release()


def test_a_guardian_holds_on_to_what_its_run_has_left(tmp_path):
    """The lease is held by whoever has its descriptor; that the run itself is gone is told."""
    hold = HOLD.replace("sys.stdin.read()", "import os\nif os.fork():\n    os._exit(0)\nsys.stdin.read()")
    with subprocess.Popen(
        [sys.executable, "-c", hold, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "held\n"
        process.wait()
        with pytest.raises(Refused, match=rf"a run of jig \(process {process.pid} .*, which has ended: its guardian"):
            Lease(["psu1"], "another", tmp_path)
        process.stdin.close()
        process.stdout.read()  # ends with the child
    Lease(["psu1"], "another", tmp_path).release()


def test_a_lease_of_an_earlier_version_is_honoured(tmp_path):
    """Those locked a file per key; a run of weeks may be among them."""
    tmp_path.joinpath("leases").mkdir()
    name = "20260101T080000Z-adcs-SN1-ab12"
    note = {"holder": "a run of jig", "pid": 12, "since": "2026-01-01T08:00:00Z", "run": name}
    path = tmp_path / "leases" / f"{hashlib.sha256(b'psu1').hexdigest()[:24]}.lease"
    path.write_text(json.dumps(note))
    with path.open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(Refused, match=rf"psu1 is held by a run of jig \(process 12\) since 2026.*, as {name}"):
            Lease(["psu1"], "another", tmp_path / "leases")
        assert holds_a_lease(name, tmp_path / "leases")
    assert not holds_a_lease(name, tmp_path / "leases")
    Lease(["psu1"], "another", tmp_path / "leases").release()


@as_root
def test_another_user_is_told_who_holds_what_and_takes_it_afterwards():
    """Name, process, since when, run and user; the note of one is in nobody's way."""
    with folder_for_all() as place:
        folder = place / "leases"
        lease = Lease(["psu1"], "a run of jig", folder)
        lease.name("20260101T080000Z-adcs-SN1-ab12")
        who = rf"psu1 is held by a run of jig \(process {os.getpid()} of user root\) since 20.*Z, as 20260101T08"
        with another_user(), pytest.raises(Refused, match=who):
            Lease(["psu1"], "another", folder)
        lease.release()
        with another_user():
            lease = Lease(["psu1"], "a run of nobody's", folder)
        with pytest.raises(Refused, match=rf"held by a run of nobody's \(process {os.getpid()} of user nobody\)"):
            Lease(["psu1"], "another", folder)
        lease.release()


@as_root
def test_nobody_speaks_for_another_user():
    """What is not the holder's own file is not told as its note, and is not written to."""
    with folder_for_all() as place:
        folder = place / "leases"
        folder.mkdir(mode=0o755)
        note = note_of("psu1", folder)
        note.write_text(json.dumps({"holder": "ask me first", "pid": os.getpid(), "since": "", "run": ""}))
        os.chown(note, NOBODY, NOBODY)
        note.chmod(0o666)
        lease = Lease(["psu1"], "a run", folder)
        with pytest.raises(Refused, match=r"psu1 is held by another run \(process"):
            Lease(["psu1"], "another", folder)
        assert "ask me first" in note.read_text()
        lease.release()
