"""The IIM-42652 driver against its peer: over the host's own bus, and over a bus that streams."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gyroscope_bench import Bench

from hil.model.errors import Garbled, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity

SECOND = 1_000_000_000
BOTH = pytest.mark.parametrize("board", [False, True], ids=["own bus", "board"])
BIASES = {"bias_x": ["1.5", "0", "0"], "bias_y": ["-20", "0", "0"], "bias_z": ["0.25", "0", "0"]}


@pytest.mark.parametrize("span", ["2000", "1000", "500", "250", "125", "62.5", "31.25"])
def test_rates_and_temperature_at_every_range(span):
    """A constant rate arrives in deg/s within a count and the noise."""
    bench = Bench(truth=BIASES | {"temperature": "-16", "temperature_offset": "0.5"}, settings={"range": span})
    bench.gyro.start()
    *axes, temperature = bench.gyro.sample()
    assert axes == pytest.approx([1.5, -20, 0.25], abs=0.15)
    assert temperature == pytest.approx(-15.5, abs=0.01)
    assert bench.gyro.full_scale().value == float(span)


@BOTH
@pytest.mark.parametrize("rate", [12.5, 25, 50, 100, 200, 500, 1000])
def test_a_stream_has_every_sample_at_its_time(board, rate):
    """At every rate samples come once each, and as far apart as they are."""
    bench = Bench(board=board, truth=BIASES | {"odr_error": "0.01"}, settings={"rate": str(rate)})
    bench.streaming(rate)
    began = bench.clock.now()
    pause = bench.gyro.longest_pause
    rows = bench.rows(20, pause)
    period = 1 / 1.01 / rate
    assert len(rows) * period == pytest.approx(bench.clock.now() - began, abs=0.6)
    assert rows[0, 0] == pytest.approx(period, abs=period)
    assert rows[-1, 0] == pytest.approx(rows[0, 0] + (len(rows) - 1) * period, abs=period)
    steps = np.diff(rows[:, 0])
    assert steps == pytest.approx(period, rel=1e-4 if board else 0.05)
    assert rows[:, 1:].mean(axis=0) == pytest.approx([1.5, -20, 0.25, 25.0], abs=0.02)
    assert bench.gyro.end().lost_samples == 0


def test_both_ways_give_the_same_samples():
    """The rows of a stream are the same numbers, whoever read the FIFO."""
    own, behind = (Bench(board=board, truth=BIASES).streaming().rows(10) for board in (False, True))
    count = min(len(own), len(behind))
    assert count > 940
    assert np.array_equal(own[:count, 1:], behind[:count, 1:])
    assert own[:count, 0] == pytest.approx(behind[:count, 0], abs=0.01)


def test_times_over_a_board_are_device_time_from_the_watermarks():
    """An oscillator 0.5 % slow is seen to a microsecond, however late frames are read."""
    bench = Bench(board=True, truth={"odr_error": "-0.005"})
    bench.bus.delay_ns = dict.fromkeys(range(3, 40, 4), 25000000)
    rows = bench.streaming().rows(20)
    expected = np.arange(1, len(rows) + 1) * 0.01 / 0.995
    assert rows[:, 0] == pytest.approx(expected, abs=2e-6)


@BOTH
def test_the_report_tells_how_it_went(board):
    """Frames, none lost, and of a board the drift of its clock."""
    bench = Bench(board=board).streaming()
    bench.rows(5)
    report = bench.gyro.end()
    assert report.lost == report.lost_samples == 0
    assert report.frames == 5
    assert report.drift == (1e-5 if board else None)
    with pytest.raises(Refused, match="does not stream"):
        bench.gyro.drain()
    assert bench.bus.read_byte_data(0x68, 0x16) == 0


def test_a_frame_that_was_lost_leaves_its_time_empty():
    """Two seconds are missing, and what follows stands where it belongs."""
    bench = Bench(board=True, truth={"odr_error": "0.01"})
    bench.bus.skip = {4, 5}
    rows = bench.streaming().rows(10)
    steps = np.diff(rows[:, 0])
    gaps = np.flatnonzero(steps > 0.05)
    assert gaps.tolist() == [399]
    assert steps[399] == pytest.approx(201 * 0.01 / 1.01, abs=1e-5)
    assert bench.gyro.end().lost == 2


def test_the_first_frame_may_be_lost_too():
    """Times count from where the FIFO began to fill, not from the first frame that came."""
    bench = Bench(board=True)
    bench.bus.skip = {0}
    assert bench.streaming().rows(3)[0, 0] == pytest.approx(1.01, abs=1e-6)


def test_edges_that_are_no_watermark_do_no_harm():
    """A stray edge on the interrupt line brings no sample twice and shifts none."""
    bench = Bench(board=True)
    bench.bus.spurious = 2
    bench.streaming()
    rows = [bench.rows(2)]
    bench.clock.sleep(0.234)
    bench.bus._trigger()
    rows.append(bench.rows(3))
    rows = np.concatenate(rows)
    assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) * 0.01, abs=2e-6)


def test_a_fifo_that_overflows_leaves_time_empty_and_is_counted():
    """The oldest samples go: the rows behind the gap stand at their own time."""
    bench = Bench().streaming()
    rows = [bench.rows(2), bench.rows(4, 4.0), bench.rows(2)]
    before, rows = len(rows[0]), np.concatenate(rows)
    lost = bench.gyro.end().lost_samples
    assert lost == pytest.approx(400 - 256 + 5, abs=2)  # five came while the FIFO was read
    expected = np.arange(1, len(rows) + 1) * 0.01
    expected[before:] += 0.01 * lost
    assert rows[:, 0] == pytest.approx(expected, abs=0.011)


def test_an_overflow_behind_a_busy_board_is_placed_by_the_sensors_own_counter():
    """A turn that comes 0.3 s late finds other packets than those up to the watermark."""
    bench = Bench(board=True, settings={"rate": "1000"})
    bench.bus.delay_ns = {2: 3 * SECOND // 10}
    rows = bench.streaming(1000.0).rows(4, 0.2)
    lost = 128 + 300 - 256
    assert bench.gyro.end().lost_samples == lost
    expected = np.arange(1, len(rows) + 1) * 0.001
    expected[256:] += 0.001 * lost
    assert rows[:300, 0] == pytest.approx(expected[:300], abs=1e-6)
    assert np.diff(rows[:, 0]).min() > 0
    assert rows[-200:, 0] == pytest.approx(expected[-200:], abs=1e-6)


@BOTH
def test_a_rate_beyond_the_range_is_nan(board):
    """At the rail the true rate is unknown; the sensor is not called stuck."""
    bench = Bench(board=board, faults=[{"kind": "saturated", "from": "2 s", "until": "3 s"}]).streaming()
    rows = bench.rows(5)
    wrong = np.isnan(rows[:, 1:4]).all(axis=1)
    assert wrong.sum() == pytest.approx(100, abs=1)
    assert not np.isnan(rows[:, 4]).any()


@BOTH
def test_a_stuck_sensor_is_no_reply(board):
    """Its FIFO fills and its numbers stay; what came before is given out first."""
    bench = Bench(board=board, faults=[{"kind": "stuck", "from": "3 s"}]).streaming()
    with pytest.raises(NoReply, match="gyro: .* samples in a row are equal") as caught:
        for _ in range(10):
            bench.rows(1)
    assert caught.value.device == "gyro"
    assert bench.clock.now() < 5.2


def test_single_samples_of_a_stuck_sensor_are_no_reply():
    """Sixteen equal ones; samples that are read faster than they come do not count."""
    bench = Bench(faults=[{"kind": "stuck", "from": "1 s"}])
    bench.gyro.start()
    for _ in range(100):
        bench.gyro.sample()
    bench.clock.wait_until(SECOND)
    with pytest.raises(NoReply, match="16 samples in a row are equal"):
        for _ in range(20):
            bench.gyro.sample()
            bench.clock.sleep(0.01)


@BOTH
def test_a_sensor_that_falls_asleep_stops_a_stream(board):
    """Three frames' time later its own registers say why; before there is nothing to say."""
    bench = Bench(board=board, faults=[{"kind": "asleep", "from": "3 s"}]).streaming()
    with pytest.raises(NoReply, match=r"gyro: no samples for .* it has lost its settings"):
        bench.rows(10)
    assert bench.clock.now() < 7.5


def test_a_sensor_asleep_gives_nan():
    """Its data are marked invalid, and that is no number."""
    bench = Bench(faults=[{"kind": "asleep", "from": "1 s"}])
    bench.gyro.start()
    bench.clock.wait_until(2 * SECOND)
    for _ in range(30):
        assert all(math.isnan(axis) for axis in bench.gyro.sample()[:3])
        bench.clock.sleep(0.01)


def test_a_sensor_that_cannot_be_woken_does_not_start():
    """Its settings do not stay."""
    bench = Bench(faults=[{"kind": "asleep"}])
    with pytest.raises(Rejected, match="reads back"):
        bench.gyro.start()


@BOTH
def test_a_dead_sensor_is_no_reply_of_the_sensor(board):
    """No acknowledge on its bus is its own fault, also behind a board."""
    bench = Bench(board=board, faults=[{"kind": "dead", "from": "3200 ms"}]).streaming()
    with pytest.raises(NoReply) as caught:
        bench.rows(10)
    assert caught.value.device == "gyro"
    assert bench.clock.now() < 7.5


def test_frames_before_a_missing_acknowledge_are_not_lost():
    """They come with the drain, the fault with the next one."""
    bench = Bench(board=True, faults=[{"kind": "dead", "from": "2580 ms", "until": "4 s"}])
    bench.gyro.start()
    bench.clock.wait_until(SECOND // 10)
    bench.gyro.begin(100.0)
    bench.clock.wait_until(2_590_000_000)
    bench.bus._trigger()
    assert len(bench.gyro.drain()) == pytest.approx(200, abs=50)
    for _ in range(2):
        with pytest.raises(NoReply, match="no acknowledge at address 0x68 in frame"):
            bench.gyro.drain()


def test_a_silent_link_is_the_fault_of_the_board():
    """The sensor is not blamed."""
    bench = Bench(board=True).streaming()
    bench.rows(2)
    bench.bus.link_is_silent = True
    bench.bus.running.waiting.clear()
    with pytest.raises(NoReply) as caught:
        bench.rows(10)
    assert caught.value.device == "obc"
    with pytest.raises(NoReply):
        bench.gyro.stop()


def test_an_interrupt_line_that_is_not_connected_is_found():
    """The sensor samples, its FIFO fills, and no frame comes."""
    bench = Bench(board=True)
    bench.bus._trigger = lambda: None
    bench.streaming()
    bench.bus.running, running = None, bench.bus.running
    with pytest.raises(NoReply, match="gyro: .* its FIFO fills.*INT1"):
        bench.rows(5)
    assert running.number == 0


def test_a_line_and_a_rate_of_the_wiring():
    """The OBC listens to the line that the wire names; another rate than the wire's is refused."""
    bench = Bench(board=True, settings={"line": "1"}).streaming()
    assert bench.bus.line == 1
    with pytest.raises(Refused, match="streams already"):
        bench.gyro.begin(100.0)
    bench.gyro.stop()
    with pytest.raises(Refused, match="has not been started"):
        bench.gyro.begin(100.0)
    bench.gyro.start()
    with pytest.raises(Refused, match="runs at 100 Hz, not at 50 Hz"):
        bench.gyro.begin(50.0)


def test_single_samples_while_it_streams():
    """They disturb nothing."""
    bench = Bench(board=True, truth=BIASES).streaming()
    rows = []
    for _ in range(40):
        bench.clock.sleep(0.1)
        assert bench.gyro.sample()[1] == pytest.approx(-20, abs=0.1)
        rows.append(bench.gyro.drain())
    rows = np.concatenate(rows)
    assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) * 0.01, abs=2e-6)


def test_identity():
    """WHO_AM_I names the type."""
    assert Bench().driver.identify() == Identity(model="IIM-42652")


def test_another_device_at_the_address():
    """It is named in the identity, and start refuses it."""
    bench = Bench(faults=[{"kind": "identity", "value": "0x47"}])
    assert bench.driver.identify().model == "WHO_AM_I 0x47"
    with pytest.raises(WrongIdentity, match="0x47"):
        bench.gyro.start()


def test_a_sensor_that_was_left_in_another_bank():
    """Start brings it back: WHO_AM_I is in bank 0 only."""
    bench = Bench()
    bench.bus.write_byte_data(0x68, 0x76, 4)
    bench.gyro.start()
    assert len(bench.gyro.sample()) == 4


def test_start_waits_until_data_are_valid():
    """60 ms after power-on, up to 150 ms more where the gyroscope was just switched off."""
    bench = Bench()
    bench.gyro.start()
    assert bench.clock.now() == pytest.approx(0.08, abs=0.01)
    bench.gyro.stop()
    began = bench.clock.now()
    bench.gyro.start()
    assert not any(math.isnan(number) for number in bench.gyro.sample())
    assert bench.clock.now() - began < 0.25


@BOTH
def test_stop_ends_a_stream_and_switches_off(board):
    """The sensor sleeps, and can be started again."""
    bench = Bench(board=board).streaming()
    bench.rows(2)
    bench.gyro.stop()
    assert bench.bus.read_byte_data(0x68, 0x4E) == 0
    with pytest.raises(Refused, match="has not been started"):
        bench.gyro.sample()
    bench.streaming()
    rows = bench.rows(3)
    assert rows[0, 0] == pytest.approx(0.01, abs=0.01)
    assert len(rows) == pytest.approx(300, abs=60)


def test_a_power_cut_loses_the_settings():
    """Behind it the sensor answers, and its stream says that it has lost its settings."""
    bench = Bench(board=True).streaming()
    bench.rows(2)
    bench.supply.command(volts=0.0)
    bench.clock.sleep(0.5)
    bench.supply.command(volts=3.3)
    with pytest.raises(NoReply, match="lost its settings"):
        bench.rows(10)
    bench.gyro.start()
    bench.gyro.begin(100.0)
    assert len(bench.rows(2)) > 100


def test_a_garbled_bus_is_found_out():
    """A start is refused or right; a stream of nonsense is no stream."""
    bench = Bench(faults=[{"kind": "garbled", "from": "1 s"}]).streaming()
    with pytest.raises((Garbled, NoReply)):
        bench.rows(20)
    for step in range(1, 60):
        wrong = [{"kind": "garbled", "from": f"{10_000 + step * 50} us", "until": "14 ms"}]
        bench = Bench(faults=wrong)
        try:
            bench.gyro.start()
        except (NoReply, Garbled, Rejected, WrongIdentity):
            continue
        bench.clock.wait_until(SECOND)
        assert bench.gyro.sample()[3] == pytest.approx(25.0, abs=0.01)
