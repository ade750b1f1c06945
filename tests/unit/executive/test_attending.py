"""The last resort of a bench of this process, which ends what neither comes back nor lets time pass."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hil.clock import wall
from hil.executive.ending import signals
from hil.executive.ending.signals import Alarm
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.attending import Lookout


class Case:
    """A case as the scheduler knows it, with the wall's time and what was armed."""

    def __init__(self, monkeypatch):
        self.now = 100.0
        self.at_ns = 0
        self.standstill = SimpleNamespace(since=100.0)
        self.patience_s = 10.0
        self.ends_at = None
        self.looks = 0
        self.flags = StopFlags()
        monkeypatch.setattr(wall, "monotonic", lambda: self.now)
        monkeypatch.setattr(signals.signal, "setitimer", lambda *_: (0.0, 0.0))
        monkeypatch.setattr(signals.signal, "signal", lambda *_: None)
        bench = SimpleNamespace(spec=SimpleNamespace(head=SimpleNamespace(longest_computation_s=1.0)), outside=False)
        self.alarm = Alarm(self.flags)
        self.alarm.keep(Lookout(bench, self, SimpleNamespace(drives=lambda: False), self.expect))
        self.expect(self.patience_s)  # a case begins

    def expect(self, seconds):
        """Be ended in so many seconds."""
        self.ends_at = self.now + seconds

    def now_ns(self):
        """Return the bench's time."""
        return self.at_ns

    def look(self):
        """Be a scheduling point."""
        self.looks += 1

    def goes_on(self, seconds, sign=lambda _: None):
        """Ring for so many seconds, and tell whether the process still lives."""
        for _ in range(round(seconds / 0.2)):
            self.now += 0.2
            sign(self)
            self.alarm._ring(0, None)
            if self.now > self.ends_at:
                return False
        return True


@pytest.fixture
def case(monkeypatch):
    """A case that has begun."""
    return Case(monkeypatch)


def test_own_code_that_can_be_disturbed_is_ended_from_within(case):
    """The process is left alive for it: the case is told wherever it is."""
    with case.flags.case_code():
        assert case.goes_on(60.0)
    assert case.looks > 100


def test_what_cannot_be_disturbed_and_lets_no_time_pass_is_ended(case):
    """An endless loop where pytest formats an exception, or in what a call of the executive makes of its arguments."""
    assert not case.goes_on(60.0)
    assert case.now - 100.0 == pytest.approx(case.patience_s, abs=0.3)


def test_a_loop_within_a_call_of_the_executive_is_ended(case):
    """The executive is not cut in two; but it does not hold the bench for ever either."""
    with case.flags.case_code(), case.flags.undisturbed():
        assert not case.goes_on(60.0)


@pytest.mark.parametrize("sign", ["bench time", "a person"])
def test_whoever_lets_time_pass_goes_on(case, sign):
    """A record of weeks, or a question that nobody answers for an hour."""

    def goes_on(case):
        if sign == "bench time":
            case.at_ns += 1
        else:
            case.standstill.since += 1

    assert case.goes_on(600.0, goes_on)
    assert not case.goes_on(60.0)
