"""Leases: one executive per instrument, whoever dies."""

from __future__ import annotations

import os
import stat
import subprocess
import sys

import pytest

from hil.bench.lease import Lease
from hil.model.errors import Refused

HOLD = """
import sys
from pathlib import Path
from hil.bench.lease import Lease
lease = Lease(["psu1"], "a run of jig", Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


def test_second_holder_is_told_who_the_first_is(tmp_path):
    """The refusal names key, run, process and since when, and what to do; the run once it has a name."""
    first = Lease(["psu1", "mag1"], "a run of magnetorquer", tmp_path)
    who = rf"a run of magnetorquer \(process {os.getpid()}\)"
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
        with pytest.raises(Refused, match=rf"held by a run of jig \(process {process.pid}\)"):
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


def test_leases_are_for_every_user_of_the_host(tmp_path):
    """Folder and files can be opened by others, whatever the umask was."""
    folder = tmp_path / "leases"
    before = os.umask(0o077)
    try:
        lease = Lease(["psu1"], "a run", folder)
    finally:
        os.umask(before)
    (file,) = folder.iterdir()
    assert stat.S_IMODE(folder.stat().st_mode) == 0o1777
    assert stat.S_IMODE(file.stat().st_mode) == 0o666
    lease.release()


def test_folder_that_cannot_hold_leases_is_refused(tmp_path):
    """A file in its place is a sentence, not a traceback; and a link is not followed."""
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(Refused, match="leases in .*file cannot be taken: Not a directory; check who owns it"):
        Lease(["psu1"], "a run", tmp_path / "file")
    Lease(["psu1"], "a run", tmp_path / "leases").release()
    (file,) = (tmp_path / "leases").iterdir()
    file.unlink()
    file.symlink_to(tmp_path / "file")
    with pytest.raises(Refused, match="cannot be taken"):
        Lease(["psu1"], "a run", tmp_path / "leases")
