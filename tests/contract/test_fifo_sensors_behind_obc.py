"""Drivers of sensors behind the OBC link: sensor, board and line are simulated, every byte is sent."""

from __future__ import annotations

import numpy as np
import pytest
from behind_obc import BehindObc
from sensor_bench import BME680, BMI088, CHIPS, IIM42652, Bench

from hil.model.errors import DeviceFault, NoReply

BIASES = {"bias_x": ["1.5", "0", "0"], "bias_y": ["-20", "0", "0"], "bias_z": ["0.25", "0", "0"]}


def test_the_same_samples_as_over_the_hosts_own_bus():
    """One sensor, one seed: one series of numbers, at the same times within a sample."""
    own = Bench(IIM42652, truth=BIASES).streaming().rows(10)
    behind = BehindObc(truth=BIASES).streaming().rows(10)
    count = min(len(own), len(behind))
    assert count > 880
    assert own[:count, 1:4].mean(axis=0) == pytest.approx(behind[:count, 1:4].mean(axis=0), abs=0.005)
    assert own[:count, 4].tolist() == behind[:count, 4].tolist()
    assert own[:count, 0] == pytest.approx(behind[:count, 0], abs=0.01)


@pytest.mark.parametrize("chip", [*CHIPS, BME680], ids=lambda chip: f"{chip.named} {chip.role}")
def test_one_sample_is_the_same_number(chip):
    """A polled read of every sensor comes through the link unchanged: without noise, the same numbers by both ways."""
    none = ["0", "0", "0"]
    quiet = {
        "gyroscope": {"white": none, "flicker": none, "random_walk": none},
        "accelerometer": {"accelerometer": {**chip.truth.get("accelerometer", {}), "white": none}},
        "magnetometer": {"noise": none},
        "thermometer": {"noise": "0"},
    }[chip.role]
    samples = []
    for kind in (Bench, BehindObc):
        bench = kind(chip, truth=chip.truth | quiet)
        bench.sensor.start()
        samples.append([bench.sensor.sample() for _ in range(3)])
        bench.sensor.stop()
        assert bench.read(chip.sleep[0]) == bytes([chip.sleep[1]])
    assert samples[0] == samples[1]
    assert samples[0][0] == pytest.approx(chip.expected, abs=0.1)


def test_a_fifo_that_the_host_reads_itself():
    """The host's own bus and the link give the same series, each row where it belongs."""
    own = Bench(BMI088, truth=BIASES).streaming().rows(5)
    behind = BehindObc(BMI088, truth=BIASES).streaming().rows(5)
    count = min(len(own), len(behind))
    assert count > 400
    assert own[:count, 1:4].mean(axis=0) == pytest.approx(behind[:count, 1:4].mean(axis=0), abs=0.02)
    assert own[:count, 0] == pytest.approx(behind[:count, 0], abs=0.02)


@pytest.mark.parametrize("rate", [12.5, 100, 1000])
def test_times_are_those_of_the_boards_clock(rate):
    """A board 200 ppm fast says so in times and in the report; none is put right in silence."""
    bench = BehindObc(obc={"clock_drift": "0.0002"}, settings={"rate": str(rate)}, truth={"odr_error": "-0.01"})
    bench.streaming(rate)
    rows = bench.rows(60, bench.sensor.longest_pause)
    period = 1.0002 / (0.99 * rate)
    assert rows[:, 0] == pytest.approx(period * np.arange(1, len(rows) + 1), abs=5e-6)
    report = bench.sensor.end()
    assert report.lost == report.lost_samples == 0
    assert report.drift == pytest.approx(2e-4, abs=1e-6)


def test_frames_that_are_lost_leave_their_time_empty():
    """They are counted, and the rest stands where it belongs."""
    faults = [{"kind": "lose-frames", "from": "4 s", "frames": "3"}]
    bench = BehindObc(obc_faults=faults).streaming()
    rows = bench.rows(12)
    steps = np.diff(rows[:, 0])
    assert np.isclose(steps, 0.01, atol=1e-5).sum() == len(steps) - 1
    assert steps.max() == pytest.approx(3.01, abs=1e-5)
    assert bench.sensor.end().lost == 3


def test_no_acknowledge_is_the_sensors():
    """The board answers, the sensor does not."""
    bench = BehindObc(faults=[{"kind": "dead", "from": "4 s"}]).streaming()
    with pytest.raises(NoReply) as caught:
        bench.rows(12)
    assert caught.value.device == "sensor"
    assert bench.clock.now() < 8.5


def test_frames_that_wait_in_the_board_are_its_fault():
    """The sensor's FIFO is read, so it is not the sensor that is silent."""
    bench = BehindObc(obc_faults=[{"kind": "stall", "from": "4 s", "until": "60 s"}]).streaming()
    with pytest.raises(NoReply, match="reads that sensor's FIFO") as caught:
        bench.rows(12)
    assert caught.value.device == "obc"


def test_a_sensor_asleep_is_the_sensors():
    """The board answers, and no interrupt comes."""
    bench = BehindObc(faults=[{"kind": "asleep", "from": "4 s"}]).streaming()
    with pytest.raises(NoReply, match="lost its settings") as caught:
        bench.rows(12)
    assert caught.value.device == "sensor"


@pytest.mark.parametrize("fault", ["dead", "reset"])
def test_a_link_that_fails_is_the_boards(fault):
    """Whatever the sensor does."""
    bench = BehindObc(obc_faults=[{"kind": fault, "from": "4 s"}]).streaming()
    with pytest.raises(DeviceFault) as caught:
        bench.rows(12)
    assert caught.value.device == "obc"
    with pytest.raises(DeviceFault):
        bench.sensor.end()


def test_stop_and_stream_again():
    """A second stream counts from its own beginning."""
    bench = BehindObc().streaming()
    bench.rows(3)
    bench.sensor.stop()
    rows = bench.streaming().rows(3)
    assert rows[:, 0] == pytest.approx(0.01 * np.arange(1, len(rows) + 1), abs=5e-6)
    assert bench.sensor.end().lost == 0
