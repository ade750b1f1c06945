"""What every test of whole processes needs."""

from __future__ import annotations

import os
import secrets
import signal
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from guarded import until
from workspaces import end_started

from hil.guardian import latch

OWN_LATCHES = Path(__file__).parents[1] / "support/own_latches/sitecustomize.py"
INSTALLED = Path(sys.prefix) / "share/hil-tests"
"""A run tells of such a file anywhere else: it is code that no package holds."""


@pytest.fixture(scope="session", autouse=True)
def latches(tmp_path_factory):
    """Keep the latches of all runs that tests start in a folder of theirs, and return it.

    A test that is broken off leaves a latch, as it must; among those of the machine it would lie for ever.
    """
    folder = tmp_path_factory.mktemp("latches")
    INSTALLED.mkdir(parents=True, exist_ok=True)
    part = INSTALLED / f"part-{secrets.token_hex(4)}"
    part.write_bytes(OWN_LATCHES.read_bytes())
    part.rename(INSTALLED / OWN_LATCHES.name)
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("HIL_TESTS_LATCHES", str(folder))
        patched.setenv("PYTHONPATH", str(INSTALLED), prepend=os.pathsep)
        patched.setattr("hil.guardian.latch.PLACES", (folder,))
        yield folder


@pytest.fixture(autouse=True)
def no_process_is_left():
    """End the processes that a failed test leaves."""
    yield
    end_started()


@pytest.fixture(scope="module", autouse=True)
def no_guardian_is_left(latches):
    """End the guardians that cannot prove an output safe, as a person does: by taking their latches back."""
    yield
    for path in latches.glob("*.latch"):
        latch.clear(path)
    stayed = [each for each in guardians(latches) if not _leaves(each)]
    assert not stayed, "a guardian stays though its latch was taken back"


def guardians(latches):
    """Return the guardians of the runs of these tests, and of no other."""
    ours = f"HIL_TESTS_LATCHES={latches}".encode()
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            is_guardian = b"hil/guardian/__main__.py" in (process / "cmdline").read_bytes()
            if is_guardian and ours in (process / "environ").read_bytes().split(b"\0"):
                yield int(process.name)


def _leaves(pid):
    """Return whether a guardian ends by itself; one that does not is killed."""
    with suppress(ProcessLookupError):
        process = os.pidfd_open(pid)
        try:
            if until(process, 15.0):
                return True
            signal.pidfd_send_signal(process, signal.SIGKILL)
            return False
        finally:
            os.close(process)
    return True
