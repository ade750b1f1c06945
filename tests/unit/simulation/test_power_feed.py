"""A rail that feeds what other instruments drive: relays let go without it, and so does an amplifier."""

from __future__ import annotations

import pytest
from adcs_bench import bound
from workspaces import ROOT

from hil.bench.file.reading import load_bench
from hil.simulation.plants.power_feed import build
from hil.simulation.truth import Truth, TruthError


@pytest.fixture
def bench():
    """Yield the battery bench."""
    with bound(load_bench(ROOT / "fixtures/benches", "battery", ROOT)) as bench:
        yield bench


def feed(bench, output):
    """Switch a supply on at 12 V."""
    bench.roles[output].configure(12.0, 0.2)
    bench.roles[output].enable()


def test_a_rail_has_what_it_is_given():
    """Up to the limit of current."""
    rail = build("rail", 10**9, Truth({"resistance": "100"}, ()))
    rail.command(given=12.0, limit=1.0)
    assert (rail.observe("voltage"), rail.observe("current")) == pytest.approx((12.0, 0.12))
    rail.command(limit=0.05)
    assert (rail.observe("voltage"), rail.observe("current")) == pytest.approx((5.0, 0.05))


def test_a_truth_that_is_none_is_refused():
    """A rail without resistance would be a short."""
    with pytest.raises(TruthError, match="resistance"):
        build("rail", 10**9, Truth({"resistance": "0"}, ()))


def test_the_tester_needs_its_rail(bench):
    """Without it no contact closes, and one that is closed opens at once; with it again, the coil pulls it again."""
    cell = bench.world.plants["battery"]
    cycler = bench.roles["cycler"]
    cycler.prepare(1)
    cycler.start()
    bench.clock.sleep(1)
    assert not cell.inputs["charge_contact"]
    feed(bench, "supply.apparatus")
    assert cell.inputs["charge_contact"]
    bench.roles["supply.apparatus"].disable()
    assert not cell.inputs["charge_contact"]


def test_the_coolers_need_their_rail(bench):
    """The controller shows its output, and nothing reaches the coolers."""
    cell, thermal = bench.world.plants["battery"], bench.roles["thermal"]
    thermal.hold(40.0)
    bench.clock.sleep(130)
    assert thermal.output().value > 10
    assert cell.inputs["tec"] == 0
    feed(bench, "supply.tec")
    assert cell.inputs["tec"] > 0.1
    bench.roles["supply.tec"].disable()
    assert cell.inputs["tec"] == 0


def test_a_bench_goes_on_as_it_was(bench):
    """What the amplifier is asked for is part of the state: the rail brings it back."""
    bench.roles["thermal"].hold(40.0)
    bench.clock.sleep(130)
    state = bench.world.by_device["tec1"].state()
    bench.roles["thermal"].standby()
    bench.world.by_device["tec1"].restore(state)
    feed(bench, "supply.tec")
    assert bench.world.plants["battery"].inputs["tec"] > 0.1
