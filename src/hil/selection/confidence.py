"""The probability that one of several is the smallest, by quadrature over their distributions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["Known", "best"]

_Array: TypeAlias = NDArray[np.float64]

_SCORES = np.linspace(-6.5, 6.5, 261)
"""Where a distribution is sampled, in standard normal scores: 1e-10 of it lies outside."""
_EXACT = 1e-9  # of a value: the uncertainty assumed for a figure without one
_LARGEST_DOF = 1e6  # degrees of freedom beyond which Student's distribution is taken as normal


class Known(NamedTuple):
    """What is known of one number: its value, standard uncertainty and degrees of freedom."""

    value: float
    uncertainty: float
    dof: float


def best(scores: Sequence[Sequence[Known]]) -> list[float]:
    """Return the probability of each of several scores to be the smallest; they add up to 1.

    A score is the largest magnitude among its numbers, of which each is known as v + u t, with t of Student's
    distribution (GUM G.3); all numbers are taken as independent. With F the distribution of a score, the product of
    those of its magnitudes, P_i = integral of prod_{j != i} (1 - F_j) dF_i, by the trapezoidal rule over the quantiles
    of all numbers. No random numbers are drawn, so that the same figures give the same probabilities.

    Args:
        scores: the numbers of each, in one unit; none of them empty.
    """
    if len(scores) == 1:
        return [1.0]
    numbers = [_spread(each) for score in scores for each in score]
    grid = np.unique(np.abs(np.concatenate([_quantiles(each) for each in numbers])))
    below = np.array([np.prod([_below(_spread(each), grid) for each in score], axis=0) for score in scores])
    above = 1.0 - below
    shares = []
    for place, own in enumerate(below):
        others = np.prod(np.delete(above, place, axis=0), axis=0)
        steps = np.diff(own, prepend=0.0)
        beside = np.concatenate([others[:1], (others[1:] + others[:-1]) / 2.0])
        shares.append(math.fsum(steps * beside))
    total = math.fsum(shares)
    return [share / total for share in shares]


def _spread(known: Known) -> Known:
    """Return a number with an uncertainty above zero, tiny for an exact number."""
    least = max(abs(known.value) * _EXACT, 1e-300)
    return Known(known.value, max(known.uncertainty, least), min(known.dof, _LARGEST_DOF))


def _quantiles(known: Known) -> _Array:
    from scipy import special  # noqa: PLC0415 - start-up stays light

    scores = np.asarray(special.stdtrit(known.dof, special.ndtr(_SCORES)), dtype=np.float64)
    return known.value + known.uncertainty * scores


def _below(known: Known, grid: _Array) -> _Array:
    """Return the probability that the magnitude of a number is below each of some magnitudes."""
    from scipy import special  # noqa: PLC0415 - start-up stays light

    upper = special.stdtr(known.dof, (grid - known.value) / known.uncertainty)
    lower = special.stdtr(known.dof, (-grid - known.value) / known.uncertainty)
    return np.asarray(upper - lower, dtype=np.float64)
