"""Which filter of a table fits a rate."""

from __future__ import annotations

import pytest

from hil.instruments.sensors.filters import BUTTERWORTH, Filters

TABLE = Filters(cut_offs=(200.0, 200.0, 50.0, 10.0, 400.0), bandwidths=(230.0, 230.0, 60.0, 12.0, 410.0))


@pytest.mark.parametrize(
    ("rate", "wanted", "code"),
    [(1000.0, None, 4), (800.0, None, 4), (799.0, None, 0), (100.0, None, 2), (15.0, None, 3), (15.0, 400.0, 4)],
)
def test_the_widest_filter_that_folds_nothing_unless_a_wire_wants_another(rate, wanted, code):
    """Up to half the rate; the narrowest where all are wider; the first of two codes for one filter."""
    assert TABLE.code(rate, wanted) == code


def test_a_filter_of_second_order_lets_more_noise_through_than_its_cut_off_says():
    """The integral of 1 / (1 + x^4) from 0 on is pi / (2 sqrt 2)."""
    assert pytest.approx(1.1107, abs=1e-4) == BUTTERWORTH
