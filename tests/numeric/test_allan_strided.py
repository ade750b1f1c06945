"""Octaves of long records: one pass against the definition, the exact deviation and the compiled loops."""

from __future__ import annotations

import sys
import tracemalloc

import allantools
import numpy as np
import pytest

from hil.analysis.allan import strided
from hil.analysis.allan.deviation import deviation
from hil.model.errors import Refused


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Blocks so small that short records take many of them."""
    monkeypatch.setattr(strided, "_BLOCK", 1 << 9)


@pytest.fixture(autouse=True)
def plain(request, monkeypatch):
    """The way without a compiler, which takes seconds to load; the tests marked `system` take the compiler's."""
    if not request.node.get_closest_marker("system"):
        monkeypatch.setattr(strided, "_fine", lambda: strided._plain)


def record(samples, offset=5.0):
    """White noise and a random walk on an offset."""
    generator = np.random.default_rng(samples)
    return generator.standard_normal(samples) + 0.01 * np.cumsum(generator.standard_normal(samples)) + offset


def defined(values, m):
    """The variance as the docstring defines it: differences that begin at every m/16-th sample."""
    stride = max(1, m // strided.STARTS)
    phase = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    second = (phase[2 * m :] - 2.0 * phase[m:-m] + phase[: -2 * m])[::stride]
    return float(np.square(second).mean()) / (2.0 * m * m)


def compared_with_the_definition(samples):
    """Assert that one pass gives the variances that are defined, and averages that are plain sums."""
    values = record(samples)
    count = int(np.log2(samples // 4)) + 1
    found, averages = strided.octaves(values, float(values.mean()), count)
    assert found == pytest.approx([defined(values, 1 << octave) for octave in range(count)], rel=1e-12)
    for octave, sums in enumerate(averages):
        m = 1 << octave
        rows = (values - values.mean())[: min(samples // m, 1 << 14) * m].reshape(-1, m)
        assert np.allclose(sums, rows.sum(axis=1), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("samples", [2048, 4095, 9001, 20_011])
def test_one_pass_gives_the_variances_that_it_defines(samples):
    """Any length, whatever it leaves in the last block, and averages that are plain sums."""
    compared_with_the_definition(samples)


@pytest.mark.system
def test_one_pass_that_was_compiled_gives_them_too():
    """Of all those lengths."""
    for samples in (2048, 4095, 9001, 20_011):
        compared_with_the_definition(samples)


def test_the_loops_that_a_compiler_takes_give_the_same():
    """As plain Python here, to 1e-12: variances and sums."""
    values = record(9001)
    plain, looped = ((np.empty((9001 - 256) // 16 + 1), np.empty((2, 8))) for _ in range(2))
    strided._plain(values, 5.0, *plain)
    strided._looped(values, 5.0, *looped)
    assert np.allclose(looped[0], plain[0], rtol=0.0, atol=1e-11)
    assert looped[1] == pytest.approx(plain[1], rel=1e-12)


@pytest.mark.system
def test_what_the_compiler_makes_gives_the_same():
    """`hil[fast]`, a development dependency: the compiled loops, and the whole deviation with them."""
    kernel = strided.compiled()
    assert kernel is not None
    values = record(200_003)
    plain, fast = ((np.empty((200_003 - 256) // 16 + 1), np.empty((2, 8))) for _ in range(2))
    strided._plain(values, 5.0, *plain)
    kernel(values, 5.0, *fast)
    assert np.allclose(fast[0], plain[0], rtol=0.0, atol=1e-9)
    assert fast[1] == pytest.approx(plain[1], rel=1e-11)


def test_a_compiler_that_is_missing_or_fails_is_not_needed(monkeypatch):
    """Without the extra, and with one that does not work, the plain way does it."""
    for broken in (None, object()):
        monkeypatch.setitem(sys.modules, "numba", broken)
        strided.compiled.cache_clear()
        assert strided.compiled() is None
    strided.compiled.cache_clear()


def test_a_long_record_is_taken_in_one_pass_and_says_so(monkeypatch):
    """Same points, intervals and noise types as the exact deviation, deviations far within them."""
    monkeypatch.setattr(strided, "LONG", 1 << 16)
    values = record((1 << 16) + 77)
    long, exact = deviation(values, 10.0), deviation(values, 10.0, exact=True)
    assert (long.starts, exact.starts) == (strided.STARTS, 0)
    assert np.array_equal(long.terms, exact.terms)
    assert np.array_equal(long.alpha, exact.alpha)
    assert np.array_equal(long.edf, exact.edf)
    assert long.deviation[:5] == pytest.approx(exact.deviation[:5], rel=1e-12)
    assert long.deviation == pytest.approx(exact.deviation, rel=0.014)
    assert (np.abs(long.deviation - exact.deviation) < 0.15 * (exact.high - exact.low)).all()
    theirs = allantools.oadev(values, rate=10.0, data_type="freq", taus=exact.tau)[1]
    assert exact.deviation == pytest.approx(theirs, rel=1e-12)


def test_holes_other_times_and_other_estimators_are_exact(monkeypatch):
    """Only octaves of the overlapping deviation of a whole record are thinned."""
    monkeypatch.setattr(strided, "LONG", 1 << 12)
    values = record(1 << 12)
    assert deviation(values, 1.0, [1.0, 64.0]).starts == 0
    assert deviation(values, 1.0, np.array([1.0, 64.0])).starts == 0
    assert deviation(values, 1.0, estimator="total").starts == 0
    with pytest.raises(Refused, match="the first is number 8"):
        deviation(np.where(np.arange(1 << 12) == 7, np.inf, values), 1.0)
    values[100] = np.nan
    assert deviation(values, 1.0, holes=True).starts == 0
    assert not deviation(np.full(1 << 12, 0.1), 1.0).deviation.any()


def test_a_long_record_needs_a_fifth_of_its_own_memory(monkeypatch):
    """With intervals and noise types, at most 1.2 times the data in all."""
    monkeypatch.setattr(strided, "_BLOCK", 1 << 15)
    values = np.random.default_rng(4).standard_normal(1 << 21)
    tracemalloc.start()
    curve = deviation(values, 1.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert curve.starts == strided.STARTS
    assert peak < 0.2 * values.nbytes
