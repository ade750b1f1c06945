"""What every test of whole processes needs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from workspaces import end_started

OWN_LATCHES = Path(__file__).parents[1] / "support/own_latches"


@pytest.fixture(scope="session", autouse=True)
def latches(tmp_path_factory):
    """Keep the latches of all runs that tests start in a folder of theirs, and return it.

    A test that is broken off leaves a latch, as it must; among those of the machine it would lie for ever.
    """
    folder = tmp_path_factory.mktemp("latches")
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("HIL_TESTS_LATCHES", str(folder))
        patched.setenv("PYTHONPATH", str(OWN_LATCHES), prepend=os.pathsep)
        patched.setattr("hil.guardian.latch.PLACES", (folder,))
        yield folder


@pytest.fixture(autouse=True)
def no_process_is_left():
    """End the processes that a failed test leaves."""
    yield
    end_started()
