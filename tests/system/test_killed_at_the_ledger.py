"""Killed at any moment around the seal and the ledger's entry, or two at once: nothing is lost by it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from sweeps import chosen

SUPPORT = Path(__file__).parents[1] / "support"

KILLED = """
import os, signal, sys
from pathlib import Path
from evidence_runs import begin, case_end, check, record, recorded_check, sealed_run, write_report
from hil.audit.cache import Cache
from hil.audit.packages import read_packages
from hil.evidence.folder import hold
from hil.evidence.ledger.book import append, check as findings_of, read
from hil.evidence.ledger.entries import Opened, Sealed, Status
from hil.evidence.package.sealing import recover, seal
from hil.evidence.package.verification import verify

WATCHED = {"open", "os.chmod", "os.link", "os.mkdir", "os.remove", "os.rename", "os.truncate", "os.utime"}

def fail(folder):
    folder.mkdir()
    with hold(folder):
        journal = begin(folder)
        record(folder, journal)
        recorded_check(journal)
        for axis in "xyz":
            check(journal, 0.9, of=axis, verdict="FAIL", margin=-0.41959963984540055,
                  reason="0.9 deg/s is above the maximum of 0.5 deg/s")
        case_end(journal, "FAIL", reasons=["it failed"])
        ready()
        seal(folder, journal, exit_code=1, write_reports=write_report)

def ready():
    count = 0
    def die(event, arguments):
        nonlocal count
        if event in WATCHED or event.startswith("fcntl"):
            count += 1
            if count == moment:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.addaudithook(die)

def standing(reports):
    return {each.run for each in read_packages(reports, Cache(None, "")) if each.sealed and each.named == each.digest}

moment, step, moments = 1, int(sys.argv[2]), 0
while True:
    reports = Path(sys.argv[1], str(moment))
    good, bad = reports / "20261121T093100Z-flight-SN1-aaaaaa", reports / "20261121T093200Z-flight-SN1-bbbbbb"
    sealed_run(good)
    before, stood = read(reports), standing(reports)
    child = os.fork()
    if not child:
        try:
            fail(bad)
        except BaseException:
            import traceback
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    after = read(reports)
    assert not after.findings, (moment, after.findings)
    assert after.hashes[: len(before.hashes)] == before.hashes, moment
    (entry,) = [each for each in read_packages(reports, Cache(None, "")) if each.run != good.name]
    assert standing(reports) - stood <= {bad.name}, moment
    assert entry.results["GYR-030"].verdict not in {"PASS", "RECORDED"}, (moment, entry.results)
    recover(bad, write_reports=write_report)
    ledger = read(reports)
    assert findings_of(reports) == (), (moment, findings_of(reports))
    assert [each.run for each in ledger.of(Sealed)] == [good.name, bad.name], moment
    assert verify(bad).findings == (), (moment, verify(bad).findings)
    (entry,) = [each for each in read_packages(reports, Cache(None, "")) if each.run != good.name]
    assert entry.results["GYR-030"].verdict == "FAIL", (moment, entry.results["GYR-030"].verdict)
    if status == 0:
        break
    assert status == 9, (moment, status)
    moments += 1
    moment += step
print(moments)
"""

AT_ONCE = """
import os, sys
from pathlib import Path
from evidence_runs import sealed_run
from hil.evidence.ledger.book import check, read
from hil.evidence.ledger.entries import Sealed

for turn in range(int(sys.argv[2])):
    reports = Path(sys.argv[1], str(turn))
    children = []
    for name in ("aaaaaa", "bbbbbb", "cccccc"):
        child = os.fork()
        if not child:
            try:
                sealed_run(reports / f"20261121T093100Z-flight-SN1-{name}")
            finally:
                os._exit(0)
        children.append(child)
    for child in children:
        assert os.waitpid(child, 0)[1] == 0
    assert check(reports) == (), check(reports)
    assert len({each.run for each in read(reports).of(Sealed)}) == 3
print("entered")
"""


def told(script, folder, number):
    """Return what a script said that was run in a process of its own."""
    command = [
        sys.executable,
        "-c",
        f"import sys; sys.path.insert(0, {str(SUPPORT)!r})\n{script}",
        str(folder),
        str(number),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()[-1]


@pytest.mark.system
@pytest.mark.timeout(600)
def test_killed_at_any_moment_of_the_seal(tmp_path):
    """A run that failed is killed: the ledger is whole, it never looks better, and sealed again it is entered once."""
    assert int(told(KILLED, tmp_path, chosen(4, 1))) >= 30


@pytest.mark.system
@pytest.mark.timeout(300)
def test_runs_that_are_sealed_at_once_are_all_entered(tmp_path):
    """Three runs begin and end at the same time in one folder of reports, 20 times: one chain with all of them."""
    assert told(AT_ONCE, tmp_path, chosen(5, 20)) == "entered"
