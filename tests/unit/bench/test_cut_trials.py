"""Cut paths tried at arm on the battery bench, and on one with a relay between supply and cell."""

from __future__ import annotations

from dataclasses import replace

import pytest
from adcs_bench import bound, with_peer
from workspaces import ROOT

from hil.bench.cut_trials import cut_path_gates
from hil.bench.file.reading import load_bench
from hil.bench.readiness import energised_gates, unpowered_gates
from hil.model.bench import InstrumentSpec, PeerSpec, Position, SafeStep, Wire
from hil.model.cutting import CutPath

CHARGE = "cut path of supply.charge: cycler stopped"
CYCLER = "cut path of cycler: supply.apparatus off"


def battery(**truth):
    """Return the committed bench; `truth` is that of the cell's plant."""
    spec = load_bench(ROOT / "fixtures/benches", "battery", ROOT)
    plants = tuple(
        replace(plant, truth={**plant.truth, **truth}) if plant.name == "battery" else plant
        for plant in spec.simulated.plants
    )
    return replace(spec, simulated=replace(spec.simulated, plants=plants))


def tried(bench):
    """Return the gates by name."""
    return {gate.name: gate for gate in cut_path_gates(bench)}


def is_off(bench):
    """Return whether nothing is on in truth."""
    battery = bench.world.plants["battery"]
    inputs = ("supply_voltage", "charge_contact", "discharge_contact", "tec")
    rails = [bench.world.plants[name].observe("voltage") for name in ("apparatus", "tec_feed")]
    return not any(battery.inputs[name] for name in inputs) and not any(rails)


def test_what_can_be_tried_is_tried():
    """20 mA flow into the cell, and nothing flows once the path is taken; everything is off at every gate."""
    with bound(battery()) as bench:
        for gate in cut_path_gates(bench):
            assert gate.ok, gate
            assert is_off(bench), gate
        found = tried(bench)
    for name in (CHARGE, CYCLER):
        assert found[name].detail.startswith("0.02 A before the cut, ")
        assert "not tried" not in found[name].detail


def test_what_cannot_be_tried_is_said():
    """Interlocks are nobody's to command, and cold coolers show nothing."""
    with bound(battery()) as bench:
        found = tried(bench)
    assert (
        found["cut path of cycler: watchdog of cycler"].detail == "within 360 s; not tried: it takes longer than 30 s"
    )
    hardware = "cut path of thermal: thermal cut-out opens the coolers' feed at 70 degC"
    assert found[hardware].detail == "within 300 s; not tried: no software is part of it"
    assert found["cut path of thermal: supply.tec off"].detail == (
        "supply.tec was proven off; not tried: no measurement at low energy would show it"
    )


def test_coils_that_keep_their_power_are_told():
    """Relays that are not fed by the supply that is said to feed them stay closed."""
    spec = battery()
    peer = next(item for item in spec.simulated.peers if item.device == "cycler1")
    own = {name: point for name, point in peer.connects.items() if name != "power"}
    with bound(with_peer(spec, "cycler1", connects=own)) as bench:
        found = tried(bench)
        assert found[CHARGE].ok
        assert not found[CYCLER].ok
        assert "0.02 A after " in found[CYCLER].detail
        assert found[CYCLER].detail.endswith("it does not cut cycler off; check for a welded contact and the wiring")
        assert is_off(bench)


def closed_at(spec):
    """Return when the charge relay closes first, in s of bench time."""
    times = []
    with bound(spec) as bench:
        cell = bench.world.plants["battery"]
        cell.listen(lambda: times.append(bench.clock.now()) if cell.inputs["charge_contact"] else None)
        tried(bench)
    return times[0]


def test_a_relay_that_welds_is_told():
    """The tester says that it is stopped, and the current flows on."""
    spec = battery()
    fault = {"kind": "stuck-relay", "relay": "charge", "from": f"{closed_at(spec) + 0.05:.3f} s"}
    with bound(with_peer(spec, "cycler1", faults=(fault,))) as bench:
        gate = tried(bench)[CHARGE]
        assert not gate.ok
        assert "cycler current 0.02 A" in gate.detail or gate.detail.endswith(
            "check for a welded contact and the wiring"
        )


def test_a_relay_that_never_closes_is_told():
    """Where nothing flows nothing was cut."""
    fault = {"kind": "stuck-relay", "relay": "charge"}
    with bound(with_peer(battery(), "cycler1", faults=(fault,))) as bench:
        gate = tried(bench)[CHARGE]
        assert not gate.ok
        assert gate.detail.endswith("before the cut, expected at least 0.01 A: check load and contacts")
        assert is_off(bench)


def test_a_full_cell_takes_nothing():
    """That is said, and is no fault; so a run may go on after a stop at the end of a charge."""
    with bound(battery(charge="1.0")) as bench:
        gate = tried(bench)[CHARGE]
        assert (gate.ok, gate.detail) == (True, "not tried: the cell has 4.199 V, so no current flows into it at 4.2 V")


def test_a_tester_that_refuses_is_told():
    """Its words are in the gate, and all is off."""
    with bound(battery(ambient="50")) as bench:
        gate = tried(bench)[CHARGE]
        assert not gate.ok
        assert "cycler1" in gate.detail
        assert is_off(bench)


@pytest.mark.parametrize(
    ("inputs", "shown"),
    [({"fuse": "open"}, "0.000"), ({"ntc": "healthy"}, "-3.000")],
)
def test_a_cell_that_is_reversed_or_missing_is_told_before_anything_is_on(inputs, shown):
    """The tester's own reading tells, and nothing is driven."""
    volts = [f"{-3.0 - place / 100:g}" for place in range(14)][::-1] if shown.startswith("-") else None
    spec = battery(**({"open_circuit": volts} if volts else {}))
    with bound(spec) as bench:
        bench.world.plants["battery"].command(**inputs)
        gate = next(gate for gate in unpowered_gates(bench) if gate.name == "polarity at cycler")
        assert not gate.ok
        assert gate.detail.endswith("is it reversed, is it connected, is its fuse whole?")
        assert is_off(bench)


def with_relay(**peer):
    """Return the battery bench with a relay between charger and cell in the place of the tester's own."""
    spec = battery()
    relay = InstrumentSpec(name="relay1", driver="waveshare-relay", port="/dev/ttyUSB9", baud=9600, address=1)
    charger = spec.wire("supply.charge")
    positions = (
        Position(relays="relays", closed=(), conducts=False),
        Position(relays="relays", closed=("cell",), conducts=True),
    )
    reduced = replace(charger.reduced, lowest_current=0.01, highest_current=0.025, positions=positions)
    wires = (replace(charger, reduced=reduced), *(wire for wire in spec.wiring if wire is not charger))
    board = Wire(role="relays", instance="", instrument="relay1", contacts={"cell": 1})
    spec = replace(
        spec,
        instruments=(*spec.instruments, relay),
        wiring=(*wires, board),
        safe_off=(*spec.safe_off, SafeStep(output="relays", state="released", within_s=2.0)),
        cut_paths=(CutPath(output="supply.charge", by="relays", state="released", within_s=2.0),),
    )
    cycler = next(item for item in spec.simulated.peers if item.device == "cycler1")
    own = {name: point for name, point in cycler.connects.items() if name != "charge"}
    spec = with_peer(spec, "cycler1", connects=own)
    peers = (
        *spec.simulated.peers,
        PeerSpec(device="relay1", model="", connects={"1": "battery.charge_contact"}, **peer),
    )
    return replace(spec, simulated=replace(spec.simulated, peers=peers))


def test_relays_between_supply_and_load_are_tried():
    """Closed, the reduced current flows; released, nothing does."""
    with bound(with_relay()) as bench:
        gate = tried(bench)["cut path of supply.charge: relays released"]
        assert gate.ok, gate
        assert gate.detail.startswith("0.02 A before the cut, ")
        assert is_off(bench)


def test_a_welded_relay_is_no_cut_path():
    """The board reads it back as released; the current flows on."""
    with bound(with_relay(faults=({"kind": "welded", "contact": "1"},))) as bench:
        gate = tried(bench)["cut path of supply.charge: relays released"]
        assert not gate.ok
        assert gate.detail.endswith("it does not cut supply.charge off; check for a welded contact and the wiring")


def test_nothing_more_is_tried_after_a_path_that_does_not_cut():
    """The arming ends there: no gate of the envelope comes after it."""
    own = {"voltage": "battery.voltage", "current": "battery.current", "temperature": "battery.temperature"}
    contacts = {"charge": "battery.charge_contact", "discharge": "battery.discharge_contact"}
    with bound(with_peer(battery(), "cycler1", connects=own | contacts)) as bench:
        gates = list(energised_gates(bench, None))
    assert [gate.name for gate in gates if not gate.ok] == [CYCLER]
    assert gates[-1].name == CYCLER
