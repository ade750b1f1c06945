"""The oscilloscope's driver against its peer, which sees a rail with a capacitor that is charged."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from charging_rail import ChargingRail
from facing import facing

from hil.instruments.rigol_ds1000z import RigolDs1000z
from hil.instruments.sampled import Channel
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected
from hil.simulation.peers.rigol_ds1000z import MODEL

WIRE = {"ch1": "rail", "probe1": "10", "ch3": "inrush", "unit3": "A", "probe3": "10"}
PROBES = {"channels": {"1": {"probe": "10", "noise": "0"}, "3": {"probe": "10", "noise": "0"}}}


def scope(*, truth=PROBES, plant=None, faults=(), transcript=None):
    """Return a driver facing an oscilloscope at a rail."""
    plants = {"rail": plant or ChargingRail()}
    connects = {"1": "rail.voltage", "3": "rail.inrush"}
    return facing(
        MODEL, driver=RigolDs1000z, truth=truth, connects=connects, plants=plants, faults=faults, transcript=transcript
    )


def role(driver, **changed):
    """Return the role of the driver."""
    return driver.role(Wire(role="oscilloscope", instrument="device", settings={**WIRE, **changed}))


def set_up(found, *, level=0.5, scale=1.0, after=8e-3, points=1500, source="rail"):
    """Set up both channels, a window from 2 ms before to some time after the trigger, and arm."""
    found.vertical("rail", scale, 2.0)
    found.vertical("inrush", 0.5, 1.0)
    found.window(2e-3, after, points)
    found.trigger(source, level)
    found.arm()


def captured(found):
    """Return the frame and all rows of a finished capture."""
    frame = found.frame()
    return frame, np.concatenate(list(found.blocks(frame)))


def test_a_power_on_is_captured_as_physics_has_it():
    """Both channels follow the exponential within half a count, at the sample's own time, though the grid is 10 ms."""
    plant = ChargingRail()
    with scope(plant=plant) as (driver, clock):
        found = role(driver)
        assert found.channels() == (Channel("rail", "V"), Channel("inrush", "A"))
        set_up(found, source="inrush", level=1.0)
        assert found.status() == "waiting"
        clock.sleep(0.0537)
        assert not found.complete()
        plant.command(given=4.0)
        clock.sleep(0.1)
        assert found.complete()
        frame, rows = captured(found)
    assert frame.rows == len(rows) == pytest.approx(10e-3 / frame.interval, abs=1)
    time, rail, inrush = rows.T
    assert time[0] == pytest.approx(-2e-3, abs=frame.interval)
    assert frame.screens[0].resolution == pytest.approx(1.0 / 25)
    assert frame.screens[0].low < -2 < 6 < frame.screens[0].high
    charged = np.where(time > 0, 4.0 * (1 - np.exp(-np.maximum(time, 0) / plant.tau)), 0.0)
    away = np.abs(time) > 2 * frame.interval
    assert np.abs(rail - charged)[away].max() <= 0.02 + 1e-3
    assert np.abs(inrush - np.where(time > 0, (4 - charged) / 2, 0.0))[away].max() <= 0.011


def test_the_trigger_is_where_the_level_is_crossed():
    """On the slow slope of the voltage: 2 V are crossed at the time zero, half a count and a sample apart."""
    plant = ChargingRail()
    with scope(plant=plant) as (driver, clock):
        found = role(driver)
        set_up(found, level=2.0)
        plant.command(given=4.0)
        clock.sleep(0.1)
        frame, rows = captured(found)
    at_zero = rows[np.argmin(np.abs(rows[:, 0])), 1]
    assert at_zero == pytest.approx(2.0, abs=0.021 + frame.interval * 1e3)


def test_polling_changes_no_byte():
    """Whoever asks for the state in between gets the same capture."""
    rows = []
    for pauses in ([0.1], [0.001] * 100):
        plant = ChargingRail()
        with scope(plant=plant, truth={"channels": {"1": {"noise": "0.1"}}}) as (driver, clock):
            found = role(driver)
            set_up(found)
            clock.sleep(round(clock.now() + 0.5, 1) - clock.now())
            plant.command(given=4.0)
            for pause in pauses:
                clock.sleep(pause)
                if len(pauses) > 1:
                    plant.observe("voltage")
            clock.sleep(0.1)
            rows.append(captured(found)[1])
    assert (rows[0] == rows[1]).all()


def test_blocks_and_the_limit_of_a_read():
    """30,000 points come in three reads, in order; the peer refuses more than 250,000 at once."""
    plant = ChargingRail()
    with scope(plant=plant) as (driver, clock):
        found = driver.role(Wire(role="oscilloscope", instrument="device", settings={"ch1": "rail", "probe1": "10"}))
        found.vertical("rail", 1.0, 2.0)
        found.window(2e-3, 8e-3, 30_000)
        found.trigger("rail", 0.5)
        found.arm()
        plant.command(given=4.0)
        clock.sleep(0.1)
        frame = found.frame()
        lengths = [len(block) for block in found.blocks(frame)]
    assert frame.rows == 100_001
    assert lengths == [10_000] * 10 + [1]


def test_a_signal_that_leaves_the_screen_stands_at_its_edge():
    """4 V at 0.2 V per division around 2 V: what is beyond is the converter's last count."""
    plant = ChargingRail()
    with scope(plant=plant) as (driver, clock):
        found = role(driver)
        set_up(found, scale=0.2)
        plant.command(given=4.0)
        clock.sleep(0.1)
        frame, rows = captured(found)
    assert rows[:, 1].max() == pytest.approx(frame.screens[0].high)
    assert rows[:, 1].max() < 3.5


def test_a_probe_of_another_factor_falsifies_the_volts():
    """A probe at 1:1 that the wiring takes for 10:1 shows ten times too much."""
    plant = ChargingRail()
    with scope(plant=plant, truth={"channels": {"1": {"probe": "1", "noise": "0"}}}) as (driver, clock):
        found = role(driver)
        set_up(found, scale=10.0)
        plant.command(given=1.0)
        clock.sleep(0.1)
        _, rows = captured(found)
    assert rows[-1, 1] == pytest.approx(10.0, rel=0.05)


def test_its_state_survives_a_restart():
    """Settings, a trigger that is waited for, and what was captured, byte by byte, through JSON."""
    peers = []

    def build(setup):
        peers.append(MODEL.build(setup))
        return peers[-1]

    plant, connects = ChargingRail(), {"1": "rail.voltage", "3": "rail.inrush"}
    arguments = {"driver": RigolDs1000z, "truth": PROBES, "connects": connects, "plants": {"rail": plant}}
    states = []
    with facing(replace(MODEL, build=build), **arguments) as (driver, clock):
        found = role(driver)
        set_up(found)
        states.append(peers[0].state())
        plant.command(given=4.0)
        clock.sleep(0.1)
        assert found.complete()
        states.append(peers[0].state())
    with facing(replace(MODEL, build=build), **{**arguments, "plants": {"rail": ChargingRail()}}):
        for state in states:
            written = json.loads(json.dumps(state))
            peers[1].restore(written)
            assert json.loads(json.dumps(peers[1].state())) == written


def test_no_trigger_no_capture():
    """Without a crossing it waits; it says so, and can be halted."""
    with scope() as (driver, clock):
        found = role(driver)
        set_up(found)
        clock.sleep(5.0)
        assert (found.complete(), found.status()) == (False, "waiting")
        found.halt()
        assert found.status() == "stopped"
        with pytest.raises(Refused, match="is not armed"):
            found.complete()


def test_a_stale_capture_is_never_read():
    """What was captured once, or before the settings changed, is not read again as a new one."""
    plant = ChargingRail()
    with scope(plant=plant) as (driver, clock):
        found = role(driver)
        set_up(found)
        plant.command(given=4.0)
        clock.sleep(0.1)
        assert found.complete()
        captured(found)
        with pytest.raises(Refused, match="is not armed"):
            found.complete()
        found.arm()
        assert not found.complete()


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda found: found.vertical("rails", 1.0), "no channel 'rails'"),
        (lambda found: found.vertical("rail", 0.0), "is not above zero"),
        (lambda found: found.vertical("rail", 1.0, coupling="XX"), "unknown coupling"),
        (lambda found: found.window(0.5, 1.0), "up to 1.2 s are triggered"),
        (lambda found: found.window(0.0, 1.0, 10**9), "do not fit its memory"),
        (lambda found: found.window(-1.0, 2.0), "no window"),
        (lambda found: found.trigger("rail", 1.0, "up"), "unknown slope"),
        (lambda found: found.arm(), "window nor trigger"),
    ],
)
def test_what_it_cannot_do_is_refused_before_a_byte_leaves(ask, message):
    """In words that say what it can."""
    with scope() as (driver, clock):
        with pytest.raises(Refused, match=message):
            ask(role(driver))
        assert clock.now() == 0.0


def test_a_scale_beyond_the_instrument_is_rejected_by_it():
    """Above 10 V per division and probe."""
    with scope() as (driver, _), pytest.raises(Rejected, match="Data out of range"):
        role(driver).vertical("rail", 500.0)


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        ({"kind": "dead"}, NoReply),
        ({"kind": "partial", "bytes": "4"}, NoReply),
        ({"kind": "garbled"}, (NoReply, Garbled)),
    ],
)
def test_a_line_that_fails_during_the_transfer_is_a_fault(fault, error):
    """Half a block, or one whose header is nonsense, is never taken for samples."""
    plant = ChargingRail()
    with scope(plant=plant, faults=[{**fault, "from": "1 s"}]) as (driver, clock):
        found = role(driver)
        set_up(found)
        plant.command(given=4.0)
        clock.sleep(0.1)
        frame = found.frame()
        clock.sleep(1.0)
        with pytest.raises(error):
            list(found.blocks(frame))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "no channel is named"),
        ({"ch1": "rail", "ch2": "rail"}, "has the name of another channel"),
        ({"ch1": "rail", "probe1": "0"}, "probe1"),
        ({"ch5": "rail"}, "did you mean"),
        ({"ch1": "rail", "unit1": "W"}, "unit1"),
    ],
)
def test_a_wire_that_makes_no_sense_is_refused(settings, message):
    """At its place in the bench file."""
    with scope() as (driver, _), pytest.raises(Refused, match=message):
        driver.role(Wire(role="oscilloscope", instrument="device", settings=settings))
