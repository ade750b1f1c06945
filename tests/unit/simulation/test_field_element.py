"""The noise of a simulated magnetometer: as the truth says it, whoever reads it and when."""

from __future__ import annotations

import numpy as np
import pytest

from hil.model.bench import InstrumentSpec
from hil.simulation.faults import Drifting, read_faults
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.peers.sensors.elements import AxesElement, FieldElement
from hil.simulation.plants.thermal_chamber import ChamberTruth, ThermalChamber
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

RATE = 80.0
PERIOD_NS = 12_500_000


def setup_of(truth, connects=None, faults=()):
    """Return what an element is made from, beside a chamber in which everything is at 22 degC."""
    chamber = ThermalChamber("chamber", 10**9, ChamberTruth())
    return PeerSetup(
        instrument=InstrumentSpec(name="mag", driver="any", address=0x1C),
        truth=Truth(truth, ("truth",)),
        connections=Connections(connects or {}, {"chamber": chamber}, set(), ("connects",)),
        faults=read_faults(faults, (), (Drifting,)),
        seeds=Seeds(3),
    )


def element(connects=None, **truth):
    """Return an element of a magnetometer."""
    setup = setup_of(truth, connects)
    made = FieldElement(setup, noise=(0.32, 0.32, 0.41))
    setup.finish()
    return made


def samples(made, numbers, axis=0, start_ns=0):
    """Return what an axis gives."""
    at = [start_ns + number * PERIOD_NS for number in numbers]
    return np.array([made.measured(n, at_ns, start_ns=start_ns)[axis] for n, at_ns in zip(numbers, at, strict=True)])


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


@pytest.mark.parametrize("terminal", ["element", "temperature"])
def test_the_offset_follows_the_temperature_of_the_element(terminal):
    """That of the chip's thermometer where nothing else is connected."""
    made = element({terminal: "chamber.die"}, offset=["1", "2", "3"], drift=["0.5", "-1", "0"], noise=["0"] * 3)
    read = made.measured(1, 0, start_ns=-PERIOD_NS)
    assert read == pytest.approx([1 + 0.5 * (22 - 25), 2 - (22 - 25), 3])


def test_axes_follow_the_temperature_of_the_element():
    """Not that of the thermometer, if another point is connected."""
    truth = {"bias_x": ["1", "0.1", "0"], "white": ["0"] * 3, "flicker": ["0"] * 3, "random_walk": ["0"] * 3}
    ends, degrees = np.array([0]), np.array([35.0])
    for connects, felt in (({}, 35.0), ({"element": "chamber.die"}, 22.0)):
        setup = setup_of(truth, connects)
        made = AxesElement(setup)
        setup.finish()
        assert made.measured(1, ends, degrees)[0, 0] == pytest.approx(1 + 0.1 * (felt - 25))


def test_a_drift_that_grows_counts_from_25_degrees():
    """It adds to what the truth says, of rates and fields, while it holds."""
    faults, second = [{"kind": "drifting", "drift": "0.2", "from": "1 s", "until": "2 s"}], 10**9
    ends, degrees = np.array([0, second, 2 * second]), np.array([35.0, 35.0, 35.0])
    truth = {"bias_x": ["1", "0.1", "0"], "white": ["0"] * 3, "flicker": ["0"] * 3, "random_walk": ["0"] * 3}
    setup = setup_of(truth, faults=faults)
    rates = AxesElement(setup)
    setup.finish()
    assert rates.measured(1, ends, degrees) == pytest.approx(np.array([[2, 4, 2], [0, 2, 0], [0, 2, 0]]))
    for given, expected in (([], [-1.5, 0.0]), ([{"kind": "drifting", "drift": "0.2"}], [-2.1, -0.6])):
        setup = setup_of({"drift": ["0.5", "0", "0"], "noise": ["0"] * 3}, {"element": "chamber.die"}, given)
        field = FieldElement(setup, noise=(0.0, 0.0, 0.0))
        setup.finish()
        read = field.measured(1, 0, start_ns=-PERIOD_NS)
        assert read[:2] == pytest.approx(expected)
