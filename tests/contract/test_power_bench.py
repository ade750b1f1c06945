"""Multimeter and electronic load against their peers, on one rail that a supply feeds through a relay's contact."""

from __future__ import annotations

import math
from contextlib import contextmanager

import pytest
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.keysight_34461a import Keysight34461a
from hil.instruments.power_roles import ELECTRONIC_LOAD
from hil.instruments.rigol_dl3021 import RigolDl3021
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Garbled, NoReply, Refused, Rejected
from hil.model.figure import FigureStatus
from hil.simulation.peers.keysight_34461a import MODEL as METER
from hil.simulation.peers.rigol_dl3021 import MODEL as LOAD
from hil.simulation.plants.power_feed import build
from hil.simulation.truth import Truth

MS = 1_000_000
QUIET = {"voltage_noise": "0", "current_noise": "0"}
CLAMPED = {"current": (0.0, 5.0), "resistance": (2.0, 1000.0), "power": (0.0, 50.0), "voltage": (1.0, 30.0)}
SIGNALS = {"voltage": "rail.load.voltage", "current": "rail.load.current"}


def rail(volts=12.0, limit=10.0, series="0.1", resistance="1000000"):
    """Return a rail that is fed."""
    plant = build("rail", 10 * MS, Truth({"series": series, "resistance": resistance}, ("truth",)))
    plant.command(given=volts, limit=limit)
    return plant


@contextmanager
def load(plant=None, *, faults=(), clamped=CLAMPED, **truth):
    """Yield the load's input, its driver, and what it hangs on."""
    clamps = tuple(
        Clamp(output="electronic_load", quantity=name, unit=ELECTRONIC_LOAD.quantities[name], minimum=low, maximum=high)
        for name, (low, high) in clamped.items()
    )
    plant = plant or rail()
    with facing(
        LOAD, driver=RigolDl3021, truth={**QUIET, **truth}, faults=faults, clamps={0: clamps},
        connects={"input": "rail.load"}, plants={"rail": plant},
    ) as (driver, _):  # fmt: skip
        yield driver.role(Wire(role="electronic_load", instrument="device")), driver, plant


@contextmanager
def meter(plant=None, *, faults=(), truth=None, **settings):
    """Yield one quantity of the meter, the driver, and the clock."""
    truth = {"voltage_noise": "0", "current_noise": "0", "resistance_noise": "0", **(truth or {})}
    with facing(
        METER, driver=Keysight34461a, truth=truth, faults=faults, connects=SIGNALS, plants={"rail": plant or rail()}
    ) as (driver, clock):
        yield driver.role(Wire(role="multimeter", instrument="device", settings=settings)), driver, clock


@pytest.mark.parametrize(
    ("operation", "level", "mode", "volts", "amperes"),
    [
        ("constant_current", 2.0, "CC", 11.8, 2.0),
        ("constant_resistance", 5.9, "CR", 11.8, 2.0),
        ("constant_power", 23.6, "CP", 11.8, 2.0),
        ("constant_voltage", 11.85, "CV", 11.9, 1.0),
    ],
)
def test_each_mode_loads_the_rail(operation, level, mode, volts, amperes):
    """Behind a tenth of an ohm the rail comes down by what is drawn; off, it draws nothing."""
    with load() as (role, driver, plant):
        getattr(role, operation)(level)
        assert (role.mode(), role.enabled(), driver.outlets()) == (mode, False, (Outlet(0, on=False),))
        assert plant.observe("load.current") == 0.0
        role.enable()
        assert role.voltage().value == pytest.approx(volts, abs=1e-4)
        assert role.current().value == pytest.approx(amperes, abs=1e-3)
        assert role.power().value == pytest.approx(volts * amperes, abs=0.02)
        assert role.resistance().value == pytest.approx(volts / amperes, abs=0.02)
        assert plant.observe("current") == pytest.approx(amperes, abs=1e-3)
        role.disable()
        assert (plant.observe("load.current"), math.isnan(role.resistance().value)) == (0.0, True)


def test_a_level_is_clamped_and_a_mode_without_a_clamp_refused():
    """Below the driver, before bytes leave, and again when the input is switched on."""
    with load() as (role, _, plant):
        role.constant_current(1.0)
        role.enable()
        with pytest.raises(ClampExceeded, match="current 6 A is outside its clamp 0 to 5 A"):
            role.constant_current(6.0)
        with pytest.raises(ClampExceeded, match="resistance 1 ohm is outside"):
            role.constant_resistance(1.0)
        assert plant.observe("load.current") == 1.0
    with load(clamped={"current": (0.0, 1.0)}) as (role, *_), pytest.raises(Refused, match="CP needs a clamp"):
        role.constant_power(5.0)


def test_a_hand_at_the_load_is_found():
    """What was set at the front panel is clamped too; a mode that does not stay is refused."""
    with load(clamped={"current": (0.0, 1.0)}) as (role, driver, _):
        driver._session.setting(":SOUR:CURR:LEV:IMM 3")
        with pytest.raises(ClampExceeded):
            role.enable()
        driver._session.setting(":SOUR:FUNC POW")
        with pytest.raises(Refused, match="CP needs a clamp"):
            role.enable()
    with load(faults=[{"kind": "refuse-off"}]) as (role, *_):
        role.constant_current(1.0)
        role.enable()
        with pytest.raises(Rejected, match="was switched off and is on"):
            role.disable()


def test_too_much_power_switches_off_by_itself():
    """Beyond 200 W the load protects itself; the driver sees that it is off."""
    with load(rail(60.0, 10.0), clamped={"current": (0.0, 10.0)}) as (role, *_):
        role.constant_current(5.0)
        with pytest.raises(Rejected, match="was switched on and is off"):
            role.enable()


@pytest.mark.parametrize(("measures", "expected"), [("voltage", 11.8), ("current", 2.0), ("resistance", 4700.0)])
@pytest.mark.parametrize("nplc", ["0.02", "1", "10", "100"])
def test_the_meter_reads_what_is_at_its_terminals(measures, expected, nplc):
    """Each quantity, quick and slow; the time of a reading is that of its power line cycles, twice."""
    plant = rail()
    plant.command(mode="CC", level=2.0)
    with meter(plant, truth={"resistor": "4700"}, measures=measures, nplc=nplc) as (role, driver, clock):
        figure = getattr(role, measures)()
        assert (figure.value, figure.status) == (pytest.approx(expected, rel=1e-5), FigureStatus.MEASURED)
        before = clock.now()
        assert role.sample() == (pytest.approx(expected, rel=1e-5),)
        assert clock.now() - before == pytest.approx(2 * float(nplc) / 50, abs=0.04)
        assert (driver.identify().model, driver.outlets()) == ("34461A", ())
        assert [(each.name, each.unit) for each in role.channels()] == [(measures, figure.unit)]


def test_a_reading_beyond_its_range_is_not_observable():
    """Not 9.9E37: NaN with a status that no check passes, fails, or takes for a number."""
    with meter(measures="voltage", range="1 V", nplc="1") as (role, *_):
        figure = role.voltage()
        assert math.isnan(figure.value)
        assert figure.status is FigureStatus.NOT_OBSERVABLE
        assert math.isnan(role.sample()[0])
    with meter(measures="voltage", range="100 V", nplc="1") as (role, *_):
        assert role.voltage().value == pytest.approx(12.0)


def test_a_reading_is_the_mean_over_its_time():
    """A step of the load in the middle of the integration is seen by half."""
    plant = rail(series="1")
    with meter(plant, measures="voltage", nplc="10") as (role, _, clock):
        role.voltage()
        clock.at(clock.now_ns() + 125 * MS, lambda: plant.command(mode="CC", level=1.0))
        assert 11.3 < role.voltage().value < 11.7
        assert role.voltage().value == pytest.approx(11.0, rel=1e-5)


def test_one_meter_measures_by_turns():
    """Two wires on one instrument: each sets it up again, and each gets its own quantity."""
    plant = rail()
    plant.command(mode="CC", level=0.5)
    with meter(plant, measures="voltage", nplc="1") as (volts, driver, _):
        amperes = driver.role(
            Wire(role="multimeter", instrument="device", settings={"measures": "current", "nplc": "1"})
        )
        for _ in range(2):
            assert volts.voltage().value == pytest.approx(11.95, rel=1e-6)
            assert amperes.current().value == pytest.approx(0.5)
        with pytest.raises(Refused, match="multimeter measures voltage, and its leads are not connected for current"):
            volts.current()


def test_a_hand_at_the_meter_is_found():
    """A reading of another function is not taken for the one that was asked; the next one sets it up again."""
    with meter(measures="voltage", nplc="1") as (role, driver, _):
        role.voltage()
        driver._session.setting("CONF:CURR AUTO")
        with pytest.raises(Rejected, match="was set to measure VOLT, and measures CURR"):
            role.voltage()
        assert role.voltage().value == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"range": "12 V"}, r"'range' must be auto, 0.1 V, 1 V, 10 V, 100 V, 1000 V, found \"12 V\""),
        ({"measures": "current", "range": "10 V"}, "'range' must be auto, 0.0001 A"),
        ({"nplc": "5"}, "'nplc' must be one of"),
        ({"measures": "power"}, "'measures' must be one of voltage, current, resistance"),
    ],
)
def test_what_a_wire_cannot_ask_of_a_meter(settings, message):
    """Told with what there is."""
    with pytest.raises(Refused, match=message), meter(**settings):
        pass


@pytest.mark.parametrize(
    ("faults", "error"),
    [([{"kind": "dead"}], NoReply), ([{"kind": "garbled", "share": "0.5"}], (Garbled, NoReply))],
    ids=["dead", "garbled"],
)
def test_silence_and_nonsense_are_faults(faults, error):
    """Never a number."""
    with meter(faults=faults) as (role, *_), pytest.raises(error):
        role.voltage()
    with load(faults=faults) as (role, *_), pytest.raises(error):
        role.current()


def test_no_number_is_no_number():
    """What the instruments call not a number is NaN."""
    with load(faults=[{"kind": "not-a-number"}]) as (role, *_):
        assert all(math.isnan(read().value) for read in (role.voltage, role.current, role.power, role.resistance))
    with meter(faults=[{"kind": "not-a-number"}]) as (role, *_):
        assert role.voltage().status is FigureStatus.NOT_OBSERVABLE


def test_the_contact_separates_the_supply_from_the_rail():
    """Open, the supply sees nothing and the load gets nothing; closed again, all is as before."""
    with load() as (role, _, plant):
        role.constant_current(1.0)
        role.enable()
        plant.command(contact=False)
        assert (role.voltage().value, role.current().value) == (0.0, 0.0)
        assert (plant.observe("voltage"), plant.observe("current")) == (12.0, 0.0)
        plant.command(contact=True)
        assert role.current().value == 1.0
