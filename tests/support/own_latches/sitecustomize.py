"""Lets every process that a test starts keep its latches in the folder of the tests, not in that of the machine.

Python imports a copy of this at its start, which `tests/system/conftest.py` puts on `PYTHONPATH`. The product has no
such switch: a latch that one run leaves must be found by every other one, whatever its environment.
"""

from __future__ import annotations

import os
import sys

_MODULE = "hil.guardian.latch"


class _Moved:
    """Finds the module of latches, and moves their folder once it is loaded; Python starts as soon as before."""

    def find_spec(self, name, path, target=None):
        """Return where the module comes from, and nothing for any other."""
        if name != _MODULE:
            return None
        from importlib.machinery import PathFinder  # noqa: PLC0415 - only where it is used
        from pathlib import Path  # noqa: PLC0415 - same

        if (spec := PathFinder.find_spec(name, path, target)) is None:
            return None
        load = spec.loader.exec_module

        def moved(module):
            load(module)
            module.PLACES = (Path(os.environ["HIL_TESTS_LATCHES"]),)

        spec.loader.exec_module = moved
        return spec


if "HIL_TESTS_LATCHES" in os.environ:
    sys.meta_path.insert(0, _Moved())
