"""Base of plants: pure physics on an absolute time grid, unaffected by observation."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from hil.clock.port import NANOSECONDS
from hil.wire.checkpoint import Kept, Stateful

__all__ = ["Inputs", "Plant", "Port", "Sink", "Value", "Vector"]

Value = float | bool | str
"""Type of an input value."""

Inputs = Mapping[str, Value]
Vector = tuple[float, ...]
"""A plant's state: numbers only, so that it interpolates and survives JSON bit by bit."""

_KEPT_NS = 2 * NANOSECONDS
_DENSE = 2_000
_EVENLY, _AFTER = 48, 96
"""Instants of `shape_ns`: evenly over all of it, and after each break point by factors."""


@dataclass(frozen=True, slots=True)
class Port:
    """Connection for a supply: two inputs of the plant, and the two signals there."""

    voltage_input: str
    current_input: str
    voltage_signal: str
    current_signal: str


@dataclass(frozen=True, slots=True)
class Sink:
    """Connection for an electronic load: its mode and level as inputs, and the two signals there.

    The mode is one of `hil.simulation.plants.node.MODES`, empty for an input that is off.
    """

    mode_input: str
    level_input: str
    voltage_signal: str
    current_signal: str


class _Moment(Struct, array_like=True, eq=False, gc=False):  # there is one for every step of weeks
    """A break point: the state at an instant, and the inputs from there on."""

    at_ns: int
    state: Vector
    inputs: Inputs


_Ahead = tuple[_Moment | None, Vector, int]
"""A moment, the state at the next grid point, and the time [ns] between them."""


class Plant(Stateful, ABC):
    """Physics that steps from grid point to grid point; commands are extra break points.

    Observation changes nothing, whenever it happens: the state at an instant lies on the line between
    the last break point's state and the state that the next grid point would have, and only grid points
    and commands are ever committed. The last two seconds stay observable, for sensors whose conversion
    ended before it was read.

    Args:
        name: the plant's name in the bench file.
        grid_ns: the distance of grid points, which count from the bench's epoch.
        state: the state at the epoch.
        inputs: every input with its value at the epoch.
        signals: the names of everything that can be observed.
    """

    _now_ns: Kept[int]
    _moments: Kept[deque[_Moment]]

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType({})
    sinks: ClassVar[Mapping[str, Sink]] = MappingProxyType({})

    def __init__(self, name: str, grid_ns: int, state: Vector, inputs: Inputs, signals: frozenset[str]) -> None:
        self.name = name
        self.signals = signals
        self._grid_ns = grid_ns
        self._now_ns = 0
        self._next_ns = grid_ns
        self._moments = deque([_Moment(0, state, dict(inputs))])
        self._ahead: _Ahead = (None, state, grid_ns)
        self._further: deque[Vector] = deque()  # states at the grid points after that one, until a command comes
        self._whole: tuple[Inputs | None, Callable[[Vector], Vector]] = (None, lambda state: state)
        self._present: tuple[Vector, Inputs, float] | None = None  # what `observe` sees until time or inputs change
        self._past: tuple[int, Vector, Inputs] | None = None  # what `observe_at` saw last; no command changes the past
        self._listeners: list[Callable[[], None]] = []
        self._time: Callable[[], int] = self._last_advanced_ns

    @abstractmethod
    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Return the state `dt` seconds later under constant inputs; pure."""

    @abstractmethod
    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return a signal for a state, inputs and the bench's time in s; pure."""

    def stepping(self, inputs: Inputs, dt: float) -> Callable[[Vector], Vector]:
        """Return `step` under these inputs for this time as a function of the state alone; pure."""
        return lambda state: self.step(state, inputs, dt)

    def commanded(self, state: Vector, before: Inputs, after: Inputs) -> Vector:
        """Return the state just after inputs changed; only what jumps with an input differs. Pure."""
        del before, after
        return state

    def places(self, names: tuple[str, ...], inputs: Inputs) -> tuple[int, ...] | None:
        """Return the state indices of these signals under these inputs, None if any is not plain state."""
        del names, inputs
        return None

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the values that a text input may have; empty means any."""
        del name
        return ()

    @property
    def inputs(self) -> Inputs:
        """The inputs that hold now."""
        return self._moments[-1].inputs

    def follow(self, now_ns: Callable[[], int]) -> None:
        """Follow a clock: grid points are committed at the next observation or command.

        Physics does not depend on polling, so committing them late gives the same result.
        """
        self._time = now_ns

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back after every command that changed an input."""
        self._listeners.append(callback)

    def advance(self, when_ns: int) -> None:
        """Commit every grid point up to `when_ns`, which is now."""
        self._now_ns, self._present = when_ns, None
        moments = self._moments
        while self._next_ns <= when_ns:
            last, known = moments[-1], self._ahead
            _, ahead, _ = known if known[0] is last else self._look_ahead(last)
            if ahead == last.state and last.at_ns % self._grid_ns == 0:
                # Physics at rest stays there until the next command: its first moment stands for all that follow.
                self._next_ns = (when_ns // self._grid_ns + 1) * self._grid_ns
                return
            moments.append(moment := _Moment(self._next_ns, ahead, last.inputs))
            if self._further:
                self._ahead = (moment, self._further.popleft(), self._grid_ns)
            oldest_ns = self._next_ns - _KEPT_NS
            self._next_ns += self._grid_ns
            while len(moments) > 2 and moments[1].at_ns < oldest_ns:
                moments.popleft()

    def command(self, **values: Value) -> None:
        """Set inputs at the present instant; without a change there is no break point."""
        last = self._moments[-1]
        inputs = {**last.inputs, **values}
        if len(inputs) > len(last.inputs):
            unknown = values.keys() - last.inputs.keys()
            raise ValueError(f"plant {self.name} has no input {', '.join(sorted(unknown))}")
        if inputs == last.inputs:
            return
        self._keep_up()
        last = self._moments[-1]
        state = last.state
        if last.at_ns == self._now_ns:
            self._moments.pop()
        else:
            state = self.step(state, last.inputs, (self._now_ns - last.at_ns) / NANOSECONDS)
        self._moments.append(_Moment(self._now_ns, self.commanded(state, last.inputs, inputs), inputs))
        self._present = None
        self._further.clear()
        for callback in self._listeners:
            callback()

    def observe(self, signal: str) -> float:
        """Return a signal at the present instant, commands of this instant included."""
        now_ns = self._time()
        if now_ns != self._now_ns:
            self.advance(now_ns)
        return self.signal(signal, *(self._present or self._see()))

    def observing(self, signals: tuple[str, ...]) -> Callable[[Sequence[int]], list[Vector]]:
        """Return a function of rising instants [ns] from now on: what `observe` returns then if no command comes.

        It may tell of the first one alone, which is now.
        """
        known: tuple[Inputs | None, tuple[int, ...] | None] = (None, None)

        def observe(times_ns: Sequence[int]) -> list[Vector]:
            nonlocal known
            self._keep_up()
            inputs = self._moments[-1].inputs
            if known[0] is not inputs:
                known = (inputs, self.places(signals, inputs))
            if known[1] is None:
                return [tuple([self.observe(signal) for signal in signals])]
            return self._foreseen(known[1], times_ns)

        return observe

    def observe_at(self, signal: str, at_ns: int) -> float:
        """Return a signal at an instant of the last two seconds, before any command of that instant.

        So the result does not depend on whether it is observed before or after such a command. Only at the epoch itself
        there is no earlier state.
        """
        self._keep_up()
        if self._past is None or self._past[0] != at_ns:
            moment = next((item for item in reversed(self._moments) if item.at_ns < at_ns), self._moments[0])
            if at_ns < moment.at_ns or at_ns > self._now_ns:
                raise ValueError(f"plant {self.name} cannot be observed at {at_ns} ns, it is {self._now_ns} ns")
            self._past = (at_ns, self._state_at(moment, at_ns), moment.inputs)
        _, state, inputs = self._past
        return self.signal(signal, state, inputs, at_ns / NANOSECONDS)

    def observe_many(self, signal: str, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return a signal at many rising instants of the last two seconds, as `observe_at` sees each of them.

        Between the ends of its grid step a signal is taken to be a straight line, which it is for all signals that are
        linear in the state.

        Args:
            signal: its name.
            times_ns: instants, shape (n,), rising, none of them ahead of now; the values have that shape, too.
        """
        if not times_ns.size:
            return np.empty(0)
        self._keep_up()
        first, last = int(times_ns[0]), int(times_ns[-1])
        moments = self._moments_between(first, last)
        if first < moments[0].at_ns or last > self._now_ns:
            raise ValueError(f"plant {self.name} cannot be observed at {first} to {last} ns, it is {self._now_ns} ns")
        if len(moments) == 1:
            value, slope = self._line(signal, moments[0], None)
            return np.asarray(value + slope * (times_ns - moments[0].at_ns), dtype=np.float64)
        following = [*moments[1:], None]
        lines = np.array([self._line(signal, *pair) for pair in zip(moments, following, strict=True)])
        starts = np.array([moment.at_ns for moment in moments], dtype=np.int64)
        place = np.maximum(np.searchsorted(starts, times_ns, side="left") - 1, 0)
        value, slope = lines[place].T
        return np.asarray(value + slope * (times_ns - starts[place]), dtype=np.float64)

    def waveform(self, signal: str, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return a signal at many rising instants of the last two seconds, however fast it changes between grid points.

        `observe_many` takes it for a straight line there. Here physics itself is asked, at most `_DENSE` times after
        each break point; between these instants it is a straight line.

        Args:
            signal: its name.
            times_ns: as of `observe_many`; an instant is seen before any command of it.
        """
        if not times_ns.size:
            return np.empty(0)
        self._keep_up()
        first, last = int(times_ns[0]), int(times_ns[-1])
        moments = self._moments_between(first, last)
        if first < moments[0].at_ns or last > self._now_ns:
            raise ValueError(f"plant {self.name} cannot be observed at {first} to {last} ns, it is {self._now_ns} ns")
        starts = np.array([moment.at_ns for moment in moments], dtype=np.int64)
        edges = np.searchsorted(times_ns, starts, side="right")
        values = np.empty(times_ns.size)
        for moment, begin, end in zip(moments, [0, *edges[1:]], [*edges[1:], times_ns.size], strict=True):
            part = times_ns[begin:end]
            if not part.size:
                continue
            few = part if part.size <= _DENSE else np.linspace(part[0], part[-1], _DENSE).astype(np.int64)
            values[begin:end] = np.interp(part, few, [self._seen_after(moment, signal, int(each)) for each in few])
        return values

    def shape_ns(self, first_ns: int, last_ns: int) -> NDArray[np.int64]:
        """Return instants from one to another at which `waveform` shows what happens: densest after break points."""
        self._keep_up()
        found = [np.linspace(first_ns, last_ns, _EVENLY)]
        for moment in self._moments_between(first_ns, last_ns):
            span = last_ns - moment.at_ns
            if moment.at_ns >= first_ns and span > 1:
                found += [np.array([moment.at_ns]), moment.at_ns + np.geomspace(1, span, _AFTER)]
        return np.unique(np.concatenate(found).astype(np.int64))

    def _seen_after(self, moment: _Moment, signal: str, at_ns: int) -> float:
        state, dt = moment.state, (at_ns - moment.at_ns) / NANOSECONDS
        if dt > 0:
            state = self.step(state, moment.inputs, dt)
        return self.signal(signal, state, moment.inputs, at_ns / NANOSECONDS)

    def state(self) -> Mapping[str, object]:
        """Return everything that the plant needs to continue, as JSON values."""
        self._keep_up()
        return super().state()

    def restored(self) -> None:
        """Discard cached observations and predictions."""
        self._next_ns = self._end_ns(self._moments[-1])
        self._ahead = (None, (), self._grid_ns)
        self._further.clear()
        self._present = self._past = None

    def _keep_up(self) -> None:
        now_ns = self._time()
        if now_ns != self._now_ns:
            self.advance(now_ns)

    def _last_advanced_ns(self) -> int:
        return self._now_ns

    def _see(self) -> tuple[Vector, Inputs, float]:
        """Return state, inputs and the bench's time in s of the present instant, and keep them until it is over."""
        last, now_ns = self._moments[-1], self._now_ns
        self._present = present = (self._state_at(last, now_ns), last.inputs, now_ns / NANOSECONDS)
        return present

    def _foreseen(self, places: tuple[int, ...], times_ns: Sequence[int]) -> list[Vector]:
        """Predict state values at ascending instants from now on, barring commands."""
        last, further, used = self._moments[-1], self._further, 0
        at_ns, state, seen = last.at_ns, last.state, []
        _, ahead, span_ns = self._look_ahead(last)
        moves = ahead != state
        for time_ns in times_ns:
            while moves and time_ns >= at_ns + span_ns:
                at_ns, span_ns, state = at_ns + span_ns, self._grid_ns, ahead
                if used == len(further):
                    further.append(self._grid_step(state, last.inputs))
                ahead = further[used]
                used += 1
            share = (time_ns - at_ns) / span_ns
            seen.append(tuple([(here := state[place]) + (ahead[place] - here) * share for place in places]))
        return seen

    def _moments_between(self, first_ns: int, last_ns: int) -> list[_Moment]:
        """Return the moments whose lines are seen between two instants, before any command of these instants."""
        seen: list[_Moment] = []
        for moment in reversed(self._moments):
            if moment.at_ns < last_ns:
                seen.append(moment)
            if moment.at_ns < first_ns:
                break
        return seen[::-1] or [self._moments[0]]

    def _line(self, signal: str, moment: _Moment, following: _Moment | None) -> tuple[float, float]:
        """Return a signal just after a moment, and its slope per ns up to the grid point ahead."""
        end_ns = self._end_ns(moment)
        # Where nobody commanded anything, the following moment is the grid point, and its state is known.
        known = following is not None and following.inputs is moment.inputs
        ahead = following.state if known and following is not None else self._look_ahead(moment)[1]
        value = self.signal(signal, moment.state, moment.inputs, moment.at_ns / NANOSECONDS)
        end = self.signal(signal, ahead, moment.inputs, end_ns / NANOSECONDS)
        return value, (end - value) / (end_ns - moment.at_ns)

    def _state_at(self, moment: _Moment, at_ns: int) -> Vector:
        if at_ns <= moment.at_ns:
            return moment.state
        known = self._ahead
        _, ahead, span_ns = known if known[0] is moment else self._look_ahead(moment)
        share = (at_ns - moment.at_ns) / span_ns
        return tuple([here + (there - here) * share for here, there in zip(moment.state, ahead, strict=True)])

    def _end_ns(self, moment: _Moment) -> int:
        return (moment.at_ns // self._grid_ns + 1) * self._grid_ns

    def _look_ahead(self, moment: _Moment) -> _Ahead:
        if self._ahead[0] is not moment:
            state, inputs, span_ns = moment.state, moment.inputs, self._end_ns(moment) - moment.at_ns
            whole = span_ns == self._grid_ns
            ahead = self._grid_step(state, inputs) if whole else self.step(state, inputs, span_ns / NANOSECONDS)
            self._ahead = (moment, ahead, span_ns)
        return self._ahead

    def _grid_step(self, state: Vector, inputs: Inputs) -> Vector:
        """Return the state a whole grid step later."""
        if self._whole[0] is not inputs:
            self._whole = (inputs, self.stepping(inputs, self._grid_ns / NANOSECONDS))
        return self._whole[1](state)
