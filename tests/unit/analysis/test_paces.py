"""Rows that hold a reading of their own: found where a sensor is slower, and not invented where readings repeat."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.paces import own_rows

ROWS = 6000
READ = np.random.default_rng(3).standard_normal((ROWS, 3)).round(3)


def held(rows):
    """Return what a log has that repeats the last reading, and the rows in which there is a new one."""
    new = np.unique(np.asarray(rows, dtype=int))
    return READ[new[np.searchsorted(new, np.arange(ROWS), side="right") - 1]], new


@pytest.mark.parametrize("every", [1.25, 4 / 3, 2.0, 2.5, 6.7, 10.0, 100.0])
def test_readings_of_a_slower_sensor_are_found(every):
    """Held, or with rows that have none; also where the rates are no multiples of each other."""
    values, new = held(np.arange(0, ROWS, every))
    assert own_rows(values).tolist() == new.tolist()
    sparse = np.full((ROWS, 3), np.nan)
    sparse[new] = READ[new]
    assert own_rows(sparse).tolist() == new.tolist()


def test_jitter_and_lost_readings_do_not_hide_the_pace():
    """A tenth of the readings is lost, and the others come a row too early or too late."""
    generator = np.random.default_rng(5)
    rows = np.arange(0, ROWS, 10) + generator.integers(-1, 2, 600)
    values, new = held(np.concatenate(([0], rows[1:][generator.random(599) > 0.1])))
    assert own_rows(values).tolist() == new.tolist()


def test_a_sensor_that_hangs_keeps_its_readings():
    """One in as many rows as usual, so that the gate `stuck` sees them."""
    values, new = held([row for row in range(0, ROWS, 10) if not 2000 < row < 4000])
    found = own_rows(values)
    assert np.diff(found).tolist() == [10] * (ROWS // 10 - 1)
    assert set(new.tolist()) <= set(found.tolist())


@pytest.mark.parametrize("step", [0.5, 1.0, 2.0, 3.0])
def test_readings_that_repeat_by_chance_are_all_its_own(step):
    """Coarse counts: the share of rows that repeat is that of a slower sensor, their lengths are not."""
    assert own_rows(np.round(READ / step) * step) is None


def test_rows_that_lack_a_number_now_and_then_are_no_pace():
    """One row in ten is missing; it is another sensor's only if the log has rows of others."""
    values = READ.copy()
    values[::10] = np.nan
    assert own_rows(values) is None
    assert own_rows(values, apart=True).tolist() == [row for row in range(ROWS) if row % 10]
    assert own_rows(READ, apart=True) is None
    assert own_rows(READ[:1].repeat(ROWS, axis=0)) is None
    assert own_rows(READ[:30]) is None
