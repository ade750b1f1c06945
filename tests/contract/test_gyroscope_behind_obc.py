"""The gyroscope behind the board, driver to plant: streams with faults on the way, replayed bit by bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from adcs_bench import bound
from obc_bench import obc_bench

from hil.bench.binding import bind_replayed, bind_simulated
from hil.model.bench import Wire
from hil.model.errors import DeviceFault
from hil.wire.transcript import Transcript


def bench_with(**choices):
    """Return the bench with the gyroscope wired, and coarse physics that nobody needs here."""
    spec = obc_bench(**choices)
    twin = spec.simulated
    plants = tuple(replace(plant, grid_s=1.0) for plant in twin.plants)
    wire = Wire(role="gyroscope", instance="", instrument="gyro1")
    return replace(spec, wiring=(*spec.wiring, wire), simulated=replace(twin, plants=plants))


def recorded(bench, seconds):
    """Stream for a while, and return rows and report."""
    gyroscope = bench.roles["gyroscope"]
    gyroscope.start()
    gyroscope.begin(100.0)
    blocks = []
    for _ in range(seconds):
        bench.clock.sleep(1.0)
        blocks.append(gyroscope.drain())
    return np.concatenate(blocks), gyroscope.end()


def test_every_sample_in_device_time():
    """Samples come 10 ms apart by the sensor, 100 ppm more by a board that is 100 ppm fast; the report tells it."""
    with bound(bench_with(obc={"clock_drift": "0.0001"}, gyro={"bias_x": ["1.5", "0", "0"]})) as bench:
        rows, report = recorded(bench, 120)
    assert len(rows) == pytest.approx(12_000, abs=150)
    assert np.diff(rows[:, 0]) == pytest.approx(0.01 * 1.0001, abs=3e-6)
    assert (rows[-1, 0] - rows[0, 0]) / (len(rows) - 1) == pytest.approx(0.010001, rel=1e-7)
    assert rows[:, 1].mean() == pytest.approx(1.5, abs=0.01)
    assert report.lost == report.lost_samples == 0
    assert report.drift == pytest.approx(1e-4, abs=3 * report.drift_uncertainty)


def test_frames_lost_on_the_way_leave_a_gap():
    """Their time stays empty, and the report counts them."""
    faults = ({"kind": "lose-frames", "from": "10 s", "frames": "2"},)
    with bound(bench_with(faults=faults)) as bench:
        rows, report = recorded(bench, 20)
    steps = np.diff(rows[:, 0])
    assert report.lost == 2
    assert (steps > 0.5).sum() == 1
    assert np.isclose(steps, 0.01, atol=1e-5).sum() == len(steps) - 1


def test_who_is_to_blame():
    """A missing acknowledge is the sensor's fault, a reset the board's."""
    for kind, device in (("nack", "gyro1"), ("reset", "obc1")):
        more = {"address": "0x68"} if kind == "nack" else {}
        with bound(bench_with(faults=({"kind": kind, "from": "5 s", **more},))) as bench:
            with pytest.raises(DeviceFault) as caught:
                recorded(bench, 20)
            assert caught.value.device == device


def test_a_replayed_stream_is_the_same(tmp_path):
    """The record of the board's line gives every row again."""
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        bench = bind_simulated(bench_with(), transcript)
        try:
            rows, report = recorded(bench, 15)
        finally:
            bench.close()
        transcript.flush()
    bench = bind_replayed(bench_with(), Transcript(None), path, lambda: "step 1")
    try:
        again, report_again = recorded(bench, 15)
        assert bench.playback.exhausted
    finally:
        bench.close()
    assert np.array_equal(rows, again, equal_nan=True)
    assert report == report_again


def test_a_restored_world_streams_on():
    """Board and gyroscope given their state in the middle of a stream send the same bytes as those that went on."""

    def sent_on(bench):
        bench.clock.sleep(5.0)
        return bench.world.state()

    with bound(bench_with()) as bench:
        gyroscope = bench.roles["gyroscope"]
        gyroscope.start()
        gyroscope.begin(100.0)
        bench.clock.sleep(3.3)
        state = bench.world.state()
        expected = sent_on(bench)
    with bound(bench_with()) as other:
        other.clock.wait_until(state["clock"]["now_ns"])
        other.world.restore(state)
        assert sent_on(other) == expected
