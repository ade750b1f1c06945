"""Tests that send signals pass under `nohup` and in the background of a script as well, where a soak often runs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]
_HEARS = "import signal as s; print([s.getsignal(each) is not s.SIG_IGN for each in (s.SIGINT, s.SIGHUP)])"
_DEAF = 'trap "" INT HUP; exec "$@"'


def test_what_is_started_hears_requests_to_end():
    """Whatever the process of the tests ignores itself."""
    done = subprocess.run([sys.executable, "-c", _HEARS], capture_output=True, text=True, check=True)
    assert done.stdout == "[True, True]\n"


@pytest.mark.parametrize("options", [(), pytest.param(("-n", "2"), marks=pytest.mark.system)], ids=["one", "workers"])
def test_also_where_these_were_ignored_from_the_start(options):
    """The test above passes where a shell ignores both."""
    test = f"{__file__}::{test_what_is_started_hears_requests_to_end.__name__}"
    pytest_there = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options, test]
    done = subprocess.run(
        ["sh", "-c", _DEAF, "sh", *pytest_there], cwd=_ROOT, capture_output=True, text=True, check=False
    )
    assert "1 passed" in done.stdout, done.stdout + done.stderr
