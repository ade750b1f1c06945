"""The polarity that the magnetorquer case finds, over many seeds, for both hand conventions of the truth."""

from __future__ import annotations

import importlib.util
import sys
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import sweeps
from adcs_bench import adcs
from magnetorquer_runs import BOARDS, ROOT

from hil.analysis import magnetics
from hil.bench.binding import bind_simulated
from hil.clock.port import NANOSECONDS
from hil.plugin.plans.markers import MARKERS
from hil.wire.transcript import Transcript

pytestmark = pytest.mark.system  # each seed is a whole campaign's data

SEEDS = sweeps.chosen(16, 200)
SHORTER = SimpleNamespace(current=0.016, phase=0.25, rate=40.0, repetitions=2)
WHOLE = SimpleNamespace(current=0.016, phase=1.0, rate=40.0, repetitions=4)


def loaded(monkeypatch, name, path):
    """Load a file of the workspace as the executive does: by its path."""
    spec = importlib.util.spec_from_file_location(name, ROOT / path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def case(monkeypatch, request):
    """The case's own functions; its markers are the executive's, which is not at work here."""
    for marker in MARKERS:
        request.config.addinivalue_line("markers", marker)
    return loaded(monkeypatch, "polarity_case", "testplans/magnetorquer/test_polarity.py")


@pytest.fixture
def driver(monkeypatch):
    """The workspace's own coil driver."""
    return loaded(monkeypatch, "polarity_coil", "fixtures/coil.py").CoilDriver


class Taken(dict):
    """A recording as the case sees it, of one role sampled on its grid."""

    def __init__(self, role, clock, duration, rate):
        start_ns, times, samples = clock.now_ns(), [], []
        for index in range(round(duration * rate)):
            clock.wait_until(start_ns + round(index * NANOSECONDS / rate))
            samples.append(role.sample())
            times.append(clock.now())
        names = [channel.name for channel in role.channels()]
        super().__init__(zip(names, np.transpose(samples), strict=True))
        self.time = np.array(times)

    def unit(self, channel):
        """Return the channel's unit."""
        return {"temperature": "degC"}.get(channel, "uT")


def bench(seed, winding):
    """Return the ADCS bench of one seed: its noise, its board, and a field of the Earth from any side."""
    spec = adcs()
    side = np.random.default_rng(seed).standard_normal(3)
    earth = [f"{part:.3f}" for part in 45 * side / np.linalg.norm(side)]
    plant = spec.simulated.plants[0]
    truth = {**plant.truth, "winding": winding, "earth_field": earth, "attached": BOARDS[seed % len(BOARDS)]}
    twin = replace(spec.simulated, seed=seed, plants=(replace(plant, truth=truth),))
    return bind_simulated(replace(spec, simulated=twin), Transcript(None))


def found(seed, winding, case, driver, parameters):
    """Measure the direction as the case does, on the bench of this seed."""
    bound = bench(seed, winding)
    try:
        sensor, field = bound.roles["supply.sensor"], bound.roles["magnetometer"]
        sensor.configure(3.3, 0.02)
        sensor.enable()
        bound.clock.sleep(0.1)
        field.start()
        coil = driver(bound.roles["supply.coil"], bound.roles["relays"], bound.clock)

        def record(_name, role, *, duration, rate):
            return Taken(role, bound.clock, duration, rate)

        repetitions = [
            case.three_phases(
                coil,
                field,
                record,
                lambda _title: nullcontext(),
                parameters.current,
                duration=parameters.phase,
                rate=parameters.rate,
            )[0]
            for _ in range(parameters.repetitions)
        ]
        return magnetics.direction(case.response_of(repetitions), case.OUTWARD_NORMAL, alignment=1.5)
    finally:
        bound.close()


@pytest.mark.parametrize("chunk", range(4))
@pytest.mark.parametrize(("winding", "sense"), [("right", 1), ("left", -1)])
def test_the_polarity_is_right_for_every_seed(case, driver, winding, sense, chunk):
    """Noise, board and the Earth's field differ with the seed; the sense found is the true one every time.

    Two repetitions of a quarter of the plan's phases: less data than the case takes.
    """
    seeds = range(chunk * SEEDS // 4, (chunk + 1) * SEEDS // 4)
    directions = {seed: found(seed, winding, case, driver, SHORTER) for seed in seeds}
    assert {seed: one.sense.value for seed, one in directions.items() if one.sense.value != sense} == {}
    assert min(one.significance.value for one in directions.values()) > 5


@pytest.mark.parametrize(("winding", "sense"), [("right", 1), ("left", -1)])
def test_the_whole_case_sees_it_far_beyond_doubt(case, driver, winding, sense):
    """With the plan's own phases the significance is a hundred at least, and the angle is the jig's."""
    for seed in sweeps.sample((0, 1, 2), 1):
        direction = found(seed, winding, case, driver, WHOLE)
        assert direction.sense.value == sense
        assert direction.significance.value > 100
        assert abs(direction.angle.value - (0 if sense > 0 else 180)) < 5
