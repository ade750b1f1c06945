"""The short ways of long records give what the long ways give."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from hil.analysis import sampling
from hil.analysis.sampling import placed

COUNT = 70_000
GENERATOR = np.random.default_rng(3)
TIMES = {
    "even": np.arange(COUNT) * 1e-3,
    "no decimal step": 7.0 + np.arange(COUNT) / 952.0,
    "jitter of the clock": np.arange(COUNT) * 0.01 + 2e-4 * GENERATOR.standard_normal(COUNT),
    "jitter of the samples": np.cumsum(0.01 + 3e-4 * GENERATOR.standard_normal(COUNT)),
    "much jitter": np.arange(COUNT) * 0.01 + 6e-4 * GENERATOR.standard_normal(COUNT),
    "fine rounding": np.round(np.arange(COUNT) / 952.0, 5),
    "epoch": 1.7e9 + np.arange(COUNT) * 0.01,
}


@pytest.mark.parametrize("name", TIMES)
def test_regular_times_are_judged_alike_in_one_pass(name, monkeypatch):
    """Every figure of the report, to rounding."""
    times = TIMES[name]
    assert sampling._regular(times, np.diff(times)) is not None
    short, places = placed(times)
    monkeypatch.setattr(sampling, "_regular", lambda *_: None)
    long, others = placed(times)
    assert np.array_equal(places, others)
    scale = 1e-6 if name == "epoch" else 1e-9  # rounding of the timestamps themselves is all the jitter there
    assert asdict(short) == pytest.approx(asdict(long), rel=1e-3 if name == "epoch" else 1e-6, abs=scale * 1e-3)


@pytest.mark.parametrize("kind", ["gap", "rounded", "burst", "repeated", "reversed"])
def test_other_times_go_the_long_way(kind):
    """Whatever could be a gap, rounding or a burst is looked at in full."""
    times = np.arange(COUNT) * 1e-3
    if kind == "gap":
        times[500:] += 1e-3
    elif kind == "rounded":
        times = np.round(np.arange(COUNT) / 952.0, 3)
    elif kind == "burst":
        times = (np.arange(COUNT) // 8) * 8e-3 + np.arange(COUNT) % 8 * 1e-6
    elif kind == "repeated":
        times[7] = times[6]
    else:
        times[[6, 7]] = times[[7, 6]]
    assert sampling._regular(times, np.diff(times)) is None


@pytest.mark.parametrize("size", [20_001, 40_000])
@pytest.mark.parametrize("spread", [0.0, 1e-3, 1.0])
def test_the_median_is_exact(size, spread):
    """Whether values lie apart, coincide, or lie all in one place; even and odd counts."""
    values = np.rint(GENERATOR.standard_normal(size) * spread * 1e3) + GENERATOR.standard_normal(size) * (spread == 1.0)
    assert sampling._median(values) == np.median(values)
    values[: size // 2 + 5] = -1e9
    assert sampling._median(values) == np.median(values)
