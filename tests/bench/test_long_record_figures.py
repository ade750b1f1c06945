"""What long records cost, beside the libraries that people use for them; `--soak` takes whole sizes."""

from __future__ import annotations

import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import allantools
import numpy as np
import pytest

from hil.analysis.allan import strided
from hil.analysis.allan.deviation import deviation

WHOLE = 14_400_000  # four hours at 1 kHz


@pytest.fixture
def record(request):
    """Samples at rest on an offset."""
    size = WHOLE if request.config.getoption("--soak") else WHOLE // 5
    return 3.0 + np.random.default_rng(1).standard_normal(size)


def theirs(values):
    """Octaves of the overlapping deviation, without intervals."""
    return allantools.oadev(values, rate=1000.0, data_type="freq", taus="octave")


def test_octaves_of_a_long_record(pair, record, monkeypatch):
    """With intervals and noise types against allantools without, a sample: NumPy alone."""
    monkeypatch.setattr(strided, "_fine", lambda: strided._plain)
    pair(
        "Allan deviation, NumPy / allantools",
        lambda: deviation(record, 1000.0),
        lambda: theirs(record),
        units=record.size,
        rounds=3,
    )


def test_octaves_of_a_long_record_compiled(pair, record):
    """The same with `hil[fast]`."""
    if strided.compiled() is None:
        pytest.skip("hil[fast] is not installed")
    pair(
        "Allan deviation, Numba / allantools",
        lambda: deviation(record, 1000.0),
        lambda: theirs(record),
        units=record.size,
        rounds=3,
    )


def test_channels_on_two_cores(pair, record):
    """Nine channels, one after the other or in two threads."""
    channels = [record] * 9

    def threads():
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(lambda each: deviation(each, 1000.0), channels))

    pair(
        "nine channels, two threads / one",
        threads,
        lambda: [deviation(each, 1000.0) for each in channels],
        units=9 * record.size,
        rounds=2,
    )


def test_memory_of_a_long_record(record):
    """At most 1.2 times the data, themselves included."""
    tracemalloc.start()
    deviation(record, 1000.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.2 * record.nbytes
