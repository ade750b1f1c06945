"""Bus arbitration: envelope readings between the samples of a recording, and what disturbed them."""

from __future__ import annotations

import math
from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median_low
from typing import ClassVar

from hil.bench.envelope import Monitor
from hil.clock.port import NANOSECONDS

__all__ = ["ENOUGH", "Bus", "Course", "Pace", "Share", "refusal"]

_REMEMBERED = 256
ENOUGH = 3
"""Samples observed before a recording may be called too slow: the computer may stall during a single one."""

_NO_GAP = 2**62
_SLOWEST_NS = 1000 * NANOSECONDS
_HALVINGS = 20


@dataclass(frozen=True, slots=True)
class Pace:
    """Sampling pace of a recording.

    Attributes:
        name: of the recording.
        period_ns: the sampling period.
        sample_ns: the duration of a sample.
        count: the number of samples, None if the case ends the recording.
        gap_ns: the longest gap that a requirement allows, None if none does.
        required: whether a requirement asks for it; if not, it gives way to every late reading.
        skips: whether a sample that cannot be taken before the next one is due is skipped rather than taken late.
    """

    name: str
    period_ns: int
    sample_ns: int
    count: int | None
    gap_ns: int | None
    required: bool = True
    skips: bool = False

    @property
    def pause_ns(self) -> int:
        """Time between two samples in which the bus is free; zero or negative if there is none."""
        return self.period_ns - self.sample_ns

    @property
    def lasts_ns(self) -> int:
        """The time from the first sample to the last."""
        return _NO_GAP if self.count is None else (self.count - 1) * self.period_ns

    def late_samples(self, late_ns: int) -> int:
        """Return how many samples it takes to be on time again after one that is this late."""
        return 0 if late_ns <= 0 else -(-late_ns // self.pause_ns)

    def busy_ns(self, rooms_ns: Sequence[int]) -> int:
        """Return the time in which each of these readings fits once, and after which no sample is late."""
        fitting = sum(room for room in rooms_ns if room <= self.pause_ns)
        pauses = -(-fitting // self.pause_ns)
        among = 2 * fitting + self.sample_ns if pauses <= 1 else pauses * self.period_ns + fitting
        large = [room for room in rooms_ns if room > self.pause_ns]
        return among + sum(room + (self.late_samples(room - self.pause_ns) + 2) * self.period_ns for room in large)


def refusal(pace: Pace, monitors: Sequence[Monitor]) -> str:
    """Return why a recording cannot meet rate, gap and maximum ages, and what rate could be met; empty if it can.

    See `_problem`.
    """
    if not (problem := _problem(pace, monitors)):
        return ""
    rate = _rate_that_holds(pace, monitors)
    return f"{problem}; {_rounded_down(rate)} Hz would hold" if rate else problem


def _rate_that_holds(pace: Pace, monitors: Sequence[Monitor]) -> float:
    """Return the highest rate in Hz at which a recording of this duration is not refused, 0 if there is none."""
    longest_ns = min(pace.gap_ns or _NO_GAP, max(pace.lasts_ns, pace.period_ns), _SLOWEST_NS)

    def holds(period_ns: int) -> bool:
        count = None if pace.count is None else pace.lasts_ns // period_ns + 1
        return not _problem(replace(pace, period_ns=period_ns, count=count), monitors)

    low_ns, high_ns = pace.period_ns, pace.period_ns
    while not holds(high_ns):
        if high_ns >= longest_ns:
            return 0.0
        low_ns, high_ns = high_ns, min(2 * high_ns, longest_ns)
    for _ in range(_HALVINGS):
        middle_ns = (low_ns + high_ns) // 2
        low_ns, high_ns = (low_ns, middle_ns) if holds(middle_ns) else (middle_ns, high_ns)
    return NANOSECONDS / high_ns


def _rounded_down(rate: float) -> str:
    """Return a rate rounded down to three digits."""
    digit = 10.0 ** (math.floor(math.log10(rate)) - 2)
    return f"{math.floor(rate / digit * (1 + 1e-12)) * digit:.3g}"


def _problem(pace: Pace, monitors: Sequence[Monitor]) -> str:
    """Return why a recording cannot meet rate, gap and maximum ages together, with figures; empty if it can.

    Every figure is the best of at least three observed: the shortest sample, the shortest reading. Limits are read just
    before a recording begins, so that only those count whose last reading would become too old before its end.

    Args:
        pace: of the recording.
        monitors: the limits that its rows do not feed.
    """
    if pace.pause_ns <= 0:
        return f"a sample takes {_ms(pace.sample_ns)}, and one is due every {_ms(pace.period_ns)}: lower the rate"
    for each in monitors:
        if each.least_room_ns + pace.sample_ns > each.limit.period_s * NANOSECONDS:
            return (
                f"a sample takes {_ms(pace.sample_ns)}, the reading of {each.limit.id} {_ms(each.least_room_ns)} with"
                f" a quarter to spare: it cannot be read every {each.limit.period_s:g} s between samples; lengthen the"
                " period of the limit, or record fewer roles together"
            )
    within_ns = pace.lasts_ns + sum(each.least_room_ns for each in monitors)
    inside = [each for each in monitors if each.least_room_ns and each.allowed_ns < within_ns]
    for each in inside:
        needs_ns = each.least_room_ns + pace.sample_ns
        if each.least_room_ns > pace.pause_ns and pace.gap_ns is not None and needs_ns > pace.gap_ns:
            sample = f"with a sample of {_ms(pace.sample_ns)}" if pace.sample_ns else "even if a sample took no time,"
            return (
                f"{each.limit.id} has to be read at least every {_s(each.allowed_ns)} (its maximum age less its"
                f" period), and the recording lasts {_s(pace.lasts_ns)}; its reading takes {_ms(each.least_room_ns)}"
                f" with a quarter to spare, between two samples there are {_ms(pace.pause_ns)}, and {sample}"
                f" that makes a gap of {_ms(needs_ns)}, where {_ms(pace.gap_ns)} are allowed:"
                " lower the rate, shorten the recording, allow a longer gap or a longer maximum age"
            )
    allowed_ns = min((each.allowed_ns for each in inside), default=_NO_GAP)
    busy_ns = pace.busy_ns([each.least_room_ns for each in inside])
    if 2 * busy_ns > allowed_ns:
        named = ", ".join(f"{each.limit.id} {_ms(each.least_room_ns)}" for each in inside)
        return (
            f"the readings that are due within it ({named}, with a quarter to spare) need {_s(busy_ns)} between samples"
            f" of {_ms(pace.sample_ns)} every {_ms(pace.period_ns)}, which is more than half of {_s(allowed_ns)}, the"
            " shortest maximum age less its period: lower the rate, or allow a longer maximum age"
        )
    return ""


class Share:
    """Share of the bus that a recording in progress leaves to the monitors.

    A reading that fits between two samples is taken there. A longer one is taken where the gap stays short enough and
    the samples are on time again before the last one, and does not begin while they are late, unless its value is about
    to be too old; the maximum age takes precedence over all of that.

    Args:
        pace: its sampling pace.
        start_ns: when the first sample is due.
        monitors: those that its rows do not feed.

    Attributes:
        pace: as given; if the duration of a sample was unknown, it is set by the first one.
        known: whether the duration of a sample is known.
    """

    def __init__(self, pace: Pace, start_ns: int, monitors: Sequence[Monitor]) -> None:
        self.pace = pace
        self.known = True
        self._monitors = monitors
        self.restart(start_ns)

    @property
    def lead_ns(self) -> int:
        """How much earlier than necessary readings are taken, so that all that are needed before the end fit."""
        needed = [each.room_ns for each in self._monitors if each.latest_ns < self._end_ns]
        return self.pace.busy_ns(needed) if self.pace.pause_ns > 0 else 0

    def restart(self, start_ns: int) -> None:
        """Restart the count with a first sample due at this instant."""
        self._start_ns = self._last_ns = start_ns
        self._next = 0
        self._end_ns = start_ns + self.pace.lasts_ns

    def sampled(self, index: int, began_ns: int, ended_ns: int) -> None:
        """Note that a sample has been taken; the first one after `restart` has the index 0."""
        self._next, self._last_ns = index + 1, ended_ns
        if not self.known:
            self.pace, self.known = replace(self.pace, sample_ns=ended_ns - began_ns), True

    def before(self, monitor: Monitor) -> bool:
        """Return whether a limit must be read before the first sample: there is no room in time between samples."""
        wanted_ns = max(monitor.room_ns, sum(each.room_ns for each in self._monitors))
        return wanted_ns > self.pace.pause_ns and monitor.overdue_ns < self._end_ns

    def fits_early(self, monitor: Monitor, until_ns: int) -> bool:
        """Return whether a reading that fits now may not fit later."""
        return monitor.latest_ns <= until_ns + self.lead_ns

    def admits(self, monitor: Monitor, now_ns: int) -> bool:
        """Return whether a limit may be read now, although the next sample will be late."""
        if now_ns >= monitor.latest_ns or self.pace.pause_ns <= 0 or not self.pace.required:
            return now_ns >= monitor.overdue_ns
        if monitor.doubtful and now_ns >= monitor.due_ns:
            return True
        soon = monitor.latest_ns < self._end_ns and now_ns >= min(monitor.due_ns, monitor.latest_ns - self.lead_ns)
        if not (soon or now_ns >= monitor.overdue_ns) or self._gives_way(monitor, now_ns):
            return False
        then_ns = now_ns + monitor.room_ns
        if self.pace.gap_ns is not None and then_ns + self.pace.sample_ns - self._last_ns > self.pace.gap_ns:
            return False
        next_ns = self._start_ns + self._next * self.pace.period_ns
        late_ns = then_ns - next_ns
        if self.pace.skips:
            return late_ns + self.pace.sample_ns < self.pace.period_ns
        late = self.pace.late_samples(late_ns)
        back_in_time = self.pace.count is None or self._next + late < self.pace.count
        # If delays added up, no reading might fit before the end, where every age comes due.
        return back_in_time and (now_ns <= next_ns or now_ns >= monitor.latest_ns - self.lead_ns)

    def _gives_way(self, monitor: Monitor, now_ns: int) -> bool:
        """Return whether another limit is due as well, whose value becomes too old before the end, and sooner."""
        by_ns = min(monitor.latest_ns, self._end_ns)
        return any(each.latest_ns < by_ns and each.due_ns <= now_ns for each in self._monitors)


class Bus:
    """Use of a bench's instruments beside the case, and the recordings that share them.

    Attributes:
        shares: the shares of the recordings in progress.
        looks_ahead: whether there may be room for a monitor that is not due, although no recording is in progress.
    """

    looks_ahead: ClassVar[bool] = False

    def __init__(self) -> None:
        self.shares: list[Share] = []
        self._uses: deque[tuple[int, int, str]] = deque(maxlen=_REMEMBERED)
        self._lasts_ns: dict[str, tuple[int, int]] = {}

    def leave(self, share: Share) -> None:
        """End sharing with a recording that has ended; a second call is harmless."""
        if share in self.shares:
            self.shares.remove(share)

    def note(self, what: str, began_ns: int, ended_ns: int) -> None:
        """Note a use of the bus."""
        if ended_ns > began_ns:
            self._uses.append((began_ns, ended_ns, what))

    def between(self, began_ns: int, ended_ns: int) -> str:
        """Return what took the most time between two instants, empty if nothing is known to."""
        taken: dict[str, int] = {}
        for began, ended, what in self._uses:
            if (common := min(ended, ended_ns) - max(began, began_ns)) > 0:
                taken[what] = taken.get(what, 0) + common
        return max(taken, key=lambda what: taken[what], default="")

    def sample_ns(self, source: str) -> int:
        """Return the shortest duration of a sample of these roles so far, 0 if none was taken yet."""
        return self._lasts_ns.get(source, (0, 0))[0]

    def proven_ns(self, source: str) -> int:
        """Return the same if enough samples were observed to refuse a recording for it, otherwise 0."""
        lasts_ns, seen = self._lasts_ns.get(source, (0, 0))
        return lasts_ns if seen >= ENOUGH else 0

    def sampled(self, source: str, lasted_ns: int) -> None:
        """Note the duration of a sample of these roles."""
        lasts_ns, seen = self._lasts_ns.get(source, (lasted_ns, 0))
        self._lasts_ns[source] = min(lasted_ns, lasts_ns), seen + 1

    def room(self, monitor: Monitor, now_ns: int, until_ns: int) -> bool:
        """Return whether a monitor takes its turn now, in a wait until `until_ns`, or outside waits if that is now."""
        due = now_ns >= monitor.due_ns
        if not (due or self.shares):
            return False
        fits = until_ns - now_ns >= monitor.room_ns
        if not self.shares:
            return fits or now_ns >= monitor.overdue_ns
        if fits and (due or any(each.fits_early(monitor, until_ns) for each in self.shares)):
            return True
        return all(each.admits(monitor, now_ns) for each in self.shares)

    @property
    def lead_ns(self) -> int:
        """How much earlier than due monitors may take their turns."""
        return max([each.lead_ns for each in self.shares]) if self.shares else 0


class Course:
    """Course of a recording's sampling: the durations of samples, and what came between them.

    Args:
        bus: knows what else used it, and notes the durations of samples.
        source: the sampled roles.
        period_ns: the sampling period.
        otherwise: the cause to report if the bus knows none.
        skips: whether a sample that cannot be taken in time is skipped rather than taken late.
    """

    def __init__(self, bus: Bus, source: str, period_ns: int, otherwise: str, *, skips: bool = False) -> None:
        self._bus = bus
        self._source = source
        self._period_ns = period_ns
        self._otherwise = otherwise
        self._skips = skips
        self._lasted_ns = array("q")
        self._longest = (0, 0)
        self._worst = (0, "")
        self._ended_ns: int | None = None

    def sampled(self, index: int, due_ns: int, began_ns: int, ended_ns: int) -> None:
        """Note a sample: when it was due, when it was requested, and when it arrived."""
        before_ns = due_ns if self._ended_ns is None else self._ended_ns
        late_ns = began_ns - max(due_ns, before_ns)
        if late_ns > self._worst[0]:
            cause = self._bus.between(before_ns, began_ns) or self._otherwise
            self._worst = late_ns, f"{cause} delayed sample {index + 1} by {_ms(late_ns)}"
        self._bus.sampled(self._source, ended_ns - began_ns)
        self._lasted_ns.append(ended_ns - began_ns)
        self._longest = max(self._longest, (ended_ns - began_ns, -index))
        self._ended_ns = ended_ns

    def begin_again(self, now_ns: int) -> None:
        """Restart the count: the run was stopped, which does not count as a disturbance."""
        self._ended_ns = now_ns

    def undisturbed_ns(self, *, own: bool) -> int:
        """Return the sampling interval without other uses of the bus, and without single slow samples.

        Every sample is stamped on arrival, so that the usual latency cancels out, unless it is too long.

        Args:
            own: whether the usual latency counts, because it is that of the device under test.
        """
        usual_ns = self._usual_ns if own else 0
        if self._skips:
            return max(1, -(-usual_ns // self._period_ns)) * self._period_ns
        return max(self._period_ns, usual_ns)

    @property
    def cause(self) -> str:
        """The largest disturbance, in a sentence without a full stop; empty if there was none."""
        usual_ns, (longest_ns, index) = self._usual_ns, self._longest
        if longest_ns - usual_ns > self._worst[0]:
            slow = f"sample {1 - index} took {_ms(longest_ns)}, where {_ms(usual_ns)} are usual"
            return f"{slow}: the instrument, its line or the computer was held up"
        if self._worst[1]:
            return self._worst[1]
        return f"a sample took {_ms(usual_ns)}, and one was due every {_ms(self._period_ns)}" if usual_ns else ""

    @property
    def _usual_ns(self) -> int:
        return median_low(self._lasted_ns) if self._lasted_ns else 0


def _ms(duration_ns: int) -> str:
    return f"{duration_ns / 1e6:.4g} ms"


def _s(duration_ns: int) -> str:
    return f"{duration_ns / NANOSECONDS:.4g} s"
