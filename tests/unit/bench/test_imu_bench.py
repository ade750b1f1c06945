"""The bench of five sensors side by side, two of each: every role of every chip, simulated and from its bytes."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.bench.binding import bind_replayed, bind_simulated
from hil.bench.file.reading import load_bench
from hil.wire.transcript import Transcript

ROOT = Path(__file__).parents[3]
EXPECTED = {
    "gyroscope.bno": ((0.06, -0.12, 0.02), 0.6),
    "gyroscope.lsm": ((0.42, -1.31, 0.77), 0.3),
    "gyroscope.icm": ((-0.38, 0.55, 0.21), 0.6),
    "gyroscope.bmi": ((0.11, -0.09, 0.04), 0.6),
    "accelerometer.lsm": ((0.0, 0.0, 9.8), 0.3),
    "accelerometer.icm": ((0.0, 0.0, 9.8), 0.3),
    "accelerometer.bmi": ((0.0, 0.0, 9.8), 0.3),
    "magnetometer.bno": ((-21.4, 8.3, -37.9), 4.0),
    "magnetometer.lsm": ((22.8, -4.1, -40.2), 15.0),
    "magnetometer.icm": ((19.6, -6.0, -38.8), 3.0),
    "magnetometer.lis": ((20.9, -3.6, -41.0), 15.0),
    "gyroscope.bno2": ((-0.03, 0.08, -0.05), 0.6),
    "gyroscope.lsm2": ((-0.61, -0.84, 1.02), 0.3),
    "gyroscope.icm2": ((0.12, 0.37, -0.44), 0.6),
    "gyroscope.bmi2": ((-0.07, 0.13, 0.09), 0.6),
    "accelerometer.lsm2": ((0.0, 0.0, 9.8), 0.3),
    "accelerometer.icm2": ((0.0, 0.0, 9.8), 0.3),
    "accelerometer.bmi2": ((0.0, 0.0, 9.8), 0.3),
    "magnetometer.bno2": ((-18.9, 11.2, -40.1), 4.0),
    "magnetometer.lsm2": ((25.1, -2.6, -38.8), 15.0),
    "magnetometer.icm2": ((17.3, -8.4, -41.9), 3.0),
    "magnetometer.lis2": ((23.4, -5.0, -39.3), 15.0),
}


def conversation(bench):
    """Put every sensor to sleep that never woke, start all, sample all, and put them to sleep; return the samples."""
    sensors = {name: role for name, role in bench.roles.items() if name not in {"obc", "relays", "thermal"}}
    for sensor in sensors.values():
        sensor.stop()
    for sensor in sensors.values():
        sensor.start()
    samples = {}
    for _ in range(3):
        bench.clock.sleep(0.1)
        samples |= {name: sensor.sample() for name, sensor in sensors.items()}
    for sensor in sensors.values():
        sensor.stop()
    return samples


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return the bench, the samples of one conversation, and its record."""
    spec = load_bench(ROOT / "fixtures/benches", "imu", ROOT)
    path = tmp_path_factory.mktemp("imu") / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        bench = bind_simulated(spec, transcript)
        try:
            samples = conversation(bench)
        finally:
            bench.close()
        transcript.flush()
    return spec, samples, path


def test_every_role_gives_its_truth(recorded):
    """In the unit of the role, at the widest ranges, with the temperature of the chamber."""
    _, samples, _ = recorded
    assert samples.keys() == {*EXPECTED, "thermometer.reference"}
    for name, (axes, close) in EXPECTED.items():
        assert samples[name][:3] == pytest.approx(axes, abs=close), name
        assert samples[name][3] == pytest.approx(22.0, abs=1.1), name
    assert samples["thermometer.reference"] == pytest.approx((22.08,), abs=0.05)


def test_the_same_samples_from_the_bytes(recorded):
    """Two dies, two addresses, three buses: the record of each instrument has all of it."""
    spec, samples, path = recorded
    bench = bind_replayed(spec, Transcript(None), path, lambda: "")
    try:
        assert conversation(bench) == samples
        assert bench.playback.exhausted
    finally:
        bench.close()
