"""The noise of a simulated magnetometer: as the truth says it, whoever reads it and when."""

from __future__ import annotations

import numpy as np
import pytest

from hil.model.bench import InstrumentSpec
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.peers.sensors.elements import FieldElement
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

RATE = 80.0
PERIOD_NS = 12_500_000


def element(**truth):
    """Return an element without a plant."""
    setup = PeerSetup(
        instrument=InstrumentSpec(name="mag", driver="any", address=0x1C),
        truth=Truth(truth, ("truth",)),
        connections=Connections({}, {}, set(), ("connects",)),
        seeds=Seeds(3),
    )
    made = FieldElement(setup, noise=(0.32, 0.32, 0.41))
    setup.finish()
    return made


def samples(made, numbers, axis=0, start_ns=0):
    """Return what an axis gives."""
    at = [start_ns + number * PERIOD_NS for number in numbers]
    return np.array(
        [made.measured(axis, n, at_ns, start_ns=start_ns, louder=1.0) for n, at_ns in zip(numbers, at, strict=True)]
    )


def test_white_noise_has_its_density():
    """N times the root of the rate, for there is no filter; the data sheet's noise is not added."""
    made = element(field_noise={"white": ["0.03", "0", "0"]})
    assert samples(made, range(1, 4001)).std() == pytest.approx(0.03 * RATE**0.5, rel=0.04)
    assert not samples(made, range(1, 20), axis=1).any()
    louder = element(field_noise={"white": ["0.03", "0", "0"]}, noise=["1", "0", "0"])
    assert samples(louder, range(1, 4001)).std() == pytest.approx((0.03**2 * RATE + 1) ** 0.5, rel=0.04)
    assert samples(element(), range(1, 4001), axis=2).std() == pytest.approx(0.41, rel=0.04)


def test_a_sample_follows_from_its_number():
    """Later blocks first, a second reader, a peer that was restored in between: the same numbers."""
    levels = {"white": ["0.03"] * 3, "flicker": ["0.1"] * 3, "random_walk": ["0.01"] * 3, "quantisation": ["0.01"] * 3}
    numbers = [20_000, 20_001, 3, 4, 40_000]
    steady = samples(element(field_noise=levels), sorted(numbers))
    jumping = samples(element(field_noise=levels), numbers)
    assert dict(zip(numbers, jumping, strict=True)) == dict(zip(sorted(numbers), steady, strict=True))
    again = samples(element(field_noise=levels), sorted(numbers), start_ns=PERIOD_NS)
    assert not np.isclose(again, steady).any()
