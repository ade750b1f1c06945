"""The outlook of a run: where it is, and how much bench time is left, from its events alone."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import cache

from hil.evidence import events
from hil.model.verdict import Verdict
from hil.report.numbers import duration

__all__ = ["Left", "Outlook", "Turns", "method_of"]

_CUT_SHORT = frozenset({Verdict.ABORTED, Verdict.ERROR, Verdict.NOT_RUN})
_FASTER = 2.0  # bench time that passes faster than this differs from what a person waits
_TURN = re.compile(r"(.+) (\d+) of (\d+)", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Left:
    """How much bench time is left, in s.

    Attributes:
        case: of the present case, estimated from what was seen of it; None if unknown.
        run: of the whole run, estimated from what was seen of all that is left; None if unknown.
        at_most: of the whole run, by the declared `max_duration` of its cases.
        pace: how many seconds of bench time pass in a second; more than 1 on a simulated bench only.
    """

    case: float | None
    run: float | None
    at_most: float
    pace: float = 1.0

    def __str__(self) -> str:
        return f"{self._bench_time()}{self._clock()}"

    def _bench_time(self) -> str:
        bound = f"at most {_rough(self.at_most)}"
        if self.run is not None:
            return f"about {_rough(self.run)} left, {bound}"
        if self.case is not None:
            return f"about {_rough(self.case)} left of this case; in all {bound}"
        return f"{bound} left"

    def _clock(self) -> str:
        """Return the wall time, where bench time passes faster."""
        if self.pace <= _FASTER:
            return ""
        told = f"at most {_rough(self.at_most / self.pace)}" if self.run is None else _rough(self.run / self.pace)
        return f" of bench time ({told} by the clock)"


@dataclass(slots=True, kw_only=True)
class Turns:
    """A loop of a case that is going on: `turn` of `turns`, counted from 1."""

    name: str
    turn: int
    turns: int
    began: float

    def __str__(self) -> str:
        return f"{self.name} {self.turn} of {self.turns}"


@dataclass(slots=True)
class _Seen:
    """How long things of one kind took."""

    count: int = 0
    total: float = 0.0

    def add(self, seconds: float) -> None:
        self.count += 1
        self.total += seconds

    @property
    def mean(self) -> float | None:
        return self.total / self.count if self.count else None


@dataclass(slots=True)
class _Step:
    title: str
    key: tuple[str, ...]
    turns: Turns | None


@cache
def method_of(kind: type[events.Event]) -> str:
    """Return the name of the method that takes events of a kind."""
    return f"_{kind.kind().replace('-', '_')}"


class Outlook:
    """Takes the events of a run in order, and knows where the run is.

    Attributes:
        t: bench time in s, as far as is known.
        planned: how many cases were planned.
        ended: how many of them ended.
        case: the present case, empty where there is none.
        recordings: the recordings that are open, by id.
        fed: the open recording whose rows a limit of the envelope is judged on, by the limit's id.
        held: why the bench is held, None where it is not.
        asked: the question that waits for an answer, None if there is none.
        pace: how many seconds of bench time pass in a second, as far as is known.
    """

    def __init__(self) -> None:
        self.t = 0.0
        self.pace = 1.0
        self.planned = self.ended = 0
        self.case = ""
        self.recordings: dict[str, events.Recording] = {}
        self.fed: dict[str, str] = {}
        self.held: str | None = None
        self.asked: events.Question | events.AskedAgain | None = None
        self._limits: dict[str, float] = {}
        self._waiting: dict[str, None] = {}
        self._took: dict[str, _Seen] = {}
        self._steps: list[_Step] = []
        self._loops: dict[tuple[str, ...], _Seen] = {}
        self._began = self._paused = self._held_at = 0.0

    @property
    def step(self) -> str:
        """The present step as `1.2 title`, empty where there is none."""
        return self._steps[-1].title if self._steps else ""

    @property
    def turns(self) -> tuple[Turns, ...]:
        """The loops that are going on, the outermost first."""
        return tuple(step.turns for step in self._steps if step.turns)

    def take(self, event: events.Event) -> None:
        """Take one event."""
        self.at(event.t)
        take = getattr(self, method_of(type(event)), None)
        if take is not None:
            take(event)

    def at(self, t: float) -> None:
        """Note that bench time has reached at least this."""
        self.t = max(self.t, t)

    def left(self) -> Left | None:
        """Return how much bench time is left, None before cases are planned."""
        if not self.planned:
            return None
        present = self._left_of_case()
        bounds = [self._limits[case] for case in self._waiting]
        if self.case:
            bounds.append(max(0.0, self._limits.get(self.case, 0.0) - self._spent()))
        parts = [self._usual(case) for case in self._waiting] + ([present] if self.case else [])
        return Left(case=present, run=_sum(parts), at_most=sum(bounds), pace=self.pace)

    def _left_of_case(self) -> float | None:
        """Return what is left of the present case: by its outermost loop, by its like, or by what it records."""
        if not self.case:
            return None
        recording = [
            max(0.0, each.duration - (self.t - each.t))
            for each in self.recordings.values()
            if each.duration is not None and each.case == self.case
        ]
        usual = self._usual(self.case)
        known = self._left_of_loop()
        if known is None and usual is not None:
            known = max(0.0, usual - self._spent())
        parts = [*recording, *([known] if known is not None else [])]
        return max(parts) if parts else None

    def _left_of_loop(self) -> float | None:
        for step in self._steps:
            mean = self._loops[step.key].mean if step.turns else None
            if step.turns and mean is not None:
                within = max(0.0, mean - (self.t - step.turns.began))
                return mean * (step.turns.turns - step.turns.turn) + within
        return None

    def _usual(self, case: str) -> float | None:
        """Return how long cases of the same function took."""
        seen = self._took.get(_function(case))
        return seen.mean if seen else None

    def _spent(self) -> float:
        return self.t - self._began - self._paused

    def _planned(self, event: events.Planned) -> None:
        self._limits = {case.case: case.max_duration for case in event.cases}
        self._waiting = dict.fromkeys(self._limits)
        self.planned = len(self._limits)

    def _case(self, event: events.Case) -> None:
        self._waiting.pop(event.case, None)
        self.case, self._began, self._paused = event.case, self.t, 0.0
        self._steps, self._loops = [], {}

    def _question(self, event: events.Question | events.AskedAgain) -> None:
        self.asked = event

    def _answer(self, _: events.Event) -> None:
        self.asked = None

    _asked_again = _question
    _confirmed = _effect = _answer

    def _case_end(self, event: events.CaseEnd) -> None:
        self.asked = None
        if event.verdict not in _CUT_SHORT:
            self._took.setdefault(_function(event.case), _Seen()).add(self._spent())
        self.ended += 1
        self.case, self._steps = "", []

    def _not_run(self, event: events.NotRun) -> None:
        self._waiting.pop(event.case, None)

    def _step(self, event: events.Step) -> None:
        *above, name = event.path
        found = _TURN.fullmatch(name)
        turns, key = None, (*above, name)
        if found and 0 < int(found[2]) <= int(found[3]):
            turns = Turns(name=found[1], turn=int(found[2]), turns=int(found[3]), began=self.t)
            key = (*above, found[1], found[3])
            if turns.turn == 1 or key not in self._loops:
                self._loops[key] = _Seen()
        self._steps.append(_Step(f"{event.number} {name}", key, turns))

    def _step_end(self, _: events.Event) -> None:
        if not self._steps:
            return
        step = self._steps.pop()
        if step.turns:
            self._loops[step.key].add(self.t - step.turns.began)

    def _recording(self, event: events.Recording) -> None:
        self.recordings[event.recording] = event

    def _recording_end(self, event: events.RecordingEnd) -> None:
        self._close({event.recording})

    def _fed(self, event: events.Fed) -> None:
        self.fed[event.limit] = event.recording

    def _resumed(self, event: events.Resumed) -> None:
        """Close the recordings that a run began after the event at which it was entered again: they are void."""
        after = event.entry.boundary if event.entry else math.inf
        self._close({name for name, begun in self.recordings.items() if begun.seq > after})

    def _close(self, names: Collection[str]) -> None:
        self.recordings = {name: begun for name, begun in self.recordings.items() if name not in names}
        self.fed = {limit: name for limit, name in self.fed.items() if name not in names}

    def _hold(self, event: events.Hold) -> None:
        self.held, self._held_at = event.text, self.t

    def _hold_end(self, _: events.Event) -> None:
        self.held = None
        self._paused += self.t - self._held_at


def _function(case: str) -> str:
    return case.partition("[")[0]


def _sum(parts: Iterable[float | None]) -> float | None:
    total = 0.0
    for part in parts:
        if part is None:
            return None
        total += part
    return total


def _rough(seconds: float) -> str:
    """Return a time as a person would estimate it: days for what takes days."""
    days, rest = divmod(round(seconds / 3600), 24)
    if days:
        return f"{days} d {rest} h" if rest else f"{days} d"
    return duration(float(round(seconds)))
