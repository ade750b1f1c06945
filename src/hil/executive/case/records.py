"""What a recording has to be, where a requirement asks for one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import cast

from hil.evidence.recordings.hdf5 import Recorded
from hil.executive.run.row_store import RecordingFacts
from hil.model.figure import Figure
from hil.requirements.requirement import Decision, Limit, Records

__all__ = ["data_checks"]


def data_checks(records: Records, taken: Sequence[Mapping[str, object]]) -> Iterator[tuple[Limit, Figure | str]]:
    """Yield every criterion of a recording with what was found; the poorest recording of that name counts.

    A recording that was never taken yields nothing, so that its requirement stays NOT_EVALUATED.
    """
    named = [item for item in taken if cast("RecordingFacts", item["facts"]).name == records.recording]
    if not named:
        return
    found = [cast("Recorded", item["recorded"]) for item in named]
    missing = sorted({channel for item in found for channel in records.channels if channel not in item.channels})
    yield _word("channels", "complete"), f"without {', '.join(missing)}" if missing else "complete"
    if not all(item.complete for item in found):
        yield _word("end", "complete"), "incomplete"
    if records.duration_s is not None:
        # A recording of n samples lasts n / rate: its last sample stands for one period, too.
        shortest = min(_span(item) + 1 / item.rate for item in found)
        yield _at_least("duration", records.duration_s, "s"), _exact(shortest, "s")
    if records.rate_hz is not None:
        slowest = min((len(item) - 1) / _span(item) if len(item) > 1 and _span(item) else 0.0 for item in found)
        yield _at_least("rate", records.rate_hz * (1 - _RATE_TOLERANCE), "Hz"), _exact(slowest, "Hz")
    if records.max_gap_s is not None:
        yield _at_most("max_gap", records.max_gap_s, "s"), _exact(max(_gap(item) for item in found), "s")


_RATE_TOLERANCE = 1e-3
"""A sampling clock may be this much slow: quartz is, and the last sample's latency counts, too."""


def _span(item: Recorded) -> float:
    return float(item.time[-1] - item.time[0]) if len(item) else 0.0


def _gap(item: Recorded) -> float:
    gaps = item.time[1:] - item.time[:-1]
    return float(gaps.max()) if len(gaps) else 0.0


def _exact(value: float, unit: str) -> Figure:
    return Figure(value=round(value, 9), unit=unit)


def _at_least(parameter: str, minimum: float, unit: str) -> Limit:
    return Limit(parameter=parameter, unit=unit, minimum=f"{minimum:.9g}", decision=Decision.SIMPLE)


def _at_most(parameter: str, maximum: float, unit: str) -> Limit:
    return Limit(parameter=parameter, unit=unit, maximum=f"{maximum:.9g}", decision=Decision.SIMPLE)


def _word(parameter: str, word: str) -> Limit:
    return Limit(parameter=parameter, equals=word, decision=Decision.SIMPLE)
