"""The simulated temperature controller: registers, loop, memory, modes, and what is wrong with its sensor."""

from __future__ import annotations

import json

import pytest
from controller_line import ControllerLine

from hil.simulation.truth import TruthError

PV, TARGET, MANUAL, OUTPUT, SETPOINT = range(1, 6)
SP1, SP2, REMOTE, STATUS, INVERTED = 24, 25, 26, 75, 76
MODE, SENSOR_BREAK, LOOP, SOURCE = 199, 258, 273, 276


def regulating(target=100, **choices):
    """Return a controller that regulates to a target in tenths of a degree."""
    line = ControllerLine(**choices)
    line.write(TARGET, target)
    line.write(MODE, 0)
    line.wait(2)
    return line


def test_it_is_found_in_standby():
    """Standby gives no power; the process value is there all the same."""
    line = ControllerLine(sensor_noise="0")
    line.wait(30)
    assert [line.read(address) for address in (PV, OUTPUT, MODE, LOOP, STATUS)] == [220, 0, 1, 0, 0]


@pytest.mark.parametrize(
    ("decimals", "unit", "shown"), [("0", "degC", 22), ("1", "degC", 220), ("2", "degC", 2200), ("1", "degF", 716)]
)
def test_what_a_register_means_depends_on_the_display(decimals, unit, shown):
    """The same 22 degC are four numbers; decimals and unit can be asked for."""
    line = ControllerLine(sensor_noise="0", decimals=decimals, unit=unit)
    line.wait(2)
    assert line.read(PV) == shown
    assert (line.read(525), line.read(516)) == (int(decimals), 0 if unit == "degC" else 1)


def test_the_loop_brings_the_plate_to_the_setpoint():
    """Proportional and integral terms leave no offset; the output is negative while it cools."""
    line = regulating(target=-50, sensor_noise="0")
    assert line.read(OUTPUT) == -1000
    line.wait(1200)
    assert line.chamber.observe("plate") == pytest.approx(-5.0, abs=0.05)
    assert -1000 < line.read(OUTPUT) < 0


def test_output_limits_hold():
    """No more than the limits, in both directions."""
    line = regulating(target=-100, output_low="-40", output_high="25")
    assert line.read(OUTPUT) == -400
    line.write(TARGET, 500)
    line.wait(2)
    assert line.read(OUTPUT) == 250


def test_there_is_no_more_than_all():
    """Limits beyond 100 % give 100 %."""
    line = regulating(target=-100)
    line.write(31, 0x10000 - 3000)
    line.write(LOOP, 1)
    line.write(MANUAL, 0x10000 - 3000)
    line.wait(2)
    assert (line.read(OUTPUT), line.chamber.inputs["tec"]) == (-1000, -1.0)


def test_manual_output_and_the_way_back():
    """By hand the output is what it is told, and regulation goes on from there without a jump."""
    line = regulating(target=220, sensor_noise="0")
    line.write(LOOP, 1)
    line.write(MANUAL, 0x10000 - 150)
    line.wait(2)
    assert (line.read(OUTPUT), line.read(STATUS)) == (-150, 1 << 4)
    assert line.read(INVERTED) == ~(1 << 4)
    line.wait(30)
    line.write(LOOP, 0)
    line.wait(1)
    assert abs(line.read(OUTPUT) + 150) < 30


def test_standby_gives_no_power():
    """Within one turn of its loop the output is 0, and the plate drifts back."""
    line = regulating(target=-100)
    line.wait(300)
    line.write(MODE, 1)
    line.wait(1)
    assert (line.read(OUTPUT), line.chamber.inputs["tec"]) == (0, 0.0)
    cold = line.chamber.observe("plate")
    line.wait(60)
    assert line.chamber.observe("plate") > cold + 3


def test_every_write_of_the_memory_is_counted():
    """The target is one of the two setpoints; the remote one wears nothing; what is refused was not written."""
    line = ControllerLine()
    for value in (100, 100, 200):
        line.write(TARGET, value)
    line.write(SP2, 50)
    for value in range(20):
        line.write(REMOTE, value)
    line.write(PV, 1)
    line.write(MODE, 9)
    assert dict(line.peer.writes) == {SP1: 3, SP2: 1}


def test_setpoints_are_clipped_at_their_limits():
    """What is beyond reads back as the limit."""
    line = ControllerLine(setpoint_low="-20", setpoint_high="45")
    line.write(TARGET, 600)
    assert line.read(TARGET) == line.read(SP1) == 450
    line.write(TARGET, -600)
    assert line.read(TARGET) == -200


def test_the_remote_setpoint_is_given_up_after_a_while():
    """It counts for five seconds; then the local one does, and the status says so."""
    line = regulating(target=150)
    line.write(SOURCE, 1)
    line.write(REMOTE, 300)
    line.wait(3)
    assert (line.read(SETPOINT), line.read(STATUS)) == (300, 0)
    line.wait(4)
    assert (line.read(SETPOINT), line.read(STATUS)) == (150, 1 << 14)


def test_refusals_are_exceptions():
    """Unknown functions, addresses, values and lengths; a controller without a timer has none to start."""
    line = ControllerLine()
    assert line.body("01 11") == "01 91 01"
    assert line.body("01 03 00 00 00 01") == "01 83 02"
    assert line.body("01 03 00 01 00 00") == "01 83 03"
    assert line.body("01 03 00 01 00 FA") == "01 83 03"
    assert line.body("01 03 00 01") == "01 83 03"
    assert line.write(PV, 5) == "01 86 02"
    assert line.write(23, 1) == "01 86 02"
    assert line.write(MODE, 7) == "01 86 03"
    assert line.body("01 10 00 18 00 02 02 00 64") == "01 90 03"
    assert line.body("01 08 00 01 00 00") == "01 88 03"


def test_a_broadcast_is_obeyed_in_silence():
    """Address 0 reaches every unit, and none answers."""
    line = ControllerLine()
    assert line.body("00 06 00 02 00 64") == ""
    assert line.read(TARGET) == 100


def test_offset_and_noise_of_its_sensor():
    """Readings scatter around the truth plus the offset, the same way in every run."""

    def readings():
        line = ControllerLine(decimals="2", sensor_offset="0.7", sensor_noise="0.05", range_high="300")
        values = []
        for _ in range(200):
            line.wait(1)
            values.append(line.read(PV) / 100)
        return values

    values = readings()
    mean = sum(values) / len(values)
    spread = (sum((value - mean) ** 2 for value in values) / len(values)) ** 0.5
    assert mean == pytest.approx(22.7, abs=0.02)
    assert 0.04 < spread < 0.06
    assert readings() == values


def test_nobody_changes_the_physics_by_asking():
    """Polling between turns leaves plate and memory as they would have been."""
    asked, left = regulating(), regulating()
    for _ in range(50):
        asked.read(PV)
        asked.read(OUTPUT)
    left.clock.wait_until(asked.clock.now_ns())
    for line in (asked, left):
        line.clock.wait_until(120_000_000_000)
    assert json.dumps(asked.chamber.state()) == json.dumps(left.chamber.state())
    assert asked.peer.state()["regulation"] == left.peer.state()["regulation"]


def test_a_restored_controller_goes_on():
    """State through JSON, onto a fresh one at the same instant: the same bits a minute later."""
    first, other = regulating(target=-50), ControllerLine()
    first.wait(60)
    state = json.loads(json.dumps([first.peer.state(), first.chamber.state()]))
    other.clock.wait_until(first.clock.now_ns())
    other.peer.restore(state[0])
    other.chamber.restore(state[1])
    for line in (first, other):
        line.wait(60)
    assert json.dumps(first.chamber.state()) == json.dumps(other.chamber.state())
    assert first.peer.state() == other.peer.state()
    assert first.peer.writes == other.peer.writes


def test_an_unconnected_controller_reads_the_room():
    """Without a plant it is a box on a table."""
    line = ControllerLine(connects={}, ambient="18", sensor_noise="0")
    line.wait(2)
    assert line.read(PV) == 180


@pytest.mark.parametrize(
    ("truth", "words"),
    [
        ({"model": "3x16"}, "must be the four digits of a type code, such as '3216', found \"3x16\""),
        ({"period": "0 s"}, "'period' must be longer than zero"),
        ({"mode": "automatic"}, "'mode' must be one of operating, standby, found \"automatic\""),
        ({"sensor_ofset": "1"}, "unknown key 'sensor_ofset', did you mean 'sensor_offset'"),
    ],
)
def test_wrong_truths_are_told(truth, words):
    """What cannot be is refused where the bench file says it."""
    with pytest.raises(TruthError, match=words):
        ControllerLine(**truth)
