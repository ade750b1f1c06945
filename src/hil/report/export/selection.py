"""Which recordings of a package to export, and what an export says about them: origin, units, and their worth."""

from __future__ import annotations

import importlib.metadata
from collections.abc import Callable, Sequence
from typing import Any

from hil.documents.suggest import did_you_mean
from hil.evidence.events import Channel, Effect, Recording, RecordingEnd
from hil.evidence.events.codec import plain
from hil.evidence.package.contents import Package
from hil.evidence.package.listing import shown
from hil.evidence.package.verification import Verification
from hil.evidence.results.facts import Calibration
from hil.model.errors import EvidenceError, Refused
from hil.model.identity import Source
from hil.report.material import Material

__all__ = ["Facts", "choose", "facts_of"]

Facts = dict[str, Any]
"""Facts by name, as JSON has them."""

_OF_RUN = ("bench", "purpose", "plans", "operator", "epoch")
_OF_RECORDING = ("recording", "name", "case", "step", "rate", "duration", "source")
_OF_DUT = ("serial", "part", "model", "hardware", "firmware")
_OF_STREAM = (
    "frames", "lost", "lost_samples", "losses_known", "drift", "drift_uncertainty", "time_uncertainty",
)  # fmt: skip
_LISTED = 12


def choose(begun: Sequence[Recording], recordings: Sequence[str], cases: Sequence[str]) -> tuple[Recording, ...]:
    """Return the recordings that are asked for, in the order of the run.

    Args:
        begun: the beginnings of all recordings.
        recordings: ids or names; a name means every recording that has it; all recordings where it is empty.
        cases: cases as the procedure shows them, what follows their `::`, or that without its parameters; all
            cases, and what was recorded outside of cases, where it is empty.

    Raises:
        Refused: for a word that fits none, and where nothing is left.
    """
    if not begun:
        raise Refused("the package has no recordings", "hil report shows what is in it")
    chosen = _fitting(begun, recordings, "recording", _words_of_recording)
    for case in cases:
        _fitting(begun, [case], "case with recordings", _words_of_case)
    both = tuple(one for one in chosen if not cases or not _words_of_case(one).isdisjoint(cases))
    if not both:
        raise Refused("none of these recordings was taken in these cases", "leave out --case or --recording")
    return both


def facts_of(package: Package, verified: Verification, begun: Recording) -> Facts:
    """Return the facts of one recording.

    Args:
        package: a sealed package.
        verified: its verification, without findings.
        begun: its beginning.

    Returns:
        The facts; `mark` is SIMULATED or REPLAYED, and empty only where run and recording are both of hardware;
        rates are in Hz, durations and gaps in s.
    """
    run = package.state.run
    if run is None:
        raise EvidenceError(f"{package.name}: its journal does not say what was run", "see hil verify")
    ended = package.state.ended[begun.recording]
    return {
        "format": 1,
        "mark": _mark({run.source, begun.source}),
        "run": Material(package).run(),
        "evidence_digest": verified.evidence_digest,
        "run_complete": verified.complete,
        **{key: plain(getattr(run, key)) for key in _OF_RUN},
        "dut": {key: getattr(run.dut, key) for key in _OF_DUT},
        **{key: getattr(begun, key) for key in _OF_RECORDING},
        "complete": ended.complete,
        "rows": ended.rows,
        "rows_sha256": ended.sha256,
        "largest_gap": ended.gaps,
        "stream": _stream(package, begun, ended),
        "time": "time in s after the trigger" if begun.capture else "bench time in s from the beginning of the run",
        **({"capture": plain(begun.capture)} if begun.capture else {}),
        "channels": [_channel(channel, package.calibration()) for channel in begun.channels],
        "recorded_by": f"hil {run.version}",
        "exported_by": f"hil {importlib.metadata.version('hil')}",
    }


def _fitting(
    begun: Sequence[Recording], asked: Sequence[str], what: str, words: Callable[[Recording], set[str]]
) -> list[Recording]:
    known = list(dict.fromkeys(word for one in begun for word in sorted(words(one))))
    for word in asked:
        if word not in known:
            listed = ", ".join(shown(word) for word in known[:_LISTED]) or "none"
            more = f" and {len(known) - _LISTED} more" if len(known) > _LISTED else ""
            message = shown(f"there is no {what} '{word}'{did_you_mean(word, known)}")
            raise Refused(message, f"there are {listed}{more}")
    return [one for one in begun if not asked or not words(one).isdisjoint(asked)]


def _words_of_recording(begun: Recording) -> set[str]:
    return {begun.recording, begun.name}


def _words_of_case(begun: Recording) -> set[str]:
    if begun.case is None:
        return set()
    name = begun.case.rpartition("::")[2]
    return {begun.case, name, name.partition("[")[0]}


def _mark(sources: set[Source]) -> str:
    """Return the word for the weakest source."""
    return next((word.upper() for word in (Source.SIMULATED, Source.REPLAYED) if word in sources), "")


def _channel(channel: Channel, calibration: Calibration) -> Facts:
    record = calibration.get(channel.instrument)
    screen = {key: getattr(channel, key) for key in ("probe", "resolution", "low", "high")}
    return {
        "name": channel.name,
        "unit": channel.unit,
        "instrument": channel.instrument,
        "uncertainty": channel.uncertainty,
        "calibration": channel.calibration or (record.certificate if record else None),
        "calibration_due": record.due if record else None,
        **{key: value for key, value in screen.items() if value is not None},
    }


def _stream(package: Package, begun: Recording, ended: RecordingEnd) -> Facts | None:
    """Return the figures of a streamed recording, from the effect that took it; None if it was not streamed."""
    results = (effect.result for effect in package.of(Effect) if effect.case == begun.case)
    for result in results:
        if isinstance(result, dict) and "frames" in result and result.get("sha256") == ended.sha256:
            return {key: result.get(key) for key in _OF_STREAM}
    return None
