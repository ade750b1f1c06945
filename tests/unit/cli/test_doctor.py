"""`hil doctor`: Python, packages and lock, and how what was found is told; the host has tests of its own."""

from __future__ import annotations

import json

import pytest

from hil.bench.host_checks import Check
from hil.cli.commands import doctor
from hil.cli.main import main

FOUND = [
    Check(name="disk", ok=True, detail="9.0 GB are free at /reports"),
    Check(name="ports", ok=None, detail="none"),
    Check(name="clock", ok=False, detail="no time server keeps it", todo="sudo timedatectl set-ntp true"),
]


@pytest.mark.parametrize(("found", "code", "last"), [(FOUND, 1, "1 of 3 not ok"), (FOUND[:2], 0, "ready for hardware")])
def test_what_was_found_is_told(capsys, monkeypatch, found, code, last):
    """A line each, what to type below it, and an exit code; as JSON the same."""
    monkeypatch.setattr(doctor, "_checks", lambda: iter(found))
    with pytest.raises(SystemExit) as left:
        main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    assert (left.value.code, lines[-1]) == (code, last)
    assert lines[:2] == ["ok      disk: 9.0 GB are free at /reports", "-       ports: none"]
    if code:
        assert lines[2:4] == ["NOT OK  clock: no time server keeps it", "          sudo timedatectl set-ntp true"]
    with pytest.raises(SystemExit) as left:
        main(["doctor", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert (left.value.code, [(each["name"], each["ok"]) for each in told["checks"]]) == (
        code,
        [(each.name, each.ok) for each in found],
    )


def test_the_interpreter_is_looked_at():
    """Its version, and whether it looks at assertions."""
    assert doctor._python((3, 12, 1), 0).ok
    assert "unset PYTHONOPTIMIZE" in doctor._python((3, 12, 1), 1).todo
    assert "3.11" in doctor._python((3, 10, 0), 0).todo


def test_what_changes_the_code_that_runs_is_named():
    """Such a run closes nothing, which is better known before it than after."""
    assert doctor._environment([]).ok
    found = doctor._environment(["LD_PRELOAD", "PYTHONPATH", "/etc/ld.so.preload"])
    assert (found.ok, found.todo) == (
        False,
        "unset LD_PRELOAD PYTHONPATH && take the libraries out of /etc/ld.so.preload",
    )
    assert found.detail.startswith("LD_PRELOAD, PYTHONPATH, /etc/ld.so.preload: ")


def test_doctor_asks_for_the_environment(monkeypatch):
    """The variables of this process are those that a run would have."""
    monkeypatch.setenv("PYTHONPATH", "elsewhere")
    found = next(each for each in doctor._checks() if each.name == "environment")
    assert "PYTHONPATH" in found.detail


def test_packages_are_compared_with_what_hil_needs():
    """A version outside its range and one that is missing are named; those of extras are not needed."""
    required = ("numpy>=2.0,<3", "click>=8.2", "pyvisa>=1; extra == 'visa'", "rich>=13")
    known = {"hil": "0.1.0", "numpy": "2.1", "click": "8.3", "rich": "14.0"}
    assert doctor._packages(required, known.get).ok
    found = doctor._packages(required, {**known, "numpy": "1.9", "rich": None}.get)
    assert (found.ok, found.todo) == (False, "pip install 'numpy<3,>=2.0' 'rich>=13'")
    assert "numpy 1.9" in found.detail
    assert "rich is missing" in found.detail


def test_the_environment_is_compared_with_its_lock():
    """Other versions and missing packages are named, the first few."""
    lock = "# by hand\nnumpy==2.1\nclick==8.3 \\\n    --hash=sha256:0\n"
    known = {"numpy": "2.1", "click": "8.3"}
    assert doctor._locked(lock, known.get).detail == "all 2 packages are as requirements.lock has them"
    found = doctor._locked(lock, {"numpy": "2.2"}.get)
    assert (found.ok, found.detail) == (False, "numpy 2.2, not 2.1, click is missing")


def test_ports_of_visa_need_pyvisa():
    """And the extra that brings it is told."""
    assert doctor._visa({"pyvisa": "1.15"}.get).ok
    assert "hil[visa]" in doctor._visa({}.get).todo
