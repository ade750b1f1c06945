"""Costs: measured per unit, told as multiples of a loop that the same run measured on the same machine."""

from __future__ import annotations

import time

import pytest

TURNS = 20_000
COSTS = pytest.StashKey[list]()
PAIRS = pytest.StashKey[list]()


def reference_loop():
    """Do a little arithmetic, `TURNS` times, in plain Python."""
    total = 0
    for number in range(TURNS):
        total = (total * 31 + number) % 7919
    return total


def pytest_configure(config):
    """Begin a list of costs."""
    config.stash[COSTS] = []
    config.stash[PAIRS] = []


@pytest.fixture(scope="session")
def turn():
    """Seconds that one turn of the reference loop takes: the least of several tries."""
    tries = []
    for _ in range(9):
        began = time.perf_counter()
        reference_loop()
        tries.append(time.perf_counter() - began)
    return min(tries) / TURNS


@pytest.fixture
def cost(benchmark, turn, request):
    """Measure a function that does `units` of something, a few rounds only, and note what one costs."""

    def measure(what, function, *, units=1, rounds=5):
        result = benchmark.pedantic(function, rounds=rounds, warmup_rounds=1)
        if benchmark.stats is not None:  # with --benchmark-disable the function has run once
            seconds = benchmark.stats.stats.min / units
            benchmark.extra_info["turns"] = round(seconds / turn)
            request.config.stash[COSTS].append((what, seconds, seconds / turn))
        return result

    return measure


@pytest.fixture
def pair(request):
    """Measure two functions in turns, note the ratio of the least times of both, and return it."""

    def measure(what, ours, theirs, *, units=1, rounds=9, clock=time.perf_counter):
        tries = [(_seconds(ours, clock) / units, _seconds(theirs, clock) / units) for _ in range(rounds)]
        least = [min(each) for each in zip(*tries, strict=True)]
        request.config.stash[PAIRS].append((what, *least))
        return least[0] / least[1]

    return measure


def _seconds(function, clock):
    began = clock()
    function()
    return clock() - began


def pytest_terminal_summary(terminalreporter, config):
    """Show what things cost."""
    for what, ours, theirs in config.stash.get(PAIRS, []):
        terminalreporter.section("pairs, measured in turns")
        terminalreporter.write_line(f"{what:<58} {ours * 1e6:.4g} us / {theirs * 1e6:.4g} us = {ours / theirs:.2f}")
    if not config.stash.get(COSTS, []):
        return
    terminalreporter.section("what things cost, in turns of a plain Python loop")
    for what, seconds, turns in config.stash[COSTS]:
        terminalreporter.write_line(f"{what:<58} {seconds * 1e6:>14,.4g} us {turns:>14,.4g} turns")
