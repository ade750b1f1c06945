"""Gates on the timestamps of a recording: order, gaps, jitter, rate."""

from __future__ import annotations

from numpy.typing import ArrayLike

from hil.analysis.quality.gate import Facts, Gate
from hil.analysis.sampling import SamplingReport, assess
from hil.model.errors import Refused

__all__ = ["timing"]

_JITTER = 0.05  # of an interval, rms: white noise of a slow signal is not changed by less
_OFF = 0.02  # of the rate: Allan times and densities move by half of it


def timing(time: ArrayLike, facts: Facts) -> tuple[SamplingReport | None, tuple[Gate, ...]]:
    """Return what the timestamps say, None where they say nothing, and the gates on them.

    Args:
        time: timestamps in s, shape (n,).
        facts: of these the rate.
    """
    try:
        report = assess(time)
    except Refused as error:
        return None, (Gate(name="order", channel="", ok=False, reason=error.message),)
    backwards = f"{report.duplicates} timestamps repeat and {report.reversals} precede the one before"
    gaps = f"{report.gaps} gaps, the longest {report.longest_gap:.4g} s, about {report.missing} samples missing"
    share = report.jitter_rms * report.rate
    gates = [
        Gate(name="order", channel="", ok=not (report.duplicates or report.reversals), reason=backwards),
        Gate(name="gaps", channel="", ok=not report.gaps, reason=gaps),
        Gate(name="jitter", channel="", ok=share <= _JITTER, reason=f"{share:.2%} of an interval, rms"),
        _rate(report, facts),
    ]
    return report, tuple(gates)


def _rate(report: SamplingReport, facts: Facts) -> Gate:
    if facts.rate is None:
        return Gate(name="rate", channel="", ok=None, reason="the rate that was asked for is not known")
    reason = f"{report.rate:.6g} Hz, where {facts.rate:g} Hz were asked for"
    return Gate(name="rate", channel="", ok=abs(report.rate / facts.rate - 1.0) <= _OFF, reason=reason)
