"""The wall's clocks, which nobody in this process can replace."""

from __future__ import annotations

import datetime as dt
import time

import pytest

from hil.clock import live, virtual, wall

MODULES = (time, dt, wall, live, virtual)


class Frozen(dt.datetime):
    """A moment of 2020."""

    @classmethod
    def now(cls, tz=None):
        """Return it."""
        return cls(2020, 1, 1, tzinfo=tz)


@pytest.fixture
def frozen(monkeypatch):
    """Freeze time in every module, as tools for tests do."""
    fakes = {id(each): lambda *_: 1_577_836_800 for each in vars(time).values() if callable(each)}
    fakes[id(dt.datetime)] = Frozen
    before = wall.stamp(), wall.monotonic(), wall.clocks()
    for module in MODULES:
        for name, each in tuple(vars(module).items()):
            if id(each) in fakes:
                monkeypatch.setattr(module, name, fakes[id(each)])
    return before


def test_frozen_time_freezes_no_clock_of_the_run(frozen):
    """Due dates and stamps of 2020 stood in the record of another year."""
    stamp, monotonic, clocks = frozen
    assert time.time() == 1_577_836_800
    assert 0 <= wall.seconds_of(wall.utc_now()) - wall.seconds_of(stamp.utc) < 60
    assert 0 <= wall.stamp().boot - stamp.boot < 60
    assert monotonic < wall.monotonic() < monotonic + 60
    assert 0 <= wall.clocks().day - clocks.day < 60
    assert -1 <= wall.seconds_since(stamp.utc) < 60
    assert virtual.VirtualClock("2026-01-01T00:00:00Z").utc() == "2026-01-01T00:00:00.000000Z"
    assert live.LiveClock("2026-01-01T00:00:00Z").boot_s_of(0) >= stamp.boot - 1
    assert not isinstance(wall.moment_of("2026-01-01T00:00:00Z"), Frozen)


def test_what_was_replaced_is_named(frozen):
    """Every clock that a case may read."""
    assert frozen
    assert {"time.time", "time.monotonic", "time.clock_gettime_ns", "datetime.datetime"} <= {*wall.replaced()}


def test_nothing_is_replaced_by_itself():
    """A run without such tools is told nothing."""
    assert wall.replaced() == ()
