"""Readiness on a bench in good order, and on one that somebody left switched on."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from adcs_bench import adcs, bound, with_peer

from hil.bench import readiness
from hil.bench.readiness import energised_gates, unpowered_gates
from hil.model.bench import UsbPort
from hil.model.identity import Dut, Identity, Model

DUT = Dut(serial="SN-1", part="P-2", model=Model.EM, hardware="B")


def energy(bench):
    """Return what is on in the plant: voltages at the coil and the sensor, and the contacts."""
    coil = bench.world.plants["coil"]
    return (
        coil.observe("voltage"),
        coil.observe("sensor_power.voltage"),
        coil.inputs["contact_a"],
        coil.inputs["contact_b"],
    )


OFF = (0.0, 0.0, False, False)


def gates(bench, dut=None):
    """Go through all gates and return them by name."""
    found = {}
    for gate in (*unpowered_gates(bench, dut), *energised_gates(bench, dut)):
        found[gate.name] = gate
    return found


def test_bench_in_good_order_is_ready():
    """Every gate holds, with what was seen, in the order in which it is safe to look."""
    with bound(adcs()) as bench:
        found = gates(bench, DUT)
        assert all(gate.ok for gate in found.values()), found
        assert list(found) == [
            "identity of psu1",
            "identity of relay1",
            "outputs of psu1",
            "outputs of relay1",
            "safe state reached",
            "reduced level of supply.coil, relays released",
            "reduced level of supply.coil, relays a closed",
            "reduced level of supply.coil, relays b closed",
            "reduced level of supply.coil, relays a and b closed",
            "reduced level of supply.sensor",
            "identity of mag1",
            "envelope coil-current",
            "envelope sensor-voltage",
        ]
        assert found["identity of psu1"].detail == "Keysight Technologies E36312A SIM-MY59002391"
        assert found["outputs of psu1"].detail == "all off"
        assert found["reduced level of supply.sensor"].detail.startswith("3.3 V, ")
        assert energy(bench) == OFF


def test_a_supply_without_a_reduced_level_was_not_tried():
    """Attack: a bench file without `reduced`. The gate holds, and says what it does not prove."""
    spec = adcs()
    wiring = tuple(replace(wire, reduced=None) if wire.name == "supply.sensor" else wire for wire in spec.wiring)
    with bound(replace(spec, wiring=wiring)) as bench:
        found = gates(bench)
    assert found["reduced level of supply.sensor"].ok
    assert [gate.unproven for gate in found.values() if gate.unproven] == [
        "supply.sensor was not tried at a reduced level: its wire has none"
    ]


def test_looking_drives_nothing():
    """The unpowered gates leave an output that is on as it is."""
    with bound(adcs()) as bench:
        bench.roles["supply.sensor"].configure(3.3, 0.02)
        bench.roles["supply.sensor"].enable()
        assert all(gate.ok for gate in unpowered_gates(bench))
        assert bench.roles["supply.sensor"].enabled()


def test_every_trial_is_over_when_its_gate_is_given():
    """Whoever stops after any gate finds the bench off."""
    with bound(adcs()) as bench:
        for gate in energised_gates(bench, DUT):
            assert gate.ok
            assert energy(bench) == OFF, gate


@pytest.mark.parametrize("board", ["z_plus", "y_minus"])
def test_coil_in_its_current_limit_is_in_good_order(board):
    """With a board on the jig the reduced level ends in the current limit, in both directions and in no other."""
    with bound(adcs()) as bench:
        bench.world.plants["coil"].command(board=board)
        found = gates(bench)
        assert all(gate.ok for gate in found.values())
        volts = [
            float(found[f"reduced level of supply.coil, relays {position}"].detail.split(" V")[0])
            for position in ("released", "a closed", "b closed", "a and b closed")
        ]
        assert volts == pytest.approx([0.2, 0.5, 0.5, 0.2], abs=0.01)


def test_without_a_board_nothing_is_proven_of_the_relays():
    """Open terminals look the same in every position, so the bench is not ready."""
    with bound(adcs()) as bench:
        bench.world.plants["coil"].command(board="")
        gate = gates(bench)["reduced level of supply.coil, relays released"]
        assert not gate.ok
        assert gate.detail.endswith("0.0015 to 0.0025 A expected: load, contacts or wiring?")


@pytest.mark.parametrize(("welded", "wrong"), [("1", "released"), ("2", "released")])
def test_welded_contact_is_not_ready(welded, wrong):
    """The board reads it back as released; the current in some position shows that it is not."""
    with bound(with_peer(adcs(), "relay1", truth={"welded": [welded]})) as bench:
        bad = {name: gate.detail for name, gate in gates(bench).items() if not gate.ok}
        other = "b closed" if welded == "1" else "a closed"
        assert list(bad) == [f"reduced level of supply.coil, relays {position}" for position in (wrong, other)]
        assert bad[f"reduced level of supply.coil, relays {other}"].endswith("welded, or wiring?")


def test_two_welded_contacts_are_not_ready():
    """Current flows where it should, in the wrong direction; where one contact is closed it flows too."""
    with bound(with_peer(adcs(), "relay1", truth={"welded": ["1", "2"]})) as bench:
        bad = [name for name, gate in gates(bench).items() if not gate.ok]
        assert bad == [f"reduced level of supply.coil, relays {contact} closed" for contact in "ab"]


def test_wired_output_found_on_is_reported_and_made_safe():
    """It is nobody's state to take over: told with its channels, and off before anything is tried."""
    with bound(adcs()) as bench:
        for output, volts in (("supply.coil", 5.0), ("supply.sensor", 3.3)):
            bench.roles[output].configure(volts, 0.016)
            bench.roles[output].enable()
        bench.roles["relays"].close("b")
        looks = {gate.name: gate for gate in unpowered_gates(bench)}
        assert looks["outputs of psu1"].ok
        assert looks["outputs of psu1"].detail == "found on: channel 2, 3, safe-off comes before anything else"
        assert looks["outputs of relay1"].detail == "found on: channel 2, safe-off comes before anything else"
        safe = next(energised_gates(bench, None))
        assert (safe.name, safe.ok) == ("safe state reached", True)
        assert energy(bench) == OFF


def test_output_found_on_that_is_not_wired_is_not_ready():
    """Somebody else's output is not ours to switch off: a person has to."""
    spec = adcs()
    wires = tuple(wire for wire in spec.wiring if wire.name != "supply.sensor")
    steps = tuple(step for step in spec.safe_off if step.output != "supply.sensor")
    with bound(spec) as bench:
        bench.roles["supply.sensor"].configure(3.3, 0.02)
        bench.roles["supply.sensor"].enable()
        bench.roles["relays"].close("a")
        bench.spec = replace(spec, wiring=wires, safe_off=steps)
        found = {gate.name: gate for gate in unpowered_gates(bench)}
        assert not found["outputs of psu1"].ok
        assert found["outputs of psu1"].detail == "on, and not wired here: channel 3; switch it off by hand"
        assert found["outputs of relay1"].ok


@pytest.mark.parametrize(
    ("expected", "detail"),
    [
        (Identity(serial="MY00000000"), "expected serial 'MY00000000', found 'MY59002391'"),
        (Identity(model="E36313A"), "expected model 'E36313A', found 'E36312A'"),
        (Identity(manufacturer="Other"), "expected manufacturer 'Other', found 'Keysight Technologies'"),
        (Identity(firmware="0.9"), "expected firmware '0.9', found '2.1.0-1.0.4-1.12'"),
    ],
)
def test_wrong_identity_is_told_field_by_field(expected, detail):
    """What the bench file says of an instrument must be what it says of itself."""
    spec = adcs()
    psu1 = replace(spec.instruments[0], identity=expected)
    with bound(replace(spec, instruments=(psu1, *spec.instruments[1:]))) as bench:
        gate = next(unpowered_gates(bench))
        assert (gate.name, gate.ok, gate.detail) == ("identity of psu1", False, detail)


@pytest.mark.parametrize(("operation", "gate"), [("identify", "identity of psu1"), ("outlets", "outputs of psu1")])
@pytest.mark.parametrize("answer", [lambda: 0, lambda: "psu", lambda: {}["on"], lambda: int("")])
def test_a_defect_of_a_driver_is_a_gate_that_does_not_hold(monkeypatch, operation, gate, answer):
    """The other instruments are looked at all the same, and nobody has to read a traceback."""
    with bound(adcs()) as bench:
        monkeypatch.setattr(bench.drivers["psu1"], operation, answer)
        found = {each.name: each for each in unpowered_gates(bench)}
    assert not found[gate].ok
    assert "in the driver: " in found[gate].detail
    assert [each.name for each in found.values() if not each.ok] == [gate]


def test_a_line_of_the_safe_off_without_enough_time_for_slow_replies_is_told_before_anything_is_driven(monkeypatch):
    """Proven too late is not proven: at the end of a run it would be an unsafe bench."""
    spec = adcs()
    with bound(spec) as bench:
        supply, off = bench.roles["supply.coil"], bench.roles["supply.coil"].disable
        monkeypatch.setattr(supply, "disable", lambda: (bench.clock.sleep(9.0), off()))
        (gate,) = energised_gates(bench, None)
    number = 1 + [line.output for line in spec.safe_off].index("supply.coil")
    assert not gate.ok
    needs = (
        rf"line {number} of safe_off needs at least 9\.\d* s with the replies of this bench; it allows \d s: give it"
    )
    assert re.search(needs, gate.detail), gate.detail


@pytest.mark.parametrize(("device", "serial"), [("psu1", "MY59002391"), ("mag1", "LIS3MDL")])
def test_article_is_recognised_by_any_device(device, serial):
    """What is read there must be what the register says, for devices with power of their own too."""
    with bound(adcs()) as bench:
        assert gates(bench, replace(DUT, recognised={device: serial}))[f"identity of {device}"].ok
    with bound(adcs()) as bench:
        gate = gates(bench, replace(DUT, recognised={device: "another"}))[f"identity of {device}"]
        assert not gate.ok
        assert gate.detail.endswith("answers, but the DUT is recognised by 'another'")
        assert energy(bench) == OFF


def test_article_that_nothing_here_can_recognise_is_not_ready():
    """A register that names no instrument of this bench proves nothing of who is on it."""
    with bound(adcs()) as bench:
        gate = gates(bench, replace(DUT, recognised={"magg1": "LIS3MDL"}))["identity of SN-1"]
        assert not gate.ok
        assert gate.detail == "it is recognised by magg1, and this bench has no such instrument"
        found = gates(bench, replace(DUT, recognised={"elsewhere": "X", "mag1": "LIS3MDL"}))
        assert "identity of SN-1" not in found


@pytest.mark.parametrize(
    ("truth", "connects", "detail"),
    [
        ({"voltage_gain": "-2"}, "coil.supply", "-0.5 V, .* A, 0.5 V was set: short, polarity or wiring[?]"),
        (
            {"voltage_offset": "0.01", "load": "0.1"},
            "",
            "0.0102 V, 0.002 A, 0.5 V was set: short, polarity or wiring[?]",
        ),
        (
            {"current_gain": "-2", "load": "300"},
            "",
            r"0.5 V, -0.00\d+ A, 0.0015 to 0.0025 A expected: load, contacts or wiring[?]",
        ),
        ({"voltage_gain": "0.2"}, "coil.supply", "0.6 V, .* A, 0.5 V was set: short, polarity or wiring[?]"),
    ],
)
def test_reversed_or_short_load_is_not_ready(truth, connects, detail):
    """Wrong sign, a short, or another voltage than was set is a gate that does not hold; the output is off again."""
    truth = {"serial": "MY59002391", "channels": {"2": {"voltage_noise": "0", "current_noise": "0", **truth}}}
    wires = {"2": connects, "3": "coil.sensor_power"} if connects else {"3": "coil.sensor_power"}
    spec = with_peer(adcs(), "psu1", truth=truth, connects=wires)
    spec = replace(spec, safe_off=tuple(replace(step, proof=None) for step in spec.safe_off))
    with bound(spec) as bench:
        bench.world.plants["coil"].command(board="")
        gate = gates(bench)["reduced level of supply.coil, relays released"]
        assert not gate.ok
        assert re.fullmatch(detail, gate.detail), gate.detail
        assert energy(bench) == OFF
        assert not bench.roles["supply.coil"].enabled()


def test_level_beyond_the_clamps_is_not_tried():
    """A reduced level that the clamps forbid is a gate that does not hold."""
    spec = adcs()
    coil = replace(spec.wiring[0], reduced=replace(spec.wiring[0].reduced, voltage=7.0))
    with bound(replace(spec, wiring=(coil, *spec.wiring[1:]))) as bench:
        gate = gates(bench)["reduced level of supply.coil, relays released"]
        assert not gate.ok
        assert "voltage 7 V is outside its clamp 0 to 6 V" in gate.detail


def test_envelope_that_does_not_trip_is_not_ready(monkeypatch):
    """A self-test that fails is told for its limit."""
    monkeypatch.setattr(readiness, "self_test", lambda limit: limit.id != "coil-current")
    with bound(adcs()) as bench:
        found = gates(bench)
        assert not found["envelope coil-current"].ok
        assert found["envelope coil-current"].detail == "does not trip on the readings that it should"
        assert found["envelope sensor-voltage"].ok


def test_an_output_without_a_reduced_level_is_left_open():
    """It was not tried: the gate holds, and says what nothing proved."""
    bench = adcs()
    wires = tuple(replace(wire, reduced=None) if wire.name == "supply.sensor" else wire for wire in bench.wiring)
    fed = tuple(replace(each, powered_by="") for each in bench.instruments)
    with bound(replace(bench, wiring=wires, instruments=fed)) as found:
        gate = gates(found)["reduced level of supply.sensor"]
    assert (gate.ok, gate.detail) == (True, "not tried")
    assert gate.unproven == "supply.sensor was not tried at a reduced level: its wire has none"


@pytest.mark.parametrize(
    ("usb", "detail", "unproven"),
    [
        (UsbPort(serial="A50285BK"), "whatever is at the USB device A50285BK", ""),
        (UsbPort(path="pci-0:4"), "nobody", "the bench file does not say who relay1 is"),
        (None, "nobody", "the bench file does not say who relay1 is"),
    ],
)
def test_an_instrument_that_cannot_say_who_it_is_is_known_by_its_own_usb_device(monkeypatch, usb, detail, unproven):
    """As a controller that Modbus asks nothing: the bench file names its adapter, and the gate of the port compares."""
    bench = adcs()
    items = tuple(
        replace(each, usb=usb, identity=Identity()) if each.name == "relay1" else each for each in bench.instruments
    )
    with bound(replace(bench, instruments=items)) as found:
        monkeypatch.setattr(type(found.drivers["relay1"]), "identify", lambda _: Identity())
        (gate,) = [each for each in unpowered_gates(found) if each.name == "identity of relay1"]
    assert (gate.ok, gate.detail, gate.unproven) == (True, detail, unproven)
