"""Times of samples from the instants at which the FIFO reached its watermark."""

from __future__ import annotations

import numpy as np
import pytest

from hil.instruments.sensors.timeline import Span, Timeline


def span(number, at_s, count=50, lost=0, watermark=50):
    """Return a span."""
    return Span(number=number, at_s=at_s, watermark=watermark, count=count, lost=lost)


def test_times_are_linear_between_watermarks():
    """The first span waits for the second, which tells the period."""
    line = Timeline(0.01)
    assert line.place(span(0, 70.5)) == []
    first, second = line.place(span(1, 71.0 + 0.005))
    assert first == pytest.approx(0.0101 * np.arange(1, 51))
    assert second == pytest.approx(0.0101 * np.arange(51, 101))
    (third,) = line.place(span(2, 71.505, count=52))
    assert third[:50] == pytest.approx(1.01 + 0.01 * np.arange(1, 51))
    assert third[50:] == pytest.approx(1.51 + 0.01 * np.arange(1, 3))
    (fourth,) = line.place(span(3, 71.505 + 52 * 0.0099))
    assert fourth[-1] == pytest.approx(1.51 + 52 * 0.0099)
    assert fourth[1] - fourth[0] == pytest.approx(0.0099)


def test_a_span_after_a_lost_one_stands_before_its_own_instant():
    """Its period is the last one known."""
    line = Timeline(0.01)
    line.place(span(0, 0.5))
    line.place(span(1, 1.0))
    (times,) = line.place(span(4, 2.6))
    assert times == pytest.approx(2.1 + 0.01 * np.arange(1, 51))


def test_an_instant_that_cannot_be_teaches_no_period():
    """The sensor's oscillator is never ten per cent off."""
    line = Timeline(0.01, begun_s=0.0)
    (times,) = line.place(span(0, 0.8))
    assert np.diff(times) == pytest.approx(0.01)
    assert times[-1] == pytest.approx(0.8)


def test_edges_without_samples_do_not_move_the_beginning():
    """Not even as the first ones."""
    line = Timeline(0.01)
    assert [len(times) for times in line.place(span(0, 0.1, count=0))] == [0]
    assert line.place(span(1, 0.6)) == []
    first, second = line.place(span(2, 1.1))
    assert first[0] == pytest.approx(0.01)
    assert len(second) == 50
