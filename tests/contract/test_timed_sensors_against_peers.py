"""Every sensor without a FIFO that the timer of a board can read: what it streams, and what ends it."""

from __future__ import annotations

import numpy as np
import pytest
from behind_obc import BehindObc
from sensor_bench import TIMED_CHIPS, Bench

from hil.model.bench import Wire
from hil.model.errors import DeviceFault, Refused
from hil.simulation.peers.obc_link.stream import Stream

TIMED = pytest.mark.parametrize("chip", TIMED_CHIPS, ids=lambda chip: f"{chip.named} {chip.role}")


def streamed(bench, rate, seconds, pause=0.7):
    """Return the rows of a stream, and its report."""
    bench.sensor.begin(rate)
    blocks, end = [], bench.clock.now() + seconds
    while bench.clock.now() < end:
        bench.clock.sleep(min(pause, end - bench.clock.now()))
        blocks.append(bench.sensor.drain())
    return np.concatenate(blocks), bench.sensor.end()


@TIMED
def test_the_timer_of_a_board_reads_it(chip, monkeypatch):
    """Every tick a row, from one period on; turns that are made together are what they are one by one."""
    found = []
    for alone in (False, True):
        if alone:
            monkeypatch.setattr(Stream, "_unseen_ns", lambda _: None)
        bench = BehindObc(chip, truth=chip.truth, obc={"clock_drift": "0.0001"})
        bench.sensor.start()
        rows, report = streamed(bench, 27.0, 5.0)
        assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) / 27, abs=2e-5)
        assert len(rows) in {134, 135}
        assert rows[:, 1:] == pytest.approx(np.tile(chip.expected, (len(rows), 1)), abs=chip.close)
        assert (report.lost, report.drift) == (0, pytest.approx(1e-4, abs=2e-6))
        found.append((rows, bench.sensor.sample()))
    assert np.array_equal(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]


@TIMED
def test_only_a_board_lets_it_stream_and_only_one_of_a_board(chip):
    """On a bus of the host it is asked; a second stream would end the first."""
    bench = Bench(chip)
    bench.sensor.start()
    assert not bench.sensor.streams
    with pytest.raises(Refused, match="has no FIFO, and its bus no timer"):
        bench.sensor.begin(27.0)
    bench = BehindObc(chip)
    beside = next(each.role for each in TIMED_CHIPS if each.driver is chip.driver and each.role != chip.role)
    other = bench.driver.role(Wire(role=beside, instrument="sensor"))
    for sensor in (bench.sensor, other):
        sensor.start()
    bench.sensor.begin(27.0)
    assert bench.sensor.streams
    with pytest.raises(Refused, match="already streaming"):
        bench.sensor.begin(27.0)
    with pytest.raises(Refused, match="the board runs one stream at a time"):
        other.begin(6.0)
    bench.clock.sleep(0.5)
    assert len(bench.sensor.drain()) == 13
    bench.sensor.stop()
    other.begin(6.0)


@TIMED
@pytest.mark.parametrize(
    ("fault", "of_board", "told"),
    [
        ({"kind": "asleep"}, False, "sensor: {chip.nap[0]}"),
        ({"kind": "clock-stretch"}, False, "waits while the sensor holds the clock"),
        ({"kind": "stuck"}, False, "sensor: .* consecutive samples are equal"),
        ({"kind": "nack"}, True, "sensor: no acknowledge at address {chip.address:#x}"),
        ({"kind": "stall"}, True, "obc: no reading of sensor for .* s, though its link answers"),
    ],
    ids=lambda each: each["kind"] if isinstance(each, dict) else None,
)
def test_a_fault_in_a_stream_ends_it_after_the_rows_before(chip, fault, of_board, told):
    """None of its rows is a wrong number."""
    address = {"address": f"{chip.address:#x}"} if fault["kind"] == "nack" else {}
    faults = [fault | address | {"from": "4 s"}]
    bench = BehindObc(chip, truth=chip.truth, **{"obc_faults" if of_board else "faults": faults})
    bench.sensor.start()
    bench.sensor.begin(27.0)
    healthy_s = 4 - bench.clock.now()
    rows = []
    with pytest.raises(DeviceFault, match=told.format(chip=chip)):
        while bench.clock.now() < 12:
            bench.clock.sleep(0.9)
            rows.extend(bench.sensor.drain())
    assert len(rows) >= 27 * healthy_s - 3
    assert np.array(rows)[:, 1:] == pytest.approx(np.tile(chip.expected, (len(rows), 1)), abs=chip.close)
