"""What weeks of a battery on its simulated bench cost: a line of the cycler, a poll of the controller."""

from __future__ import annotations

from io import FileIO

import pytest
from battery_tester import BatteryTester

from hil.instruments.driver import Clamps
from hil.instruments.eurotherm_3216 import Eurotherm3216Thermal
from hil.instruments.modbus_session import ModbusSession

LINES = 5000
LINES_UNREAD = 80
LINE_NS = 5_000_000_000
POLLS = 500


@pytest.fixture
def tester(tmp_path):
    """A battery in a test, with the transcript of its ports."""
    with FileIO(tmp_path / "transcript.tsv", "w") as sink:
        bench = BatteryTester(sink)
        bench.start(cycles=100)
        yield bench
        bench.close()


def test_a_line_of_the_cycler(tester, cost):
    """Five seconds of a test: the cell, what the cycler reads of it, its line, and the tapped port."""
    assert (
        cost("five seconds of a battery's test, line and all", lambda: tester.follow(LINES), units=LINES) > 30 * LINES
    )


def test_a_line_that_nobody_reads_yet(tester, cost):
    """Five seconds of the simulated side alone: clock, cell, cycler, and the bytes on their way."""
    clock = tester.clock

    def unread():
        tester.follow(1)
        clock.wait_until(clock.now_ns() + LINES_UNREAD * LINE_NS)
        return tester.ports["cycler"].in_waiting

    assert cost("five seconds of a battery's test, nobody reading", unread, units=LINES_UNREAD) > 30 * LINES_UNREAD


def test_a_poll_of_the_controller(tmp_path, cost):
    """The temperature of a controller that regulates, two registers over Modbus."""
    with FileIO(tmp_path / "transcript.tsv", "w") as sink:
        bench = BatteryTester(sink, regulated=True)
        session = ModbusSession("tec", bench.ports["tec"], bench.clock, 1)
        thermal = Eurotherm3216Thermal(
            name="thermal", device="tec", session=session, clock=bench.clock, clamps=Clamps({}), channel=1, decimals=1
        )
        bench.clock.sleep(1)

        def polled():
            for _ in range(POLLS):
                reading = thermal.temperature()
            return reading

        assert cost("temperature over Modbus (process value and status)", polled, units=POLLS).unit == "degC"
        bench.close()
