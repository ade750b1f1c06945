"""Whatever is connected to the battery, currents add up, limits hold, and looking changes nothing."""

from __future__ import annotations

import json

import pytest
import sweeps
from battery_cycles import SECOND_NS, battery
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.simulation.plants.battery.network import Network

INSTANTS = st.integers(min_value=0, max_value=200 * SECOND_NS)
COMMANDS = st.one_of(
    st.fixed_dictionaries({"supply_voltage": st.floats(0, 6), "supply_current": st.floats(0, 2)}),
    st.fixed_dictionaries({"charge_contact": st.booleans(), "discharge_contact": st.booleans()}),
    st.fixed_dictionaries({"load_current": st.floats(0, 2), "load_resistance": st.floats(0, 50)}),
    st.fixed_dictionaries({"tec": st.floats(-1, 1), "place": st.sampled_from(["container", "assembly"])}),
    st.fixed_dictionaries({"fuse": st.sampled_from(["fitted", "open"])}),
)
SCHEDULES = st.lists(st.tuples(INSTANTS, COMMANDS), max_size=10).map(lambda rows: sorted(rows, key=lambda row: row[0]))


def lived(plant, schedule, looks=(), begin_ns=0, end_ns=250 * SECOND_NS):
    """Let a plant follow its commands from an instant on while somebody looks; return its state."""
    events = [(at, 1, values) for at, values in schedule] + [(at, 0, None) for at in looks]
    for at_ns, _, values in sorted(events, key=lambda event: event[:2]):
        if at_ns < begin_ns:
            continue
        plant.advance(at_ns)
        if values is None:
            for signal in ("voltage", "current", "ntc", "supply.voltage"):
                plant.observe(signal)
                plant.observe_at(signal, max(0, at_ns - SECOND_NS))
        else:
            plant.command(**values)
    plant.advance(end_ns)
    return json.dumps(plant.state())


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(schedule=SCHEDULES, looks=st.lists(INSTANTS, max_size=15))
def test_observing_changes_nothing(schedule, looks):
    """Any pattern of observations leaves every break point bit-identical."""
    assert lived(battery(charge="0.5"), schedule, looks) == lived(battery(charge="0.5"), schedule)


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(schedule=SCHEDULES, pause_ns=INSTANTS)
def test_restored_in_the_middle_it_goes_on(schedule, pause_ns):
    """A plant saved and restored through JSON at any instant ends in the same bits."""
    plant, other = battery(charge="0.5"), battery(charge="0.5")
    lived(plant, [row for row in schedule if row[0] <= pause_ns], end_ns=pause_ns)
    other.restore(json.loads(json.dumps(plant.state())))
    assert lived(other, schedule, begin_ns=pause_ns + 1) == lived(battery(charge="0.5"), schedule)


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(
    volts=st.floats(0, 6),
    limit=st.floats(0, 3),
    path=st.floats(0.001, 1),
    load=st.floats(0, 3),
    siemens=st.floats(0, 2),
    base=st.floats(0.1, 5),
    ohms=st.floats(0.01, 2),
)
def test_the_network_keeps_its_laws(volts, limit, path, load, siemens, base, ohms):
    """Kirchhoff's and Ohm's laws hold at the terminals, and the supply is in its limit, in its voltage, or blocked."""
    network = Network(volts=volts, limit=limit, path=path, load=load, siemens=siemens)
    supply, terminals, current = network.solver()(base, ohms)
    drawn = supply - current - siemens * terminals
    assert terminals == pytest.approx(base + ohms * current, abs=1e-9)
    assert terminals >= -1e-9
    assert -1e-9 <= drawn <= load + 1e-9
    assert 0 <= supply <= limit
    if drawn < load - 1e-9:
        assert terminals == pytest.approx(0, abs=1e-9)
    elif 0 < supply < limit:
        assert terminals + path * supply == pytest.approx(volts, abs=1e-9)
    elif supply == 0 and limit > 0:
        assert terminals >= volts - 1e-9
