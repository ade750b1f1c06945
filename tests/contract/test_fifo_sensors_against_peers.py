"""Every sensor with a FIFO against its peer: over the host's own bus, a bus that streams, and behind a board."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from behind_obc import BehindObc
from sensor_bench import BOARD_CHIPS, FIFO_CHIPS, ICM20948, Bench

from hil.model.errors import Garbled, NoReply, Refused

SECOND = 1_000_000_000
FIFO = pytest.mark.parametrize("chip", FIFO_CHIPS, ids=lambda chip: chip.named)
BOARD = pytest.mark.parametrize("chip", BOARD_CHIPS, ids=lambda chip: chip.named)
RATES = [pytest.param(chip, float(name), id=f"{chip.named} {name}") for chip in FIFO_CHIPS for name in chip.rates]
BOTH = pytest.mark.parametrize("board", [False, True], ids=["own bus", "board"])
PATHS = pytest.mark.parametrize("kind", [Bench, BehindObc], ids=["own bus", "obc"])
FLAG_CHIPS = [chip for chip in FIFO_CHIPS if chip.by_host]
BIASES = {"bias_x": ["1.5", "0", "0"], "bias_y": ["-20", "0", "0"], "bias_z": ["0.25", "0", "0"]}


@BOTH
@pytest.mark.parametrize(("chip", "rate"), sweeps.sample(RATES, 8))
def test_a_stream_has_every_sample_at_its_time(chip, board, rate):
    """At every rate samples come once each, and as far apart as they are."""
    bench = Bench(chip, board=board, truth=BIASES | {"odr_error": "0.01"}, settings={"rate": str(rate)})
    bench.streaming(rate)
    began = bench.clock.now()
    pause = bench.sensor.longest_pause
    rows = bench.rows(min(20.0, 4000.0 / rate), pause)
    period = 1 / 1.01 / rate
    assert len(rows) * period == pytest.approx(bench.clock.now() - began, abs=0.6)
    assert rows[0, 0] == pytest.approx(period, abs=period)
    assert rows[-1, 0] == pytest.approx(rows[0, 0] + (len(rows) - 1) * period, abs=period)
    steps = np.diff(rows[:, 0])
    assert steps == pytest.approx(period, rel=1e-4 if board and not chip.by_host else 0.05)
    assert rows[:, 1:].mean(axis=0) == pytest.approx([1.5, -20, 0.25, 25.0], abs=0.02)
    assert bench.sensor.end().lost_samples == 0


@FIFO
def test_both_ways_give_the_same_samples(chip):
    """The rows of a stream are the same numbers, whoever read the FIFO."""
    own, behind = (Bench(chip, board=board, truth=BIASES).streaming().rows(10) for board in (False, True))
    count = min(len(own), len(behind))
    assert count > 9.4 * chip.stream
    assert np.array_equal(own[:count, 1:], behind[:count, 1:])
    assert own[:count, 0] == pytest.approx(behind[:count, 0], abs=0.01)


@BOARD
def test_times_over_a_board_are_device_time_from_the_watermarks(chip):
    """An oscillator 0.5 % slow is seen to a microsecond, however late frames are read."""
    bench = Bench(chip, board=True, truth={"odr_error": "-0.005"})
    bench.bus.delay_ns = dict.fromkeys(range(3, 40, 4), 25000000)
    rows = bench.streaming().rows(20)
    expected = np.arange(1, len(rows) + 1) * 0.01 / 0.995
    assert rows[:, 0] == pytest.approx(expected, abs=2e-6)


@BOARD
@BOTH
def test_the_report_tells_how_it_went(chip, board):
    """Frames, none lost, and of a board the drift of its clock."""
    bench = Bench(chip, board=board).streaming()
    bench.rows(5)
    report = bench.sensor.end()
    assert report.lost == report.lost_samples == 0
    assert report.frames == 5
    assert report.drift == (1e-5 if board else None)
    with pytest.raises(Refused, match="does not stream"):
        bench.sensor.drain()
    register, off = chip.fifo_off
    assert bench.read(register) == bytes([off])


@BOARD
def test_a_frame_that_was_lost_leaves_its_time_empty(chip):
    """Two seconds are missing, and what follows stands where it belongs."""
    bench = Bench(chip, board=True, truth={"odr_error": "0.01"})
    bench.bus.skip = {4, 5}
    rows = bench.streaming().rows(10)
    steps = np.diff(rows[:, 0])
    gaps = np.flatnonzero(steps > 0.05)
    assert gaps.tolist() == [399]
    assert steps[399] == pytest.approx(201 * 0.01 / 1.01, abs=1e-5)
    assert bench.sensor.end().lost == 2


@BOARD
def test_the_first_frame_may_be_lost_too(chip):
    """Times count from where the FIFO began to fill, not from the first frame that came."""
    bench = Bench(chip, board=True)
    bench.bus.skip = {0}
    assert bench.streaming().rows(3)[0, 0] == pytest.approx(1.01, abs=1e-6)


@BOARD
def test_edges_that_are_no_watermark_do_no_harm(chip):
    """A stray edge on the interrupt line brings no sample twice and shifts none."""
    bench = Bench(chip, board=True)
    bench.bus.spurious = 2
    bench.streaming()
    rows = [bench.rows(2)]
    bench.clock.sleep(0.234)
    bench.bus._trigger()
    rows.append(bench.rows(3))
    rows = np.concatenate(rows)
    assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) * 0.01, abs=2e-6)


@BOARD
def test_a_fifo_that_overflows_leaves_time_empty_and_is_counted(chip):
    """The oldest samples go: the rows after the gap stand at their own time."""
    bench = Bench(chip).streaming()
    rows = [bench.rows(2), bench.rows(4, 4.0), bench.rows(2)]
    before, rows = len(rows[0]), np.concatenate(rows)
    lost = bench.sensor.end().lost_samples
    assert lost == pytest.approx(400 - chip.capacity + 5, abs=2)  # five came while the FIFO was read
    expected = np.arange(1, len(rows) + 1) * 0.01
    expected[before:] += 0.01 * lost
    assert rows[:, 0] == pytest.approx(expected, abs=0.011)


def overflowing(kind, chip):
    """Return a bench whose FIFO has overflowed for two seconds, the rows before, and the pause between reads."""
    bench = kind(chip).streaming()
    pause = bench.sensor.longest_pause
    rows = bench.rows(4 * pause)
    bench.clock.sleep(2.0)
    return bench, rows, pause


@PATHS
@pytest.mark.parametrize("chip", [chip for chip in FLAG_CHIPS if chip.counts_losses], ids=lambda chip: chip.named)
def test_a_loss_that_a_flag_tells_leaves_time_empty_and_is_counted(chip, kind):
    """How many came beside those that are there follows from time."""
    bench, before, pause = overflowing(kind, chip)
    began = bench.clock.now()
    rows = np.concatenate((before, bench.sensor.drain(), bench.rows(4 * pause)))
    held = chip.capacity / chip.stream
    assert bench.sensor.end().lost_samples == pytest.approx(2 * chip.stream - chip.capacity, abs=3)
    assert np.diff(rows[:, 0]).max() == pytest.approx(2 - held, abs=0.03)
    assert rows[-1, 0] == pytest.approx(before[-1, 0] + 2 + bench.clock.now() - began, abs=0.03)


@PATHS
@pytest.mark.parametrize("chip", [chip for chip in FLAG_CHIPS if not chip.counts_losses], ids=lambda chip: chip.named)
def test_a_loss_that_a_flag_tells_for_ever_ends_the_stream(chip, kind):
    """How many samples were lost is unknown, so that no row after them has a time."""
    bench, *_ = overflowing(kind, chip)
    with pytest.raises(Garbled, match="its FIFO has overflowed"):
        bench.sensor.drain()


@BOARD
def test_an_overflow_while_the_board_is_busy_is_placed_by_the_sensors_own_counter(chip):
    """A turn that comes 0.3 s late finds other packets than those up to the watermark."""
    bench = Bench(chip, board=True, settings={"rate": "1000"})
    bench.bus.delay_ns = {2: 3 * SECOND // 10}
    rows = bench.streaming(1000.0).rows(4, 0.2)
    lost = 300 - chip.capacity // 2
    assert bench.sensor.end().lost_samples == lost
    expected = np.arange(1, len(rows) + 1) * 0.001
    expected[chip.capacity :] += 0.001 * lost
    assert rows[:300, 0] == pytest.approx(expected[:300], abs=1e-6)
    assert np.diff(rows[:, 0]).min() > 0
    assert rows[-200:, 0] == pytest.approx(expected[-200:], abs=1e-6)


@FIFO
@BOTH
def test_a_rate_beyond_the_range_is_nan(chip, board):
    """At the rail the true rate is unknown; the sensor is not called stuck."""
    bench = Bench(chip, board=board, faults=[{"kind": "saturated", "from": "2 s", "until": "3 s"}]).streaming()
    rows = bench.rows(5)
    wrong = np.isnan(rows[:, 1:4]).all(axis=1)
    assert wrong.sum() == pytest.approx(chip.stream, abs=2)
    assert not np.isnan(rows[:, 4]).any()


@FIFO
@BOTH
def test_a_stuck_sensor_is_no_reply(chip, board):
    """Its FIFO fills and its numbers stay; what came before is given out first."""
    bench = Bench(chip, board=board, faults=[{"kind": "stuck", "from": "3 s"}]).streaming()
    with pytest.raises(NoReply, match="sensor: .* consecutive samples are equal") as caught:
        for _ in range(10):
            bench.rows(1)
    assert caught.value.device == "sensor"
    assert bench.clock.now() < 5.2


@FIFO
def test_single_samples_of_a_stuck_sensor_are_no_reply(chip):
    """Sixteen equal ones; samples that are read faster than they come do not count."""
    bench = Bench(chip, faults=[{"kind": "stuck", "from": "1 s"}])
    bench.sensor.start()
    for _ in range(100):
        bench.sensor.sample()
    bench.clock.wait_until(SECOND)
    with pytest.raises(NoReply, match="16 consecutive samples are equal"):
        for _ in range(20):
            bench.sensor.sample()
            bench.clock.sleep(0.01)


@FIFO
@BOTH
def test_a_dead_sensor_is_no_reply_of_the_sensor(chip, board):
    """No acknowledge on its bus is its own fault, also behind a board."""
    bench = Bench(chip, board=board, faults=[{"kind": "dead", "from": "3200 ms"}]).streaming()
    with pytest.raises(NoReply) as caught:
        bench.rows(10)
    assert caught.value.device == "sensor"
    assert bench.clock.now() < 7.5


@BOARD
def test_frames_before_a_missing_acknowledge_are_not_lost(chip):
    """They come with the drain, the fault with the next one."""
    bench = Bench(chip, board=True, faults=[{"kind": "dead", "from": "2580 ms", "until": "4 s"}])
    bench.sensor.start()
    bench.clock.wait_until(SECOND // 10)
    bench.sensor.begin(100.0)
    bench.clock.wait_until(2_590_000_000)
    bench.bus._trigger()
    assert len(bench.sensor.drain()) == pytest.approx(200, abs=50)
    for _ in range(2):
        with pytest.raises(NoReply, match="no acknowledge at address 0x[0-9a-f]+ in frame"):
            bench.sensor.drain()


@BOARD
def test_a_silent_link_is_the_fault_of_the_board(chip):
    """The sensor is not blamed."""
    bench = Bench(chip, board=True).streaming()
    bench.rows(2)
    bench.bus.link_is_silent = True
    bench.bus.running.waiting.clear()
    with pytest.raises(NoReply) as caught:
        bench.rows(10)
    assert caught.value.device == "obc"
    with pytest.raises(NoReply):
        bench.sensor.stop()


@BOARD
def test_an_interrupt_line_that_is_not_connected_is_found(chip):
    """The sensor samples, its FIFO fills, and no frame comes."""
    bench = Bench(chip, board=True)
    bench.bus._trigger = lambda: None
    bench.streaming()
    bench.bus.running, running = None, bench.bus.running
    with pytest.raises(NoReply, match="sensor: .* its FIFO fills.*INT1"):
        bench.rows(5)
    assert running.number == 0


@BOARD
def test_a_line_and_a_rate_of_the_wiring(chip):
    """The OBC listens to the line that the wire names; another rate than the wire's is refused."""
    bench = Bench(chip, board=True, settings={"line": "1"}).streaming()
    assert bench.bus.line == 1
    with pytest.raises(Refused, match="is already streaming"):
        bench.sensor.begin(100.0)
    bench.sensor.stop()
    with pytest.raises(Refused, match="has not been started"):
        bench.sensor.begin(100.0)
    bench.sensor.start()
    with pytest.raises(Refused, match="runs at 100 Hz, not at 50 Hz"):
        bench.sensor.begin(50.0)


@BOARD
def test_single_samples_while_it_streams(chip):
    """They disturb nothing."""
    bench = Bench(chip, board=True, truth=BIASES).streaming()
    rows = []
    for _ in range(40):
        bench.clock.sleep(0.1)
        assert bench.sensor.sample()[1] == pytest.approx(-20, abs=0.1)
        rows.append(bench.sensor.drain())
    rows = np.concatenate(rows)
    assert rows[:, 0] == pytest.approx(np.arange(1, len(rows) + 1) * 0.01, abs=2e-6)


@FIFO
@BOTH
def test_stop_ends_a_stream_and_switches_off(chip, board):
    """The sensor sleeps, and can be started again."""
    bench = Bench(chip, board=board).streaming()
    bench.rows(2)
    bench.sensor.stop()
    register, asleep = chip.sleep
    assert bench.read(register) == bytes([asleep])
    with pytest.raises(Refused, match="has not been started"):
        bench.sensor.sample()
    bench.streaming()
    rows = bench.rows(3)
    assert rows[0, 0] == pytest.approx(0.01, abs=0.01)
    assert len(rows) == pytest.approx(3 * chip.stream, abs=60)


@FIFO
def test_a_power_cut_loses_the_settings(chip):
    """After it the sensor answers, and its stream says that it has lost its settings."""
    bench = Bench(chip, board=True).streaming()
    bench.rows(2)
    bench.supply.command(volts=0.0)
    bench.clock.sleep(0.5)
    bench.supply.command(volts=3.3)
    with pytest.raises(NoReply, match="lost its settings"):
        bench.rows(10)
    assert len(bench.streaming().rows(2)) > 100


@FIFO
@BOTH
def test_a_garbled_bus_is_found_out(chip, board):
    """A stream of nonsense is no stream; that a start is refused or right is told of every chip."""
    bench = Bench(chip, board=board, faults=[{"kind": "garbled", "from": "1 s"}]).streaming()
    with pytest.raises((Garbled, NoReply)):
        bench.rows(20)


@PATHS
def test_a_host_reads_a_fifo_before_it_is_full(kind):
    """At seven tenths, as long as a tenth of a second is left; at half where an older record answers."""
    for rate, sparing, part in ((112.5, True, 0.7), (112.5, False, 0.5), (225.0, True, 1 - 0.1 * 225 / 64)):
        bench = kind(ICM20948, settings={"rate": f"{rate} Hz"}, sparing=sparing).streaming(rate)
        assert bench.sensor.longest_pause == pytest.approx(part * 64 / rate)
