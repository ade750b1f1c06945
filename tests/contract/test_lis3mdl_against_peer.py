"""What is peculiar to the LIS3MDL, driver against peer; what all sensors share is tested for the family."""

from __future__ import annotations

import math

import pytest
from sensor_bench import LIS3MDL, Bench


def test_samples_come_once_each_at_the_sensors_rate():
    """Two hundred samples at 80 Hz take two and a half seconds, and none comes twice."""
    bench = Bench(LIS3MDL)
    bench.sensor.start()
    began = bench.clock.now()
    samples = [bench.sensor.sample() for _ in range(200)]
    assert bench.clock.now() - began == pytest.approx(199 / 80, abs=0.01)
    assert len({sample[:3] for sample in samples}) > 190


def test_a_wider_range_holds_what_a_narrow_one_cannot():
    """500 uT is beyond 4 gauss though not at a rail, and within 8."""
    truth = {"offset": ["500", "0", "0"], "noise": ["0.02"] * 3}
    for settings, x in (({}, math.nan), ({"range": "8 gauss"}, 500.0)):
        bench = Bench(LIS3MDL, truth=truth, settings=settings)
        bench.sensor.start()
        assert bench.sensor.sample()[0] == pytest.approx(x, abs=0.2, nan_ok=True)


def listened(bench):
    """Return the transfers of a bus from now on: what is written, and how much is read."""
    heard, transfer = [], bench.bus.transfer

    def listening(messages):
        heard.append([content for _, content in messages])
        return transfer(messages)

    bench.bus.transfer = listening
    return heard


def test_a_sample_is_one_transfer_and_the_temperature_one_twice_a_second():
    """Status and axes are read together; a die warms slowly."""
    bench = Bench(LIS3MDL, settings={"rate": "5 Hz"})
    bench.sensor.start()
    bench.sensor.sample()
    heard = listened(bench)
    for _ in range(9):
        bench.clock.sleep(0.19)
        bench.sensor.sample()
    read = [content for content in heard if content != [b"\x0f", 1]]
    assert sum(content == [b"\xae", 2] for content in read) == 3  # of 1.8 s
    assert {(bytes(content[0]), content[1]) for content in read} == {(b"\xa7", 7), (b"\xae", 2)}


def test_samples_are_evenly_apart_whether_the_temperature_is_read_or_not():
    """A recording is as long as its samples are apart: the first one, which reads it, comes no later than the last."""
    bench = Bench(LIS3MDL, settings={"rate": "5 Hz"})
    bench.sensor.start()
    bench.clock.sleep(0.9)
    took = []
    for _ in range(8):
        bench.clock.wait_until(bench.clock.now_ns() // 200_000_000 * 200_000_000 + 290_000_000)
        began = bench.clock.now()
        bench.sensor.sample()
        took.append(bench.clock.now() - began)
    assert took == pytest.approx([took[0]] * 8, abs=1e-8)


def test_an_older_record_is_asked_what_it_was_asked():
    """Status, axes and temperature of every sample, each in a transfer of its own."""
    bench = Bench(LIS3MDL, settings={"rate": "5 Hz"}, sparing=False)
    bench.sensor.start()
    bench.sensor.sample()
    bench.clock.sleep(0.2)
    heard = listened(bench)
    bench.sensor.sample()
    assert heard == [[b"\x27", 1], [b"\xa8", 6], [b"\xae", 2]]


def test_a_sample_that_comes_between_status_and_axes_is_not_lost():
    """The status does not tell of it yet, and reading its axes takes the flag away."""
    bench = Bench(LIS3MDL, settings={"rate": "5 Hz"})
    bench.sensor.start()
    bench.sensor.sample()
    transfer, old = bench.bus.transfer, [True]

    def slow(messages):
        (reply,) = transfer(messages)
        if messages[0][1] == b"\xa7" and old:
            old.clear()
            bench.clock.sleep(0.2)
            return [b"\x00" + transfer([(messages[0][0], b"\xa8"), (messages[0][0], 6)])[0]]
        return [reply]

    bench.bus.transfer = slow
    began = bench.clock.now()
    first = bench.sensor.sample()
    assert bench.clock.now() - began < 0.21
    assert bench.sensor.sample()[:3] != first[:3]
