"""A cell whose cycles are known in closed form, for tests of the analysis of batteries."""

from __future__ import annotations

import numpy as np

CURRENT, LOWER, UPPER, TAU_S, REST_S = 0.7, 2.7, 4.2, 1800.0, 600.0
RESISTANCE = 0.05


def cycle(interval, *, capacity=1.4, share=0.8):
    """One cycle: charge at constant current, then at constant voltage, rest, discharge, rest.

    The voltage is a straight line of the charge; the current under constant voltage falls exponentially, and stops at
    50 mA. Returns time, voltage and current.
    """
    rising = share * capacity * 3600.0 / CURRENT
    falling = TAU_S * np.log(CURRENT / 0.05)
    total = CURRENT * rising + CURRENT * TAU_S * (1.0 - 0.05 / CURRENT)
    draining = total / CURRENT
    ends = np.cumsum([rising, falling, REST_S, draining, REST_S])
    time = np.arange(0.0, ends[-1], interval)
    parts = [time < ends[0], time < ends[1], time < ends[2], time < ends[3]]
    charged = UPPER - CURRENT * RESISTANCE
    voltage = np.select(
        parts,
        [
            3.0 + (UPPER - 3.0) * time / rising,
            UPPER,
            charged,
            charged - RESISTANCE * CURRENT - (charged - RESISTANCE * CURRENT - LOWER) * (time - ends[2]) / draining,
        ],
        3.0 - RESISTANCE * CURRENT,
    )
    current = np.select(parts, [CURRENT, CURRENT * np.exp(-(time - ends[0]) / TAU_S), 0.0, -CURRENT], 0.0)
    return time, voltage, current


def truth(*, capacity=1.4, share=0.8):
    """Return the charge of one direction in Ah, the time to 4.2 V, and the time to 50 mA."""
    rising = share * capacity * 3600.0 / CURRENT
    total = CURRENT * rising + CURRENT * TAU_S * (1.0 - 0.05 / CURRENT)
    return total / 3600.0, rising, rising + TAU_S * np.log(CURRENT / 0.05)


def campaign(count, interval, *, fade=0.0, seed=1, ripple=0.0):
    """Several cycles on end, the capacity of each smaller by `fade`; returns time, voltage, current."""
    rows, start = [], 0.0
    for number in range(count):
        time, voltage, current = cycle(interval, capacity=1.4 * (1.0 - fade * number))
        rows.append((time + start, voltage, current))
        start += float(time[-1]) + interval
    time, voltage, current = (np.concatenate(each) for each in zip(*rows, strict=True))
    noise = np.random.default_rng(seed)
    return time, voltage, current + ripple * noise.standard_normal(time.size)
