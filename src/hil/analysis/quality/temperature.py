"""A gate on the temperature channel: degrees Celsius, or counts that nobody converted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hil.analysis.quality.gate import Gate

__all__ = ["celsius"]

_COLDEST, _HOTTEST = -60.0, 150.0  # degC that an electronic part survives
_COARSE = 2.0  # K between neighbours, rms over sqrt(2): no temperature jumps like this
_ZERO = 273.15


def celsius(channel: str, values: NDArray[np.float64]) -> Gate:
    """Trip where a temperature cannot be in degrees Celsius: raw counts, or kelvin.

    Raw counts are whole numbers that lie where no part survives, or whose noise would be kelvins from sample to sample.
    """
    present = values[np.isfinite(values)]
    if not present.size:
        return Gate(name="celsius", channel=channel, ok=None, reason="no sample is a number")
    low, high, middle = float(present.min()), float(present.max()), float(np.median(present))
    whole = bool((present == np.rint(present)).all())
    jumps = float(np.sqrt(np.square(np.diff(present)).mean() / 2.0)) if present.size > 1 else 0.0
    reason = f"from {low:g} to {high:g}"
    if low >= _COLDEST and high <= _HOTTEST and not (whole and jumps > _COARSE):
        return Gate(name="celsius", channel=channel, ok=True, reason=f"{reason} degC")
    if not whole and _COLDEST <= middle - _ZERO <= _HOTTEST:
        reason += ", as of kelvin"
    elif whole:
        reason += f" in whole numbers, {jumps:.2g} from sample to sample: raw counts"
    return Gate(name="celsius", channel=channel, ok=False, reason=f"{reason}; not degrees Celsius")
