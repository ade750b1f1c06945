"""What an export says of the numbers in it: whence they are, and what they are worth."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Mapping
from typing import Any

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import Verification
from hil.report.from_package import PackageMaterial

__all__ = ["Facts", "facts_of"]

Facts = dict[str, Any]
"""Facts by name, as JSON has them."""

_OF_RUN = ("bench", "purpose", "plans", "operator", "epoch")
_OF_RECORDING = ("recording", "name", "case", "step", "rate", "duration", "source")
_OF_DUT = ("serial", "part", "model", "hardware", "firmware")
_OF_STREAM = (
    "frames", "lost", "lost_samples", "losses_known", "drift", "drift_uncertainty", "time_uncertainty",
)  # fmt: skip


def facts_of(package: Package, verified: Verification, begun: Mapping[str, Any]) -> Facts:
    """Return the facts of one recording.

    Args:
        package: a sealed package.
        verified: what its verification found, which was nothing.
        begun: the body of the `recording` event.

    Returns:
        The facts; `mark` is SIMULATED or REPLAYED, and empty only where run and recording are both of hardware;
        rates are in Hz, durations and gaps in s.
    """
    run = package.run()
    ended = next(end for end in package.events("recording-end") if end["recording"] == begun["recording"])
    return {
        "format": 1,
        "mark": _mark({run.get("source"), begun["source"]}),
        "run": PackageMaterial(package).run(),
        "evidence_digest": verified.evidence_digest,
        "run_complete": verified.complete,
        **{key: run.get(key) for key in _OF_RUN},
        "dut": {key: (run.get("dut") or {}).get(key) for key in _OF_DUT},
        **{key: begun.get(key) for key in _OF_RECORDING},
        "complete": ended["complete"],
        "rows": ended["rows"],
        "rows_sha256": ended["sha256"],
        "largest_gap": ended["gaps"],
        "stream": _stream(package, begun, ended),
        "time": "bench time in s from the beginning of the run",
        "channels": [_channel(channel, package.calibration()) for channel in begun["channels"]],
        "recorded_by": f"hil {run.get('version')}",
        "exported_by": f"hil {importlib.metadata.version('hil')}",
    }


def _mark(sources: set[str | None]) -> str:
    """Return the word for the weakest source."""
    return next((word.upper() for word in ("simulated", "replayed") if word in sources), "")


def _channel(channel: Mapping[str, Any], calibration: Mapping[str, Mapping[str, Any]]) -> Facts:
    record = calibration.get(channel["instrument"], {})
    return {
        "name": channel["name"],
        "unit": channel["unit"],
        "instrument": channel["instrument"],
        "uncertainty": channel.get("uncertainty"),
        "calibration": channel.get("calibration") or record.get("certificate"),
        "calibration_due": record.get("due"),
    }


def _stream(package: Package, begun: Mapping[str, Any], ended: Mapping[str, Any]) -> Facts | None:
    """Return how a streamed recording went, from the effect that took it; None for one that was not streamed."""
    results = (effect.get("result") for effect in package.events("effect") if effect.get("case") == begun["case"])
    for result in results:
        if isinstance(result, dict) and "frames" in result and result.get("sha256") == ended["sha256"]:
            return {key: result.get(key) for key in _OF_STREAM}
    return None
