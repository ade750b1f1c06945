"""Stopping: signals set flags, and nothing but a case's own code is ended at once."""

from __future__ import annotations

import os
import signal
import threading
from types import SimpleNamespace

import pytest

from hil.executive.ending.signals import SUPERVISOR_ENDED, handle_signals
from hil.executive.ending.stop import Astray, StopFlags, Stopped


def test_the_first_reason_stays_and_the_second_request_is_urgent():
    """Whoever asked first is named; asking again makes it urgent."""
    flags = StopFlags()
    flags.check()
    flags.request("SIGINT")
    assert (flags.reason, flags.urgent) == ("SIGINT", False)
    flags.request("SIGTERM")
    assert (flags.reason, flags.urgent) == ("SIGINT", True)
    with pytest.raises(Stopped, match="SIGINT"):
        flags.check()


def test_a_stop_is_no_exception():
    """A case's `except Exception` does not catch it."""
    assert not issubclass(Stopped, Exception)


def test_one_request_never_interrupts():
    """The present sample, and whatever else is going on, comes to its end."""
    flags = StopFlags()
    flags.request("SIGINT")
    with flags.case_code():
        flags.interrupt()


@pytest.mark.parametrize("inside", ["undisturbed", "shielded"])
def test_an_urgent_request_ends_a_cases_own_code_only(inside):
    """Neither the executive's work for a case nor pytest's own is cut in two."""
    flags = StopFlags()
    flags.request("SIGINT")
    flags.request("SIGINT")
    flags.interrupt()
    with flags.case_code():
        with getattr(flags, inside)():
            flags.interrupt()
        with pytest.raises(Stopped):
            flags.interrupt()
    flags.interrupt()


def test_a_shield_holds_off_scheduling_points_too():
    """While the bench is made safe nothing raises; outside it does again."""
    flags = StopFlags()
    flags.request("SIGTERM")
    with flags.shielded(), flags.shielded():
        flags.check()
    with flags.undisturbed(), pytest.raises(Stopped):
        flags.check()


@pytest.fixture(autouse=True)
def _handlers():
    """Put the handlers of signals back."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.getsignal(number) for number in numbers}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signals_are_requests_while_they_are_handled(name):
    """A signal is a request with its name; the handler before is put back."""
    signal.signal(signal.Signals[name], signal.default_int_handler)  # an ignored SIGHUP would stay ignored
    flags, before = StopFlags(), signal.getsignal(signal.Signals[name])
    with handle_signals(flags):
        os.kill(os.getpid(), signal.Signals[name])
    assert flags.reason == name
    assert signal.getsignal(signal.Signals[name]) is before


def test_the_second_signal_ends_a_case_that_computes():
    """Wherever its code is, it ends there."""
    flags = StopFlags()
    with handle_signals(flags), flags.case_code(), pytest.raises(Stopped):
        signal.raise_signal(signal.SIGINT)
        assert flags.reason == "SIGINT"
        signal.raise_signal(signal.SIGINT)
        pytest.fail("the second signal did nothing")


def test_a_case_that_swallows_its_cuts_is_given_up():
    """The bench is made safe before the first cut; after some more the run ends where it is."""
    flags, told = StopFlags(), []
    flags.govern(SimpleNamespace(make_safe=lambda: told.append("safe"), give_up=lambda: told.append("give up")))
    flags.request("SIGINT")
    flags.request("SIGINT")
    with flags.case_code():
        for _ in range(10):
            with pytest.raises(Stopped):
                flags.interrupt()
        assert told == ["safe"]
        with pytest.raises(Stopped):
            flags.interrupt()
    assert told == ["safe", "give up"]


def test_one_hang_up_told_twice_is_one_request():
    """The terminal, the shell and the supervisor may all tell it."""
    flags = StopFlags()
    signal.signal(signal.SIGHUP, signal.default_int_handler)  # an ignored one would stay ignored
    with handle_signals(flags):
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)
    assert (flags.reason, flags.urgent) == ("SIGHUP", False)


def test_a_supervisor_that_was_killed_is_named(monkeypatch):
    """The SIGTERM that the operating system sends for it is nobody's; anybody else's keeps its name."""
    for parent, reason in ((1, SUPERVISOR_ENDED), (os.getppid(), "SIGTERM")):
        flags = StopFlags()
        with handle_signals(flags), monkeypatch.context() as patched:
            patched.setattr(os, "getppid", lambda parent=parent: parent)
            signal.raise_signal(signal.SIGTERM)
        assert flags.reason == reason


def test_a_look_is_no_scheduling_point_of_the_case(monkeypatch):
    """How long its own code ran alone counts from the last look, how long it was silent from its own last call."""
    now, told = [10.0], []
    monkeypatch.setattr("hil.clock.wall.monotonic", lambda: now[0])
    flags = StopFlags()

    def attend(alone_s, silent_s):
        told.append((alone_s, silent_s))
        with flags.undisturbed():
            now[0] += 0.5

    with flags.case_code():
        for _ in range(3):
            now[0] += 1.0
            flags.interlude(attend)
        with flags.undisturbed():
            pass
        now[0] += 1.0
        flags.interlude(attend)
        with flags.undisturbed():
            flags.interlude(attend)
    assert told == [(1.0, 1.0), (1.0, 2.5), (1.0, 4.0), (1.0, 1.0)]


@pytest.mark.parametrize("service", ["undisturbed", "check"])
def test_another_thread_is_turned_away(service):
    """It drives nothing and writes nothing, and what it tried is kept."""
    flags, met = StopFlags(), []

    def stray():
        try:
            if service == "check":
                flags.check()
            with flags.undisturbed():
                pass
        except Astray as error:
            met.append(error.message)

    thread = threading.Thread(target=stray)
    thread.start()
    thread.join()
    assert met == [flags.astray]
    assert "another thread" in flags.astray


def test_what_can_be_put_right_leaves_the_run_open():
    """Nobody's first word is changed by it, it is never urgent, and before the first case there is nothing to leave."""
    flags = StopFlags()
    flags.leave_off("disk full")
    assert (flags.reason, flags.leave_open) == ("disk full", False)
    flags = StopFlags()
    flags.turns = 1
    for _ in range(3):
        flags.leave_off("disk full")
    assert (flags.reason, flags.leave_open, flags.urgent) == ("disk full", True, False)
    flags = StopFlags()
    flags.turns = 1
    flags.request("SIGINT")
    flags.leave_off("disk full")
    assert (flags.reason, flags.leave_open, flags.urgent) == ("SIGINT", False, False)
