"""Flight logs whose phases are known: a rigid body in the earth's field, integrated turn by turn."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

__all__ = ["BIAS", "FIELD", "made", "turning"]

BIAS = np.array([0.31, -0.22, 0.05])
"""Of the gyroscope, in deg/s."""
FIELD = np.array([18.0, -4.0, 43.0])
"""Of the earth, in the body's axes as the log begins, in uT."""


def turning(seconds, rate, axis=(0.0, 0.0, 0.0)):
    """Return rates (n, 3) in deg/s of a part of a flight that turns about one axis."""
    return np.tile(np.asarray(axis, dtype=float), (round(seconds * rate), 1))


def made(parts, rate=10.0, *, seed=0, noise=0.05, field_noise=0.3, iron=(0.0, 0.0, 0.0)):
    """Return what gyroscope and magnetometer read, (n, 3) each, in deg/s and uT.

    Args:
        parts: true rates in deg/s, one after the other.
        rate: samples per second.
        seed: of the noise.
        noise, field_noise: standard deviations of a sample.
        iron: field of the body itself, in uT.
    """
    generator = np.random.default_rng(seed)
    true = np.concatenate(parts)
    attitude, field = np.eye(3), []
    for step in Rotation.from_rotvec(np.radians(true) / rate).as_matrix():
        field.append(FIELD @ attitude)  # by the inverse, which of a rotation is the transpose
        attitude = attitude @ step
    rates = true + BIAS + noise * generator.standard_normal(true.shape)
    return rates, np.array(field) + np.asarray(iron) + field_noise * generator.standard_normal(true.shape)
