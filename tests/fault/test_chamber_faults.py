"""What goes wrong in the temperature chamber is found by its fixture, and a healthy one is left alone."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest
from chamber_bench import ChamberBench

from hil.model.errors import Implausible

FIXTURE = Path(__file__).parents[2] / "fixtures" / "chamber.py"
SOAK_S, WITHIN_S = 300.0, 3600.0


def fixture_module():
    """Return the workspace's fixture module."""
    spec = importlib.util.spec_from_file_location("chamber_fixture", FIXTURE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


MODULE = fixture_module()


def chamber_of(bench):
    """Return the fixture's object on a simulated bench."""
    return MODULE.Chamber("tec", bench.thermal, bench.relays, bench.clock)


def die_of(bench, offset=0.4):
    """Return what reads the die's temperature with an error of its own, as a gyroscope does."""
    return lambda: bench.plant.observe("die") + offset


def faulty(device, *kinds, **more):
    """Return faults of one device from the beginning."""
    return {device: [{"kind": kind, **more} for kind in kinds]}


def soaked(bench, target, *, own=True):
    """Hold and soak; return what soak returns."""
    chamber = chamber_of(bench)
    chamber.hold(target)
    return chamber.soak(SOAK_S, within=WITHIN_S, own=die_of(bench) if own else None)


def test_a_whole_campaign_on_a_healthy_bench():
    """All four temperatures one after the other, each within the hour, plate and die where they should be."""
    bench = ChamberBench(truths={"tec": {"sensor_offset": "0.2"}})
    chamber = chamber_of(bench)
    for target in (-16.0, 10.0, 25.0, 40.0, -16.0):
        before = bench.clock.now()
        chamber.hold(target)
        own = chamber.soak(SOAK_S, within=WITHIN_S, own=die_of(bench))
        assert abs(bench.plant.observe("plate") - target) < 0.8
        assert abs(own - target) < (4.0 if target > 32 else 2.0)
        assert bench.clock.now() - before < 2400
        assert bench.plant.inputs["lamp"] is (target > 32)
    chamber.must_be_well()


def test_without_the_device_the_plate_alone_counts():
    """Whoever has no device to ask still gets the plate."""
    assert soaked(ChamberBench(), 10.0, own=False) == pytest.approx(10.0, abs=0.5)


@pytest.mark.parametrize("target", [-16.0, 10.0, 25.0, 40.0])
@pytest.mark.parametrize("kind", ["stuck", "runaway", "sensor-open", "sensor-detached"])
def test_every_fault_of_the_controller_at_every_temperature(kind, target):
    """Found within minutes, before the board is hot, and named as a fault of the controller."""
    bench = ChamberBench(faults=faulty("tec", kind))
    with pytest.raises(Implausible, match="tec: "):
        soaked(bench, target)
    assert bench.clock.now() < 2400
    assert bench.plant.observe("plate") < 75
    assert bench.plant.observe("die") < 60


@pytest.mark.parametrize("kind", ["stuck", "runaway", "sensor-open", "sensor-detached"])
def test_a_fault_that_comes_while_it_soaks(kind):
    """Ten minutes after the hold everything seemed well."""
    bench = ChamberBench(faults={"tec": [{"kind": kind, "from": "600 s"}]})
    with pytest.raises(Implausible):
        soaked(bench, -16.0)
    assert 600 < bench.clock.now() < 1800


@pytest.mark.parametrize("target", [-16.0, 10.0, 25.0])
def test_a_lamp_that_is_welded_on(target):
    """The relay reads open; the cooler cannot reach the cold end, and elsewhere the board is warmer than its plate."""
    bench = ChamberBench(faults={"relays": [{"kind": "welded", "contact": "3"}]})
    chamber = chamber_of(bench)
    chamber.hold(40.0)
    bench.clock.sleep(60)
    chamber.hold(target)
    assert bench.relays.closed() == ()
    assert bench.plant.inputs["lamp"] is True
    with pytest.raises(Implausible, match="settled at|stays at"):
        chamber.soak(SOAK_S, within=WITHIN_S, own=die_of(bench))


def test_a_welded_lamp_shows_in_temperatures_only():
    """Two benches, one command each: relay and controller read the same, the board does not."""
    well, welded = ChamberBench(), ChamberBench(truths={"relays": {"welded": ["3"]}})
    for bench in (well, welded):
        bench.thermal.hold(25.0)
        bench.relays.open("lamp")
        bench.clock.sleep(1800)
    assert well.relays.closed() == welded.relays.closed() == ()
    assert well.board.outlets() == welded.board.outlets()
    assert well.thermal.temperature().value == pytest.approx(welded.thermal.temperature().value, abs=0.11)
    assert welded.plant.observe("die") - well.plant.observe("die") > 2


def test_a_fault_is_never_forgotten():
    """A case that lets it through is told again at every turn, and at its end."""
    chamber = chamber_of(ChamberBench(faults=faulty("tec", "runaway")))
    chamber.hold(-16.0)
    with pytest.raises(Implausible) as first:
        chamber.soak(SOAK_S, within=WITHIN_S)
    for again in (lambda: chamber.hold(25.0), lambda: chamber.soak(1.0, within=1.0), chamber.must_be_well):
        with pytest.raises(Implausible, match="goes away from -16") as later:
            again()
        assert later.value is first.value


def test_what_takes_too_long_is_told():
    """A soak that cannot fit its limit ends there."""
    bench = ChamberBench()
    chamber = chamber_of(bench)
    chamber.hold(-16.0)
    with pytest.raises(Implausible, match="after 200 s, and not all has settled"):
        chamber.soak(SOAK_S, within=200.0)
    assert bench.clock.now() < 230
