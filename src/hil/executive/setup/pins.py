"""The environment under which two machines compute the same last digits."""

from __future__ import annotations

import os

__all__ = ["PINNED", "pinned_environment"]

PINNED = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_CORETYPE": "Haswell",
    "OPENBLAS_NUM_THREADS": "1",
    "PYTHONHASHSEED": "0",
}
"""Variables of the environment; they have to be there before NumPy is imported."""


def pinned_environment() -> dict[str, str]:
    """Return this process' environment with the pins set, pytest's own variables removed."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    return {**kept, **PINNED}
