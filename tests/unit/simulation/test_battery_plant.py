"""The battery's wires, contacts, fuse and thermistor, and what its truth may say."""

from __future__ import annotations

from math import exp

import pytest
from battery_cycles import SECOND_NS, battery

from hil.simulation.plants.battery.plant import build
from hil.simulation.plants.plant import Plant
from hil.simulation.plants.terminal import PlantPort, SignalPoint, observing
from hil.simulation.truth import Truth, TruthError

CHARGE = {"charge_contact": True, "supply_voltage": 4.2, "supply_current": 0.7}


def seen(plant: Plant, *signals: str) -> list[float]:
    """Return signals at the present instant."""
    return [plant.observe(name) for name in signals]


def test_two_wires_see_leads_and_fuse_and_four_do_not():
    """Tester and tabs differ by the current through leads and fuse, with the sign of the current."""
    for inputs, sign in ((CHARGE, 1), ({"discharge_contact": True}, -1)):
        plant = battery(charge="0.5", leads="0.2", fuse="0.05")
        assert plant.observe("voltage") == plant.observe("cell_voltage")
        plant.command(**inputs)
        volts, tabs, amperes = seen(plant, "voltage", "cell_voltage", "current")
        assert amperes == pytest.approx(sign * 0.7)
        assert volts - tabs == pytest.approx(amperes * 0.25)


def test_open_contacts_carry_nothing():
    """Neither supply nor load reaches the cell, and the supply has its own voltage."""
    plant = battery(charge="0.5")
    plant.command(supply_voltage=4.2, supply_current=0.7)
    assert seen(plant, "current", "supply.current", "supply.voltage", "load.current") == [0.0, 0.0, 4.2, 0.0]
    assert plant.observe("voltage") == pytest.approx(plant.observe("open_circuit"), abs=1e-3)


def test_a_supply_is_a_port():
    """What drives the port drives the cell, and what is off shows the cell's voltage and takes nothing."""
    plant = battery(charge="0.5")
    plant.command(charge_contact=True)
    port = PlantPort(plant, plant.ports["supply"])
    assert port.volts() == plant.observe("voltage")
    assert port.amperes() == 0.0
    port.drive(4.2, 0.3)
    assert port.amperes() == pytest.approx(0.3)
    assert plant.observe("voltage") < port.volts() < 4.2
    port.drive(3.0, 0.3)
    assert port.amperes() == 0.0
    assert port.volts() == plant.observe("voltage") > 3.0


def test_a_resistor_discharges_by_ohms_law():
    """Its current is the terminals' voltage over resistor and contact; a constant current comes on top."""
    plant = battery(charge="0.5", load_current="0", load_resistance="5", contact="0.1")
    plant.command(discharge_contact=True)
    volts, amperes = seen(plant, "voltage", "load.current")
    assert amperes == pytest.approx(volts / 5.1)
    plant.command(load_current=0.2)
    volts, amperes = seen(plant, "voltage", "load.current")
    assert amperes == pytest.approx(volts / 5.1 + 0.2)


def test_supply_and_load_at_once_share_the_terminals():
    """With both contacts closed the cell gets what the supply gives and the load leaves."""
    plant = battery(charge="0.5")
    plant.command(**CHARGE, discharge_contact=True, load_current=0.4)
    into, given, taken = seen(plant, "current", "supply.current", "load.current")
    assert given == pytest.approx(0.7)
    assert taken == pytest.approx(0.4)
    assert into == pytest.approx(0.3)


def test_an_empty_cell_is_not_turned_around():
    """A load that goes on draws less and less; the terminals stay at 0 V or above."""
    plant = battery(charge="0.02")
    plant.command(discharge_contact=True)
    for minute in range(1, 60):
        plant.advance(minute * 60 * SECOND_NS)
        assert plant.observe("voltage") >= -1e-9
    assert 0 <= plant.observe("load.current") < 0.7


def test_an_open_fuse_isolates_the_cell():
    """No current flows, the tester sees next to nothing, and under the supply its voltage alone."""
    plant = battery(charge="0.5")
    plant.command(fuse="open")
    assert plant.observe("current") == 0.0
    assert plant.observe("voltage") == pytest.approx(0.0, abs=0.01)
    assert plant.observe("cell_voltage") > 3.5
    plant.command(**CHARGE)
    assert plant.observe("voltage") == pytest.approx(4.2, abs=1e-3)
    plant.advance(600 * SECOND_NS)
    assert plant.observe("charge") == 0.5


def test_the_thermistor_tells_its_temperature_or_its_fault():
    """Healthy it follows the cell, detached the box; open and shorted it has no temperature."""
    plant = battery(charge="0.9", ntc_nominal="10000", ntc_beta="3950")
    plant.command(discharge_contact=True)
    plant.advance(5000 * SECOND_NS)
    cell, box = seen(plant, "temperature", "box")

    def ohms(celsius: float) -> float:
        return 10_000 * exp(3950 * (1 / (celsius + 273.15) - 1 / 298.15))

    assert cell > box + 2
    assert plant.observe("ntc") == pytest.approx(ohms(cell))
    assert plant.observe("ntc_temperature") == pytest.approx(cell)
    assert plant.observe("ntc_box") == pytest.approx(ohms(box))
    for state, low, high in (("open", 1e8, 1e10), ("shorted", 0, 1), ("detached", ohms(box) - 1, ohms(box) + 1)):
        plant.command(ntc=state)
        assert low <= plant.observe("ntc") <= high
    assert plant.observe("ntc_temperature") == pytest.approx(box)
    plant.command(ntc="open")
    assert plant.observe("ntc_temperature") == pytest.approx(-113, abs=1)
    plant.command(ntc="shorted")
    assert plant.observe("ntc_temperature") > 1000
    assert set(plant.choices("ntc")) == {"healthy", "open", "shorted", "detached"}


def test_cold_raises_the_resistance():
    """At 10 degC the cell has more resistance than at 40."""
    cold, warm = battery(ambient="10"), battery(ambient="40")
    assert cold.observe("resistance") > 1.5 * warm.observe("resistance")


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ({"capacity": "0"}, "must be above 0"),
        ({"open_circuit": ["3"] * 14}, "must be rising numbers"),
        ({"sink_ambient": "0.2"}, "or the sinks run away"),
        ({"place": "oven"}, "must be one of container, assembly"),
        ({"led": "0.1"}, "unknown key 'led', did you mean 'leads'"),
    ],
)
def test_wrong_truths_are_told(truth, message):
    """What cannot be a battery is refused with its key."""
    with pytest.raises(TruthError, match=message):
        build("cell", SECOND_NS, Truth(truth, ("truth",)))


@pytest.mark.parametrize("together", [(), ("temperature",), tuple(sorted(battery().signals))])
def test_several_signals_with_one_look(together):
    """What is observed together is what is observed one by one, between grid points and after commands too."""
    plant = battery(charge="0.4")
    look = plant.observing(together)
    for second, charging in ((0, True), (3, True), (7, False), (21, False), (25, True)):
        plant.advance(second * SECOND_NS)
        plant.command(charge_contact=charging, discharge_contact=not charging, supply_voltage=4.2, supply_current=0.7)
        assert look([second * SECOND_NS]) == [tuple(plant.observe(name) for name in together)]


def test_what_is_seen_ahead_of_time_comes_so():
    """Signals that are told ahead are bit by bit those that are observed then, whoever looks and advances meanwhile."""
    names = ("voltage", "current", "ntc_temperature")
    foretold, lived = battery(charge="0.4"), battery(charge="0.4")
    looks = foretold.observing(names)
    now = 0
    for lines, charging in ((1, True), (7, True), (3, False), (12, True), (5, True)):
        times = [now + (7 + 5 * line) * SECOND_NS + 1234 * line for line in range(lines)]
        for plant in (foretold, lived):
            plant.advance(times[0])
            plant.command(charge_contact=charging, supply_voltage=4.2, supply_current=0.7)
        told = looks(times)
        for time, expected in zip(times, told, strict=True):
            for plant in (foretold, lived)[lines % 2 :]:
                plant.advance(time)
            assert tuple(lived.observe(name) for name in names) == expected
        foretold.advance(now := times[-1])
    assert foretold.state() == lived.state()


def test_a_command_ends_what_was_foreseen():
    """After a command things are as they are for a plant that was never asked about its future."""
    asked, other = battery(charge="0.4"), battery(charge="0.4")
    for plant in (asked, other):
        plant.command(charge_contact=True, supply_voltage=4.2, supply_current=0.7)
    asked.observing(("voltage", "current"))([0, 5 * SECOND_NS, 60 * SECOND_NS])
    for plant in (asked, other):
        plant.advance(12 * SECOND_NS)
        plant.command(tec=0.5)
        plant.advance(40 * SECOND_NS)
    assert asked.state() == other.state()


def test_a_broken_thermistor_is_not_foreseen():
    """What is no number of the state is told of the present alone."""
    plant = battery()
    look = plant.observing(("voltage", "ntc_temperature"))
    assert len(look([0, 5 * SECOND_NS])) == 2
    plant.command(ntc="open")
    assert look([0, 5 * SECOND_NS]) == [(plant.observe("voltage"), plant.observe("ntc_temperature"))]


def test_points_of_several_plants_and_open_inputs():
    """Points are observed together wherever they are; an open input shows what it is told to."""
    warm, cold = battery(ambient="30"), battery(ambient="10")
    points = [SignalPoint(warm, "temperature"), None, SignalPoint(cold, "temperature")]
    assert observing(points, (0.0, 25.0, 0.0))([0]) == [(30.0, 25.0, 10.0)]
    assert observing(points[:1] * 2, (0.0, 0.0))([0]) == [(30.0, 30.0)]
