"""What every test of this project has."""

from __future__ import annotations

import gc
import sys

_GREW = 100  # modules; about a third of what the first whole run of a process imports
_frozen_with = 0


def pytest_collection_finish():
    """Leave what was collected out of every later garbage collection: it stays until the end."""
    _freeze()


def pytest_runtest_setup():
    """Leave out as well what the tests have imported meanwhile; each run of a plan ends with two collections."""
    if len(sys.modules) > _frozen_with + _GREW:
        _freeze()


def _freeze():
    global _frozen_with  # noqa: PLW0603 - of the process, as the collector is
    _frozen_with = len(sys.modules)
    gc.collect()
    gc.freeze()
