"""Safe-off: bring outputs to their safe state, in order, prove it, and watch them afterwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isnan, nan

from hil.bench.bound import BoundBench
from hil.clock.port import NANOSECONDS, Clock
from hil.instruments.registry import states_of
from hil.model.bench import Proof, SafeStep
from hil.model.cutting import WatchAfter
from hil.model.errors import DeviceFault, HilError
from hil.model.figure import Figure
from hil.model.prefixed import prefixed

__all__ = ["EVERY_S", "WATCHED", "SafeResult", "left_on", "make_safe", "watch_after"]

_PAUSE_S = 0.05
_ATTEMPTS = 3


@dataclass(frozen=True, slots=True)
class SafeResult:
    """Result of one line of the safe-off; `seconds` of bench time, `late` if it was proven after its time limit."""

    output: str
    state: str
    ok: bool
    detail: str
    seconds: float
    late: bool = False


def make_safe(
    steps: Sequence[SafeStep],
    roles: Mapping[str, object],
    clock: Clock,
    tell: Callable[[SafeResult], None],
    hear: Callable[[DeviceFault], object] = lambda _: None,
    *,
    speed: float = 1.0,
) -> bool:
    """Execute every line in order, whatever the outcome of the one before; return whether all are proven.

    A line is tried up to three times within its time limit; each try has a third of that for its
    proof. An output that cannot be reached is a result, not an error, because the lines after it matter
    as much; what `tell` raises, such as for a full disk, is deferred until the last line was executed.

    Args:
        steps: the lines of the bench file.
        roles: the role instances by their dotted names.
        clock: the bench's clock.
        tell: called with every result as soon as it is known.
        hear: called with every fault of a device, even if it answers at the next try.
        speed: bench seconds per second of real time. On a bench served faster than real time, the computer's own
            delays count that much more, so time limits are scaled to real time.
    """
    safe = True
    trouble: Exception | None = None
    for step in steps:
        result = _take(step, step.within_s * max(1.0, speed), roles, clock, hear)
        safe = safe and result.ok
        try:
            tell(result)
        except Exception as error:  # noqa: BLE001 - raised again below
            trouble = trouble or error
    if trouble:
        raise trouble
    return safe


def left_on(
    steps: Sequence[SafeStep],
    bench: BoundBench,
    tell: Callable[[SafeResult], None] = lambda _: None,
    hear: Callable[[DeviceFault], object] = lambda _: None,
    *,
    forgive_late: bool = False,
) -> list[str]:
    """Execute lines despite any request to stop; return a sentence for every output that is not as its line says.

    Args:
        steps: lines of the bench file.
        bench: the bench.
        tell: called with every result as soon as it is known.
        hear: see `make_safe`.
        forgive_late: whether an output that was proven after its time limit counts as safe.
    """
    wrong: list[str] = []

    def take(result: SafeResult) -> None:
        if not result.ok and not (forgive_late and result.late):
            wrong.append(f"{result.output} is not {result.state}: {result.detail}")
        tell(result)

    with bench.brake.released():
        make_safe(steps, bench.roles, bench.clock, take, hear, speed=bench.speed)
    return wrong


def _take(
    step: SafeStep,
    within_s: float,
    roles: Mapping[str, object],
    clock: Clock,
    hear: Callable[[DeviceFault], object],
) -> SafeResult:
    start_ns = clock.now_ns()
    limit_ns = round(within_s * NANOSECONDS)
    detail, ok = "", False
    for attempt in range(_ATTEMPTS):
        if attempt and clock.now_ns() + _PAUSE_S * NANOSECONDS > start_ns + limit_ns:
            break
        if attempt:
            clock.sleep(_PAUSE_S)
        try:
            ok, detail = _try(step, roles, clock, start_ns + limit_ns * (attempt + 1) // _ATTEMPTS)
        except DeviceFault as fault:
            hear(fault)
            ok, detail = False, str(fault)
        if ok:
            break
    seconds = (clock.now_ns() - start_ns) / NANOSECONDS
    if late := ok and seconds > within_s:
        ok, detail = False, f"reached after {seconds:.3g} s, {within_s:g} s allowed"
    return SafeResult(step.output, step.state, ok, detail, seconds, late)


def _try(step: SafeStep, roles: Mapping[str, object], clock: Clock, deadline_ns: int) -> tuple[bool, str]:
    try:
        role = roles[step.output]
        getattr(role, states_of(step.output)[step.state])()
        return _proven(step.proof, roles, clock, deadline_ns) if step.proof else (True, "read back")
    except DeviceFault:
        raise
    except HilError as error:
        return False, str(error)
    except Exception as error:  # noqa: BLE001 - a defect of one driver must not leave the other outputs on
        return False, f"{type(error).__name__}: {error}"


def _proven(proof: Proof, roles: Mapping[str, object], clock: Clock, deadline_ns: int) -> tuple[bool, str]:
    """Read until the proof holds or time is up: a current or temperature takes a while to fall."""
    while True:
        reading: Figure = getattr(roles[proof.output], proof.quantity)()
        detail = f"{proof.output} {proof.quantity} {prefixed(reading.value, proof.unit)}"
        if proof.minimum <= reading.value <= proof.maximum:
            return True, detail
        if clock.now_ns() >= deadline_ns:
            return False, f"{detail}, {proof.minimum:g} to {proof.maximum:g} {proof.unit} is safe"
        clock.sleep(_PAUSE_S)


EVERY_S = 5.0
"""Sampling period of the watch; a few seconds longer if an instrument is slow to answer."""

WATCHED = "watched"
"""What a result shows in place of the state of a line of the safe-off."""

_CLOSER = 0.9
"""A quantity that approaches a value has at most this fraction of its largest distance left at the end."""

Reading = Callable[[WatchAfter, float, float], None]
"""Takes a reading: its line, the bench time [s], and the value, NaN if there was none."""


def watch_after(
    watches: Sequence[WatchAfter],
    roles: Mapping[str, object],
    clock: Clock,
    reading: Reading,
    tell: Callable[[SafeResult], None],
) -> bool:
    """Watch every line for its time, all of them at once, and return whether they hold.

    A line holds if it stays within its bounds, or reaches or approaches the value at which it settles by itself.
    An output that cannot be read at the end was not seen to be safe.

    Args:
        watches: the lines of the bench file.
        roles: the role instances by their dotted names.
        clock: the bench's clock.
        reading: called with every reading.
        tell: called with every result as soon as it is known.
    """
    start_ns = clock.now_ns()
    under_way = [_Line(watch) for watch in watches]
    held = True
    while under_way:
        for line in tuple(under_way):
            line.take(roles[line.watch.output], clock, reading)
            seconds = (clock.now_ns() - start_ns) / NANOSECONDS
            if line.beyond or seconds >= line.watch.seconds:
                under_way.remove(line)
                ok, detail = line.judged()
                held = held and ok
                tell(SafeResult(line.watch.output, WATCHED, ok, detail, seconds))
        if under_way:
            clock.sleep(EVERY_S)
    return held


class _Line:
    """One watched line with its readings so far."""

    def __init__(self, watch: WatchAfter) -> None:
        self.watch = watch
        self.beyond = False
        self._first = self._last = self._farthest = nan
        self._trouble = ""

    def take(self, role: object, clock: Clock, reading: Reading) -> None:
        """Take one reading."""
        watch = self.watch
        try:
            figure: Figure = getattr(role, watch.quantity)()
            self._last, self._trouble = figure.value, ""
        except HilError as error:
            self._last, self._trouble = nan, str(error)
        if isnan(self._first):
            self._first = self._farthest = self._last
        if watch.toward is not None and abs(self._last - watch.toward) > abs(self._farthest - watch.toward):
            self._farthest = self._last
        reading(watch, clock.now(), self._last)
        if watch.minimum is not None and watch.maximum is not None and not isnan(self._last):
            self.beyond = not watch.minimum <= self._last <= watch.maximum

    def judged(self) -> tuple[bool, str]:
        """Return whether it holds, and what was seen."""
        watch = self.watch
        if self._trouble or isnan(self._last):
            return False, f"its {watch.quantity} could not be read: {self._trouble or 'no number came'}"
        way = [self._first, self._farthest, self._last] if watch.toward is not None else [self._first, self._last]
        came = f"its {watch.quantity} went {' to '.join(prefixed(value, watch.unit) for value in dict.fromkeys(way))}"
        if watch.toward is None:
            bounds = f"{watch.minimum:g} to {watch.maximum:g} {watch.unit}"
            return not self.beyond, f"{came}, {bounds} {'is' if self.beyond else 'was'} safe"
        if self._approaches(watch.toward):
            return True, came
        return False, f"{came}, and not toward {watch.toward:g} {watch.unit}: something still drives it"

    def _approaches(self, toward: float) -> bool:
        before, now = self._farthest - toward, self._last - toward
        same_side = before * now > 0
        return abs(now) <= (self.watch.tolerance or 0.0) or (same_side and abs(now) <= _CLOSER * abs(before))
