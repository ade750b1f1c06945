"""What spectra of long records cost beside SciPy's: time in turns, and memory; `--soak` takes the whole size."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy import signal

from hil.analysis.spectra.welch import Welch, spectrum

WHOLE = 14_400_000  # four hours at 1 kHz
SEGMENTS = (1 << 10, 1 << 13, 1 << 16)


@pytest.fixture(scope="module")
def record(request):
    """Samples at rest on an offset."""
    size = WHOLE if request.config.getoption("--soak") else WHOLE // 5
    return 3.0 + np.random.default_rng(1).standard_normal(size)


def ours(record, segment):
    """Density with intervals."""
    return spectrum(record, 1000.0, how=Welch(segment=segment)).density


def theirs(record, segment):
    """Density without intervals."""
    return signal.welch(record, 1000.0, nperseg=segment)[1]


@pytest.mark.parametrize("segment", SEGMENTS)
def test_a_spectrum_of_a_long_record(pair, record, segment):
    """Hann, half overlapping, the mean taken off: what SciPy does by default."""
    assert ours(record, segment)[2:] == pytest.approx(theirs(record, segment)[2:], rel=1e-12)
    what = f"Welch, segments of {segment}, hil / SciPy"
    pair(what, lambda: ours(record, segment), lambda: theirs(record, segment), units=record.size, rounds=4)


@pytest.mark.parametrize("segment", SEGMENTS)
def test_memory_of_a_spectrum(record, segment):
    """At most a tenth of SciPy's, besides the record; what both allocate is the same on every machine."""
    least = [_peak(each, record, segment) for each in (ours, theirs)]
    told = f"segments of {segment}: {least[0] / 1e6:.2f} MB / {least[1] / 1e6:.1f} MB of {record.nbytes / 1e6:.0f} MB"
    assert least[0] <= 0.1 * least[1], told


def _peak(function, record, segment):
    tracemalloc.start()
    function(record, segment)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak
