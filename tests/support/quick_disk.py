"""A disk that is never waited for: unit tests alone would sync twenty thousand times."""

from __future__ import annotations

import os
import signal

import pytest

from hil.evidence import durable
from hil.evidence.journal.writer import Journal

__all__ = ["nothing_waits_for_the_disk"]


@pytest.fixture(scope="session", autouse=True)
def nothing_waits_for_the_disk():
    """Sync nothing in this process: only a power cut would show it. When and what is synced has tests of its own.

    They are `tests/unit/evidence/test_journal.py` and `test_durable.py`; runs in processes of their own sync as always.
    """
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "fsync", lambda _: None)
        patched.setattr(durable, "_alarm_rings", lambda: signal.getitimer(signal.ITIMER_REAL)[1] > 0)  # not a timeout's
        patched.setitem(Journal.__init__.__kwdefaults__, "sync", lambda _: None)
        yield
