"""The one state mechanism: what a class marks as kept is written, and read back strictly."""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from hil.wire.checkpoint import Kept, StateError, Stateful


@dataclass(frozen=True)
class Frame:
    """A value with fields."""

    kind: int
    payload: bytes


class Inner(Stateful):
    """A part of a part."""

    _count: Kept[int]

    def __init__(self, count: int) -> None:
        self._count = count


class Outer(Stateful):
    """Everything that can be kept, and something that is not."""

    name: Kept[str]
    _level: Kept[float]
    _last: Kept[Frame | None]
    _rows: Kept[deque[tuple[int, bytes]]]
    _noise: Kept[NDArray[np.float64]]
    _registers: Kept[dict[int, int]]
    _inner: Kept[Inner]
    _each: Kept[dict[int, Inner]]
    _row: Kept[list[Inner]]

    def __init__(self, start: int) -> None:
        self.name = f"n{start}"
        self._level = start / 3
        self._last: Frame | None = Frame(start, b"\x00\xff") if start else None
        self._rows = deque([(start, b"\x01")])
        self._noise = np.array([start / 7, 0.1])
        self._registers = {0x20: start}
        self._inner = Inner(start)
        self._each = {1: Inner(start + 1), 2: Inner(start + 2)}
        self._row = [Inner(start + 3)]
        self.ring = start
        self.followed = ""

    def restored(self) -> None:
        """Follow from what was restored."""
        self.followed = f"after {self.name}"


def as_json(part):
    """Return a state as it comes back from a file."""
    return json.loads(json.dumps(part.state()))


@pytest.mark.parametrize("start", [0, 5])
def test_everything_kept_comes_back_in_its_type(start):
    """Values, deques, arrays, parts, and lists and dictionaries of parts; the rest stays; the hook comes last."""
    other = Outer(1)
    other.restore(as_json(Outer(start)))
    assert as_json(other) == as_json(Outer(start))
    assert (type(other._rows), other._rows[0]) == (deque, (start, b"\x01"))
    assert isinstance(other._noise, np.ndarray)
    assert other._last == (Frame(5, b"\x00\xff") if start else None)
    assert (other.ring, other.followed, other._registers) == (1, f"after n{start}", {0x20: start})


def test_a_state_is_a_copy():
    """What happens afterwards does not reach into a state that was taken."""
    one = Outer(2)
    state = one.state()
    one._registers[0x20] = 9
    one._rows.clear()
    assert (state["registers"], len(state["rows"])) == ({"32": 2}, 1)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda state: state.pop("level"), "^'level' is missing"),
        (lambda state: state.update(more=1), "^'more' is unknown"),
        (lambda state: state.update(level="high"), "^level: Expected `float`, got `str`"),
        (lambda state: state["each"]["2"].pop("count"), r"^each\.2: 'count' is missing"),
        (lambda state: state["each"].pop("1"), "^each: '1' is missing"),
        (lambda state: state["row"].append({"count": 1}), "^row: '1' is unknown"),
        (lambda state: state["last"].update(rest=1), "^last: .* is not what was written"),
        (lambda state: state.update(inner=None), "^inner: "),
        (lambda state: state["registers"].update(x=1), "^registers: "),
    ],
)
def test_what_does_not_fit_is_refused_with_its_place(spoil, message):
    """Missing, unknown and mistyped parts, however deep."""
    state = as_json(Outer(5))
    spoil(state)
    with pytest.raises(StateError, match=message):
        Outer(5).restore(state)
