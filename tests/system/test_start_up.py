"""Start-up is part of the interface: help comes at once, and other people's test runs pay nothing."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time

import pytest

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(480)]

PYTHON = sys.executable
MOST_PYTHONS = 8.0
MOST_SECONDS = 0.030


def seconds(*command, cwd):
    """Return how long a whole process takes."""
    began = time.perf_counter()
    subprocess.run(command, cwd=cwd, check=True, capture_output=True)
    return time.perf_counter() - began


def alternating(first, second, cwd, pairs):
    """Return the durations of two commands that were run in turns, so that both see the same machine."""
    times = [(seconds(*first, cwd=cwd), seconds(*second, cwd=cwd)) for _ in range(pairs)]
    return tuple(zip(*times, strict=True))


def holds_at_last(measure, attempts=3):
    """Return whether a measurement holds; a machine that was busy with something else gets other chances."""
    return any(measure() for _ in range(attempts))


def test_help_takes_eight_pythons_at_most(tmp_path):
    """`hil --help` as a whole process, in units of a Python that does nothing."""

    def measure():
        nothing, helped = alternating(
            (PYTHON, "-c", "pass"), (PYTHON, "-m", "hil.cli", "--help"), cwd=tmp_path, pairs=7
        )
        return statistics.median(helped) <= MOST_PYTHONS * statistics.median(nothing)

    assert holds_at_last(measure)


def test_an_unrelated_pytest_run_pays_thirty_milliseconds_at_most(tmp_path):
    """A project that has nothing to do with benches does not notice that the plugin is installed."""
    (tmp_path / "test_nothing.py").write_text("def test_nothing():\n    pass\n")
    run = (PYTHON, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_nothing.py")

    def measure():
        without, installed = alternating((*run, "-p", "no:hil"), run, cwd=tmp_path, pairs=11)
        differences = [more - less for less, more in zip(without, installed, strict=True)]
        # Both are upper bounds of what the plugin costs; load on the machine only ever adds.
        return min(statistics.median(differences), min(installed) - min(without)) <= MOST_SECONDS

    assert holds_at_last(measure)


HEAVY = ("h5py", "jinja2", "matplotlib", "numpy", "pint", "pydantic", "pymodbus", "pytest", "scipy", "serial", "yaml")


def test_help_imports_nothing_heavy(tmp_path):
    """What no help text needs is not imported for it."""
    code = (
        "import sys\n"
        "from hil.cli.main import main\n"
        "try:\n    main(['--help'])\n"
        f"except SystemExit:\n    sys.exit(' '.join(sorted(set({HEAVY!r}) & set(sys.modules))) or 0)\n"
    )
    done = subprocess.run([PYTHON, "-c", code], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_plugin_imports_nothing_heavy_without_a_bench(tmp_path):
    """An unrelated run loads the plugin's options, and none of the rooms behind them."""
    (tmp_path / "test_rooms.py").write_text(
        "import sys\n\n"
        "def test_rooms():\n"
        "    loaded = {name for name in sys.modules if name.startswith('hil.')}\n"
        "    assert loaded == {'hil.plugin', 'hil.plugin.options'}\n"
        "    assert 'numpy' not in sys.modules\n"
    )
    done = subprocess.run(
        # pytest-randomly imports NumPy for its own sake
        [PYTHON, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", "test_rooms.py"],
        cwd=tmp_path,
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout
