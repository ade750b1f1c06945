"""All gates for one recording."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis.quality.gate import Facts, Gate
from hil.analysis.quality.noise import aliased, density, density_agrees, resolved
from hil.analysis.quality.samples import finite, repeated, saturated, stuck
from hil.analysis.quality.temperature import celsius
from hil.analysis.quality.timing import timing
from hil.model.errors import Refused

__all__ = ["judge", "tripped"]


def judge(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return every gate for a recording at rest, those that could not be judged included.

    For the recording: order, gaps, jitter, rate, repeated, aliased. For each channel: finite, stuck, saturated,
    resolved and density; for the temperature finite and celsius only, because a temperature may well stand still.

    Args:
        time: timestamps in s, shape (n,).
        channels: values by name, each of shape (n,).
        facts: what is known of the sensor.

    Raises:
        Refused: a channel that has not as many values as there are timestamps.
    """
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in channels.items()}
    count = np.size(time)
    for name, values in arrays.items():
        if values.shape != (count,):
            raise Refused(f"channel {name} has shape {values.shape}", f"give one value for each of {count} timestamps")
    report, gates = timing(time, facts)
    rates = {name: values for name, values in arrays.items() if name != facts.temperature}
    found = [*gates, repeated(rates)]
    rate = report.rate if report else facts.rate
    if rate is not None:
        found.append(aliased(rate, facts))
    for name, values in rates.items():
        found += [finite(name, values), stuck(name, values), saturated(name, values, facts)]
        found.append(resolved(name, values, facts))
        if rate is not None:
            measured = density(values, rate) if facts.noise_density is not None else float("nan")
            found.append(density_agrees(name, measured, facts))
    if facts.temperature in arrays:
        values = arrays[facts.temperature]
        found += [finite(facts.temperature, values), celsius(facts.temperature, values)]
    return tuple(found)


def tripped(time: ArrayLike, channels: Mapping[str, ArrayLike], facts: Facts) -> tuple[Gate, ...]:
    """Return the gates that a recording does not pass; see `judge`. A gate that lacks a fact is not among them."""
    return tuple(gate for gate in judge(time, channels, facts) if gate.ok is False)
