"""Pinned environment for numerical reproducibility between computers; this module imports next to nothing."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence

from hil.model.errors import Refused

__all__ = ["PINNED", "pinned_environment"]

PINNED = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
}
"""Environment variables; they must be set before NumPy is imported."""


def pinned_environment(warnings: Sequence[str] = sys.warnoptions) -> dict[str, str]:
    """Return this process' environment with the pins set, pytest's own variables removed.

    Args:
        warnings: the warning options of this Python.

    Raises:
        Refused: for `python -W error` and PYTHONWARNINGS=error; a library that warns would end the run by it.
    """
    if any(each.partition(":")[0] in _FATAL for each in warnings):
        raise Refused(
            "this Python turns warnings into errors, so a library that warns would end the run",
            "unset PYTHONWARNINGS, and start Python without -W",
        )
    kept = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    return {**kept, **PINNED}


_FATAL = frozenset("error"[:length] for length in range(1, 6))
"""Options that turn warnings into errors; Python accepts abbreviations of the word."""
