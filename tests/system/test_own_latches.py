"""The latches of tests lie apart from those of the machine, in this process and in every one that tests start."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from hil.executive.setup.pins import pinned_environment
from hil.guardian import latch

pytestmark = pytest.mark.system

OF_THE_MACHINE = Path("/var/tmp/hil-latches")  # noqa: S108 - as in production
ASKED = """
from hil.guardian import latch
print(latch.PLACES[-1], latch.path_of("x").parent)
"""


def test_a_latch_of_a_test_is_none_of_the_machine(latches):
    """Whether this process makes it, a run in another one, or one without the environment of the tests."""
    assert latch.PLACES[-1] == latch.path_of("x").parent == latches != OF_THE_MACHINE
    asked = (sys.executable, "-P", "-c", ASKED)
    told = subprocess.run(asked, env=pinned_environment(), capture_output=True, text=True, check=True)
    assert told.stdout.split() == [str(latches)] * 2
    alone = subprocess.run(asked, env={}, capture_output=True, text=True, check=True)
    assert alone.stdout.split()[0] == str(OF_THE_MACHINE)
