"""What is peculiar to the IIM-42652, driver against peer; what all sensors share is tested for the family."""

from __future__ import annotations

import math

import pytest
from sensor_bench import IIM42652, Bench

from hil.model.errors import NoReply

BOTH = pytest.mark.parametrize("board", [False, True], ids=["own bus", "board"])


@BOTH
def test_a_sensor_that_falls_asleep_stops_a_stream(board):
    """Three frames' time later its own registers say why; before there is nothing to say."""
    bench = Bench(IIM42652, board=board, faults=[{"kind": "asleep", "from": "3 s"}]).streaming()
    with pytest.raises(NoReply, match=r"sensor: no samples for .* it has lost its settings"):
        bench.rows(10)
    assert bench.clock.now() < 7.5


def test_a_sensor_that_was_left_in_another_bank():
    """Start brings it back: WHO_AM_I is in bank 0 only."""
    bench = Bench(IIM42652)
    bench.bus.write_byte_data(0x68, 0x76, 4)
    bench.sensor.start()
    assert len(bench.sensor.sample()) == 4


def test_start_waits_until_data_are_valid():
    """60 ms after power-on, up to 150 ms more where the gyroscope was just switched off."""
    bench = Bench(IIM42652)
    bench.sensor.start()
    assert bench.clock.now() == pytest.approx(0.08, abs=0.01)
    bench.sensor.stop()
    began = bench.clock.now()
    bench.sensor.start()
    assert not any(math.isnan(number) for number in bench.sensor.sample())
    assert bench.clock.now() - began < 0.25
