"""Demands of requirements on recordings while they are taken: the gaps that they allow, and their duration."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.requirements.requirement import Requirement

__all__ = ["Demanded"]


class Demanded:
    """Demands of a case's requirements on its recordings.

    Args:
        requirements: those of the case.

    Attributes:
        gaps_ns: longest allowed gap [ns] by recording, None if only a rate is required.
    """

    def __init__(self, requirements: Sequence[Requirement]) -> None:
        asked = [each.records for each in requirements if each.records]
        gaps: dict[str, float] = {}
        self._durations: dict[str, float] = {}
        for each in asked:
            if each.rate_hz or each.max_gap_s:
                gaps[each.recording] = min(gaps.get(each.recording, math.inf), each.max_gap_s or math.inf)
            self._durations[each.recording] = max(self._durations.get(each.recording, 0.0), each.duration_s or 0.0)
        self.gaps_ns = {name: round(gap * NANOSECONDS) if math.isfinite(gap) else None for name, gap in gaps.items()}

    def is_short(self, facts: events.Recording, covers_s: float) -> bool:
        """Return whether a recording requested for the demanded duration falls short of it.

        Its samples are stamped on arrival. If the first one had a longer latency than the last one, the recording is
        that much shorter.

        Args:
            facts: the recording.
            covers_s: the time from its first row to its last one [s].
        """
        due_s = self._durations.get(facts.name, 0.0)
        return (facts.duration or 0.0) >= due_s > round(covers_s + 1 / facts.rate, 9)
