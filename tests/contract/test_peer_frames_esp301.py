"""The simulated ESP301 against lines as its manual and public drivers show them."""

from __future__ import annotations

import json
import re

import pytest
from rotation import CONNECTS, Controller

from hil.simulation.truth import TruthError

_DECIMAL = r"-?\d+\.\d{6}"


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        ("VE?", r"ESP301 Version SIM\.1 6/1/99"),
        ("1ID?", "URS75BPP, SN0001"),
        ("1TP?", _DECIMAL),
        ("1TV?", _DECIMAL),
        ("1DV?", _DECIMAL),
        ("1VA?", _DECIMAL),
        ("1AC?", _DECIMAL),
        ("1AG?", _DECIMAL),
        ("1VU?", "100.000000"),
        ("1SU?", "0.000200"),
        ("1SL?", "-360000.000000"),
        ("1SR?", "360000.000000"),
        ("1SN?", "7"),
        ("1MO?", "0"),
        ("2MO?", "0"),
        ("1MD?", "1"),
        ("3MD?", "1"),
        ("TE?", "0"),
        ("TB?", r"0, \d+, NO ERROR DETECTED"),
        (" 1 t p ? ", _DECIMAL),
    ],
)
def test_question_and_answer(line, answer):
    """A question gets one line of the published form, and leaves no error; blanks and case do not count."""
    controller = Controller()
    (line_back,) = controller.ask(line)
    assert re.fullmatch(answer, line_back)
    assert controller.ask("TE?") == ["0"]


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("FOO", "6, COMMAND DOES NOT EXIST"),
        ("1XX?", "6, COMMAND DOES NOT EXIST"),
        ("VE1", "6, COMMAND DOES NOT EXIST"),
        ("\xb2TP?", "6, COMMAND DOES NOT EXIST"),
        ("1VA" + "1" * 90, "6, COMMAND DOES NOT EXIST"),
        ("TP?", "37, AXIS NUMBER MISSING"),
        ("4TP?", "9, AXIS NUMBER OUT OF RANGE"),
        ("2TP?", "208, MOTOR / STAGE NOT CONNECTED"),
        ("3MV+", "308, MOTOR / STAGE NOT CONNECTED"),
        ("1VA", "38, COMMAND PARAMETER MISSING"),
        ("1VA-5", "7, PARAMETER OUT OF RANGE"),
        ("1VAfast", "7, PARAMETER OUT OF RANGE"),
        ("1MV", "38, COMMAND PARAMETER MISSING"),
        ("1SN12", "7, PARAMETER OUT OF RANGE"),
        ("1VA100.1", "110, MAXIMUM VELOCITY EXCEEDED"),
        ("1AC201", "111, MAXIMUM ACCELERATION EXCEEDED"),
        ("1MV+", "113, MOTOR NOT ENABLED"),
    ],
)
def test_refusal_and_its_error(line, error):
    """What is refused has no answer, and its code, time and text wait in the buffer."""
    controller = Controller()
    controller.clock.sleep(1)
    assert controller.ask(line) == []
    code, ticks, text = controller.ask("TB?")[0].split(", ")
    assert f"{code}, {text}" == error
    assert 2500 <= int(ticks) < 2520
    assert controller.ask("TE?") == ["0"]


def test_commands_of_one_line_are_executed_in_order():
    """An error in the middle does not keep the rest from being executed; every question has its own line."""
    controller = Controller()
    assert controller.ask("1VA12;1VA?;QQ;1AC30;1AC?;TE?") == ["12.000000", "30.000000", "6"]


def test_lines_may_come_in_pieces_and_with_line_feeds():
    """Bytes are collected up to a carriage return."""
    controller = Controller()
    assert controller.exchange(b"1V") == b""
    assert controller.exchange(b"U?\r\n1SN?\r\n") == b"100.000000\r\n7\r\n"


def test_the_buffer_holds_ten_errors_oldest_first():
    """The eleventh displaces the first."""
    controller = Controller()
    controller.ask("1VA-1")
    for _ in range(10):
        controller.ask("QQ")
    assert [controller.ask("TE?") for _ in range(11)] == [["6"]] * 10 + [["0"]]


def test_motion_is_a_trapezoid():
    """Up with the acceleration, to another velocity at once, and down with the deceleration; the encoder follows."""
    controller = Controller()
    controller.ask("1VA20;1AC10;1AG20;1MO;1MV+")
    controller.clock.wait_until(1_000_000_000)
    assert float(controller.ask("1TV?")[0]) == pytest.approx(10, abs=0.2)
    assert controller.ask("1MD?") == ["0"]
    controller.clock.wait_until(5_000_000_000)
    assert controller.ask("1TV?") == ["20.000000"]
    controller.ask("1VA5")
    controller.clock.sleep(3)
    assert controller.table.observe("table_rate") == 5
    controller.ask("1ST")
    controller.clock.sleep(0.3)
    assert controller.ask("1MD?;1TV?;1MO?") == ["1", "0.000000", "1"]
    position = float(controller.ask("1TP?")[0])
    assert position == pytest.approx(controller.table.observe("angle"), abs=1.1e-4)
    assert position / 0.0002 == pytest.approx(round(position / 0.0002), abs=1e-2)


def test_negative_direction_and_motor_off():
    """MV- turns back; without motor power friction ends it."""
    controller = Controller()
    controller.ask("1VA20;1AC100;1MO;1MV-")
    controller.clock.sleep(1)
    assert controller.table.observe("table_rate") == -20
    controller.ask("1MF")
    controller.clock.sleep(0.5)
    assert controller.table.observe("table_rate") == 0
    assert controller.ask("1MO?;1MD?") == ["0", "1"]


def test_a_stop_without_an_axis_stops():
    """`ST` alone is for all axes."""
    controller = Controller()
    controller.ask("1VA20;1AC100;1MO;1MV+")
    controller.clock.sleep(1)
    controller.ask("ST")
    controller.clock.sleep(3)
    assert controller.table.observe("table_rate") == 0


def test_restored_in_the_middle_of_a_motion_it_goes_on():
    """State survives JSON, with a line that waits to be executed and an error in the buffer."""
    first, second = Controller(), Controller()
    first.ask("1VA20;1AC10;1MO;1MV+;QQ")
    first.line.write(b"1TP?\r1T")
    peer, table = (json.loads(json.dumps(dict(part.state()))) for part in (first.peer, first.table))
    second.clock.wait_until(first.clock.now_ns())
    second.table.restore(table)
    second.peer.restore(peer)
    assert first.exchange(b"V?\r", 1.5) == second.exchange(b"V?\r", 1.5) != b""
    assert first.ask("TB?;1TP?;1MD?") == second.ask("TB?;1TP?;1MD?")


def test_faults_of_the_drive_need_its_terminal():
    """A bench file cannot ask for a slip that nothing would show."""
    connects = {key: value for key, value in CONNECTS.items() if key != "grip"}
    with pytest.raises(TruthError, match="grip"):
        Controller(faults=[{"kind": "stalled"}], connects=connects)
