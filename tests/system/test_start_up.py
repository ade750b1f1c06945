"""Start-up is part of the interface: help comes at once, and other people's test runs pay nothing."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.system

PYTHON = sys.executable
MOST_PYTHONS = 8.0
MOST_SECONDS = 0.030


def seconds(*command, cwd):
    """Return the processor time of a whole process: what else the machine does adds little to it."""
    process = subprocess.Popen(command, cwd=cwd, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime


def least(first, second, cwd, pairs):
    """Return the least times of two commands that were run in turns, so that both see the same machine."""
    times = [(seconds(*first, cwd=cwd), seconds(*second, cwd=cwd)) for _ in range(pairs)]
    return tuple(map(min, zip(*times, strict=True)))


def holds_at_last(measure, attempts=3):
    """Return whether a measurement holds; a machine that was busy with something else gets other chances."""
    return any(measure() for _ in range(attempts))


def test_help_takes_eight_pythons_at_most(tmp_path):
    """`hil --help` as a whole process, in units of a Python that does nothing."""

    def measure():
        nothing, helped = least((PYTHON, "-c", "pass"), (PYTHON, "-m", "hil.cli", "--help"), cwd=tmp_path, pairs=5)
        return helped <= MOST_PYTHONS * nothing

    assert holds_at_last(measure)


def test_an_unrelated_pytest_run_pays_thirty_milliseconds_at_most(tmp_path):
    """A project that has nothing to do with benches does not notice that the plugin is installed."""
    (tmp_path / "test_nothing.py").write_text("def test_nothing():\n    pass\n")
    run = (PYTHON, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_nothing.py")

    def measure():
        without, installed = least((*run, "-p", "no:hil"), run, cwd=tmp_path, pairs=5)
        return installed - without <= MOST_SECONDS  # load on the machine only ever adds

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
