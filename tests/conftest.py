"""What every test of this project has."""

from __future__ import annotations

import gc


def pytest_collection_finish():
    """Leave what was collected out of every later garbage collection: it stays until the end."""
    gc.collect()
    gc.freeze()
