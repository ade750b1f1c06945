"""Whatever is observed, and when, a plant's trajectory stays bit-identical."""

from __future__ import annotations

import json

import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from twin import COIL, Charging

from hil.simulation.plants.coil import build
from hil.simulation.truth import Truth

GRID_NS = 10_000_000
INSTANTS = st.integers(min_value=0, max_value=40 * GRID_NS)
COMMANDS = st.one_of(
    st.fixed_dictionaries({"supply_voltage": st.floats(0, 6), "supply_current": st.floats(0, 1)}),
    st.fixed_dictionaries({"contact_a": st.booleans(), "contact_b": st.booleans()}),
    st.fixed_dictionaries({"board": st.sampled_from(["", "x_plus", "y_plus"])}),
)
SCHEDULES = st.lists(st.tuples(INSTANTS, COMMANDS), max_size=8).map(lambda rows: sorted(rows, key=lambda row: row[0]))
SIGNALS = ("winding_current", "temperature", "voltage", "field.z")


def coil():
    """Return a plant whose currents and temperatures move within the schedule."""
    truth = {**COIL, "resistance": "4", "inductance": "0.05", "heat_capacity": "0.05", "thermal_resistance": "20"}
    return build("coil", GRID_NS, Truth(truth, ("truth",)))


def run(plant, schedule, looks=(), end_ns=45 * GRID_NS):
    """Let a plant follow its commands while somebody looks at these instants; return its state."""
    events = sorted([(at, 1, values) for at, values in schedule] + [(at, 0, None) for at in looks], key=lambda e: e[:2])
    for at_ns, _, values in events:
        plant.advance(at_ns)
        if values is None:
            for signal in SIGNALS:
                plant.observe(signal)
                plant.observe_at(signal, max(0, at_ns - 3 * GRID_NS // 2))
        else:
            plant.command(**values)
    plant.advance(end_ns)
    return json.dumps(plant.state())


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(schedule=SCHEDULES, looks=st.lists(INSTANTS, max_size=20))
def test_observing_changes_nothing(schedule, looks):
    """Any pattern of observations leaves every break point bit-identical."""
    assert run(coil(), schedule, looks) == run(coil(), schedule)


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(schedule=SCHEDULES, pause_ns=INSTANTS, looks=st.lists(INSTANTS, max_size=5))
def test_restored_in_the_middle_it_goes_on(schedule, pause_ns, looks):
    """A plant saved and restored through JSON at any instant ends in the same bits."""
    plant = coil()
    before = [row for row in schedule if row[0] <= pause_ns]
    run(plant, before, [at for at in looks if at <= pause_ns], end_ns=pause_ns)
    other = coil()
    other.restore(json.loads(json.dumps(plant.state())))
    after = [row for row in schedule if row[0] > pause_ns]
    assert run(other, after) == run(coil(), schedule)


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(schedule=SCHEDULES, at_ns=st.integers(1, 40 * GRID_NS), late_ns=st.integers(0, 3 * GRID_NS))
def test_an_instant_looks_the_same_later(schedule, at_ns, late_ns):
    """What a sensor's conversion saw does not depend on when it is read."""
    early, later = coil(), coil()
    run(early, [row for row in schedule if row[0] < at_ns], end_ns=at_ns)
    run(later, [row for row in schedule if row[0] <= at_ns + late_ns], end_ns=at_ns + late_ns)
    assert [early.observe_at(name, at_ns) for name in SIGNALS] == [later.observe_at(name, at_ns) for name in SIGNALS]


@settings(max_examples=sweeps.examples(40), derandomize=True)
@given(steps=st.lists(st.integers(1, 3 * GRID_NS), min_size=1, max_size=30))
def test_advancing_in_any_pieces_is_the_same(steps):
    """However time comes along, the plant ends in the same bits."""
    pieces, whole = Charging(GRID_NS), Charging(GRID_NS)
    for plant in (pieces, whole):
        plant.command(drive=1.0)
    for end in range(len(steps)):
        pieces.advance(sum(steps[: end + 1]))
    whole.advance(sum(steps))
    assert pieces.observe("level") == whole.observe("level")
