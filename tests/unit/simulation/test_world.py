"""The world: built from a bench file's words, restored bit by bit, the same every time."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from twin import COIL, INSTRUMENTS, Twin, twin_spec

from hil.clock.virtual import VirtualClock
from hil.model.bench import PeerSpec, PlantSpec
from hil.simulation.registry import PEERS, PLANTS, offered
from hil.simulation.truth import TruthError
from hil.simulation.world import build_world, truth_errors


def exercise(twin) -> list[object]:
    """Do a bit of everything and return all that was seen."""
    seen: list[object] = [twin.scpi("*IDN?"), twin.world.person.answer("attach", "outer_board", "y_plus", ("y_plus",))]
    twin.wake_sensor()
    twin.scpi("VOLT 5,(@2);CURR 0.016,(@2);:OUTP ON,(@2)")
    seen += observe(twin)
    return seen


def observe(twin) -> list[object]:
    """Return readings of all devices over a second."""
    seen: list[object] = []
    for frame in ("01 05 00 00 55 00 F2 9A", "01 05 00 01 FF 00 DD FA"):
        seen += [twin.modbus(frame), twin.scpi("MEAS:CURR? (@2)"), twin.scpi("MEAS:VOLT? (@1:3)")]
        twin.clock.sleep(0.137)
        seen += [twin.field(), twin.burst(0xA7, 1), twin.clock.now_ns()]
    return seen


def test_same_seed_same_bytes():
    """Two worlds of one seed agree in every byte, another seed differs."""
    assert exercise(Twin()) == exercise(Twin())
    assert exercise(Twin()) != exercise(Twin(seed=8))


def test_restored_world_goes_on_bit_by_bit():
    """A fresh world given the state as JSON shows the same as the one that went on."""
    twin = Twin()
    exercise(twin)
    state = json.loads(json.dumps(twin.world.state()))
    other = Twin()
    other.clock.wait_until(twin.clock.now_ns())
    other.world.restore(state)
    assert json.dumps(other.world.state()) == json.dumps(state)
    assert observe(other) == observe(twin)


@pytest.mark.parametrize("after_ms", [0, 1, 3, 5, 8, 11, 14])
def test_restored_in_the_middle_of_requests(after_ms):
    """Half a line, a frame before its silence, and a contact on its way are part of the state."""
    twin = Twin()
    twin.wake_sensor()
    twin.lines["psu"].write(b"CURR 0.2,(@3)\nVOLT 3,(@3);:OUTP ON,(@3)\nVOLT? (@3)\n*ID")
    twin.lines["relays"].write(bytes.fromhex("01050000FF008C3A"))
    twin.clock.sleep(after_ms / 1000)
    before = {name: line.read(line.waiting(), 0) for name, line in twin.lines.items()}
    other = Twin()
    other.clock.wait_until(twin.clock.now_ns())
    other.world.restore(json.loads(json.dumps(twin.world.state())))
    for item in (twin, other):
        item.clock.sleep(0.05)
    assert other.coil.inputs["contact_a"] is True
    # A byte that was on the line when the state was taken belongs to the line, here to nobody.
    if after_ms in {0, 1, 3}:
        assert before == {"psu": b"", "relays": b""}
        assert [other.exchange(name, b"") for name in other.lines] == [twin.exchange(name, b"") for name in twin.lines]
    assert other.scpi("N?") == twin.scpi("N?") != ""
    assert other.world.state() == twin.world.state()


def test_restored_protection_still_trips():
    """A supply restored while a protection watches switches off by itself, as the one that went on."""
    twin = Twin()
    twin.scpi("CURR:PROT:STAT ON,(@2);:VOLT 5,(@2);:CURR 0.016,(@2);:OUTP ON,(@2)")
    twin.coil.command(board="y_plus")
    other = Twin()
    other.clock.wait_until(twin.clock.now_ns())
    other.world.restore(json.loads(json.dumps(twin.world.state())))
    assert other.coil.observe("voltage") == 5.0
    other.clock.sleep(0.03)
    assert other.coil.observe("voltage") == 0.0


def test_state_belongs_to_its_instant():
    """A state of another instant is refused."""
    twin = Twin()
    state = twin.world.state()
    twin.clock.sleep(1)
    with pytest.raises(ValueError, match="the clock is at"):
        twin.world.restore(state)


def errors(**changes):
    """Return path and message of everything wrong in a description with changes."""
    spec = twin_spec(
        **{key: value for key, value in changes.items() if key in {"truths", "faults", "connects", "coil"}}
    )
    spec = replace(spec, **{key: value for key, value in changes.items() if key in {"plants", "peers"}})
    return [(error.path, error.message) for error in truth_errors(spec, INSTRUMENTS)]


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        ({"coil": {"turms": "60"}}, ("plants", "coil", "truth", "turms"), "did you mean 'turns'"),
        ({"coil": {"turns": "many"}}, ("plants", "coil", "truth", "turns"), "must be a whole number"),
        ({"truths": {"psu": {"sereal": "X"}}}, ("peers", "psu", "truth", "sereal"), "did you mean 'serial'"),
        ({"truths": {"psu": {"channels": {"4": {}}}}}, ("peers", "psu", "truth", "channels"), "unknown channel '4'"),
        ({"truths": {"mag": {"noise": ["1"]}}}, ("peers", "mag", "truth", "noise"), "a list of 3 numbers"),
        ({"truths": {"relays": {"address": "0"}}}, ("peers", "relays", "truth", "address"), "must be at least 1"),
        ({"connects": {"psu": {"2": "coil.suply"}}}, ("peers", "psu", "connects", "2"), "did you mean 'supply'"),
        ({"connects": {"psu": {"2": "cool.supply"}}}, ("peers", "psu", "connects", "2"), "did you mean 'coil'"),
        ({"connects": {"psu": {"9": "coil.supply"}}}, ("peers", "psu", "connects", "9"), "unknown terminal '9'"),
        (
            {"connects": {"psu": {"1": "coil.supply", "2": "coil.supply"}}},
            ("peers", "psu", "connects", "2"),
            "driven by another terminal",
        ),
        (
            {"connects": {"relays": {"1": "coil.voltage"}}},
            ("peers", "relays", "connects", "1"),
            "has no input 'voltage'",
        ),
        ({"connects": {"mag": {"field": "coil.feeld"}}}, ("peers", "mag", "connects", "field"), "did you mean 'field'"),
        ({"connects": {"mag": {"power": "coil.power"}}}, ("peers", "mag", "connects", "power"), "has no signal"),
        ({"faults": {"psu": [{"kind": "deed"}]}}, ("peers", "psu", "faults", 0, "kind"), "did you mean 'dead'"),
        ({"faults": {"psu": [{"kind": "stuck"}]}}, ("peers", "psu", "faults", 0, "kind"), "unknown fault 'stuck'"),
        ({"faults": {"psu": [{"kind": "late"}]}}, ("peers", "psu", "faults", 0), "'by' is missing"),
        ({"faults": {"psu": [{"kind": "dead", "form": "1 s"}]}}, ("peers", "psu", "faults", 0, "form"), "mean 'from'"),
        ({"faults": {"psu": [{"kind": "dead", "from": "1"}]}}, ("peers", "psu", "faults", 0, "from"), "a duration"),
        (
            {"faults": {"psu": [{"kind": "chatty", "every": "0 s"}]}},
            ("peers", "psu", "faults", 0, "every"),
            "longer than zero",
        ),
        (
            {"faults": {"mag": [{"kind": "identity", "value": "x"}]}},
            ("peers", "mag", "faults", 0, "value"),
            "must be a hexadecimal number such as 0x3C",
        ),
        ({"peers": (PeerSpec(device="psv", model=""),)}, ("peers", "psv"), "did you mean 'psu'"),
        ({"peers": (PeerSpec(device="psu", model="lis3mdl"),)}, ("peers", "psu", "model"), "hangs on a bus"),
        ({"peers": (PeerSpec(device="psu", model="lis3mdx"),)}, ("peers", "psu", "model"), "did you mean 'lis3mdl'"),
        (
            {"plants": (PlantSpec(name="coil", model="coil", grid_s=0.01),), "peers": ()},
            ("plants", "coil", "model"),
            "unknown plant model 'coil'",
        ),
        (
            {"plants": (PlantSpec(name="coil", model="coil-and-earth-field", grid_s=0.0, truth=COIL),), "peers": ()},
            ("plants", "coil", "grid"),
            "must be at least 1 ns",
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_place(changes, path, message):
    """Keys, values, terminals, faults and models that do not exist come with path and suggestion."""
    found = errors(**changes)
    assert found[0][0] == path
    assert message in found[0][1]


def test_all_errors_of_all_sections_come_together():
    """One wrong section does not hide the next; building raises the first."""
    changes = {"truths": {"psu": {"a": "1"}, "mag": {"b": "1"}}}
    assert [path[1] for path, _ in errors(**changes)] == ["psu", "mag"]
    with pytest.raises(TruthError, match="unknown key 'a'"):
        build_world(twin_spec(**changes), INSTRUMENTS, VirtualClock())


def test_address_that_the_sensor_cannot_have():
    """The pin gives 0x1C or 0x1E; anything else is told at the peer."""
    others = (*INSTRUMENTS[:2], replace(INSTRUMENTS[2], address=0x1D))
    found = truth_errors(twin_spec(), others)
    assert [(error.path, error.message) for error in found] == [
        (("peers", "mag"), "the LIS3MDL answers at 0x1C or 0x1E, not at 0x1D")
    ]


def test_devices_are_ordered_as_in_the_bench_file():
    """Events of one instant happen in the order of the instruments, whoever asked first."""
    twin = Twin()
    order = []
    for name in ("mag", "relays", "psu"):
        twin.world.clock_of(name).at(1000, lambda name=name: order.append(name))
    twin.clock.sleep(1)
    assert order == ["psu", "relays", "mag"]


@pytest.mark.parametrize("offers", [PEERS, PLANTS], ids=lambda offers: offers.group)
def test_what_is_refused_is_told_at_its_place(offers):
    """Whoever names a model in the bench file learns where, and of the nearest."""
    name = offers.names[0]
    with pytest.raises(TruthError, match=rf"unknown {offers.what} '{name}x', did you mean '{name}'") as caught:
        offered(offers, f"{name}x", ("peers", "one", "model"))
    assert caught.value.path == ("peers", "one", "model")


@pytest.mark.parametrize(("group", "name"), [(offers, name) for offers in (PEERS, PLANTS) for name in offers])
def test_what_we_offer_is_what_it_should_be(group, name):
    """Every entry point of ours can be imported."""
    assert offered(group, name, ()) is group[name]


@pytest.mark.parametrize(("offers", "kind"), [(PEERS, "PeerModel"), (PLANTS, "PlantModel")])
def test_another_object_is_no_model(offers, kind):
    """An entry point that names something else is told what it should be."""
    assert offers._problem("one", 3) == f"is 3, not a {kind}"
