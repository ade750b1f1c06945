"""A soak that was interrupted goes on with what has not passed."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

_CONFTEST = """\
from pathlib import Path
from passed_before import PassedBefore

def pytest_configure(config):
    config.pluginmanager.register(PassedBefore(Path("kept/passed"), config))
"""
_TESTS = """\
import os
import pytest

@pytest.fixture
def spoilt():
    yield
    assert "GOOD" in os.environ

def test_good():
    pass

def test_bad():
    assert "GOOD" in os.environ

def test_taken_down_badly(spoilt):
    pass

@pytest.mark.skipif("GOOD" not in os.environ, reason="not today")
def test_skipped():
    pass
"""
_ROOT = Path(__file__).parents[2]
_SUPPORT = _ROOT / "tests/support"


def ran(folder, *options, code=0, **environment):
    """Run the tests of a folder, which ends with this code, and return what it printed."""
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", *options],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(_SUPPORT), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == code, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("options", [(), pytest.param(("-n", "2"), marks=pytest.mark.system)], ids=["one", "workers"])
def test_only_what_has_not_passed_is_run_again(tmp_path, options):
    """What failed, what failed when it was taken down, and what was skipped is; the rest is left out and counted."""
    (tmp_path / "conftest.py").write_text(_CONFTEST)
    (tmp_path / "test_some.py").write_text(_TESTS)
    first = ran(tmp_path, *options, code=1)
    assert "1 failed, 2 passed, 1 skipped, 1 error" in first
    assert f"1 tests have passed, 0 of them before: {Path('kept/passed')}" in first
    second = ran(tmp_path, *options, GOOD="1")
    assert "3 passed" in second
    assert "4 tests have passed, 1 of them before" in second
    assert len((tmp_path / "kept/passed").read_text().split()) == 4
    assert "4 tests have passed, 4 of them before" in ran(tmp_path, *options, GOOD="1")  # and make goes on


def test_a_part_without_tests_is_an_error(tmp_path):
    """Nothing has passed: the options select nothing."""
    (tmp_path / "conftest.py").write_text(_CONFTEST)
    assert "0 tests have passed" in ran(tmp_path, code=5)


def test_each_part_of_a_soak_goes_on_with_the_file_that_the_first_has_begun(tmp_path):
    """A file that exists must not be taken for one with tests: pytest would not know our options then."""
    for name in ("pyproject.toml", "src", "tests"):
        (tmp_path / name).symlink_to(_ROOT / name)
    told = subprocess.run(["make", "-n", "soak"], cwd=_ROOT, capture_output=True, text=True, check=True).stdout
    parts = [shlex.split(line)[3:] for line in told.splitlines() if "--soak" in line]
    assert len(parts) == 2
    for part in parts:
        file = tmp_path / re.findall(r"--passed-before[ =](\S+)", " ".join(part))[0]
        file.parent.mkdir(exist_ok=True)
        file.touch()
        assert "--passed-before=FILE" in ran(tmp_path, *part, "--help")
