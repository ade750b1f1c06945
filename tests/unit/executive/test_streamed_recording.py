"""Recordings of roles that sample by themselves."""

from __future__ import annotations

import numpy as np
import pytest
from case_parts import Case

from hil.executive.cases.facade import Facade
from hil.instruments.sampled import Channel, StreamReport
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import Misused, NoReply, Refused

PERIOD = 0.01 * (1 + 1e-4)
"""Of the device: its quartz is slow."""


class Gyroscope:
    """A role in memory that has a sample every period of its own clock; `dead_after` seconds it falls silent."""

    def __init__(self, clock, dead_after=np.inf, gap=(0.0, 0.0)):
        self.clock = clock
        self.calls = []
        self._dead_after = dead_after
        self._gap = gap
        self._given = 0

    longest_pause = 0.5

    def channels(self):
        """Return one channel."""
        return (Channel("x", "deg/s"),)

    def sample(self):
        """Not asked of a streamed role."""
        raise AssertionError

    def begin(self, rate):
        """Start to count."""
        self.calls.append(("begin", rate))
        self._start = self.clock.now()

    def drain(self):
        """Return what has come since the last call."""
        elapsed = self.clock.now() - self._start
        if elapsed > self._dead_after:
            raise NoReply("obc", "no frame for 1 s", "look at its cable")
        count = int(elapsed / PERIOD)
        times = np.arange(self._given, count) * PERIOD
        self._given = count
        times = times[(times < self._gap[0]) | (times >= self._gap[1])]
        return np.column_stack((times, np.sin(times)))

    def end(self):
        """Stop."""
        self.calls.append(("end",))
        return StreamReport(frames=7, lost=1, drift=-1e-4, drift_uncertainty=1e-6)


def case_with(folder, **options):
    """Return a case, its gyroscope behind a board, and the façade."""
    case = Case(folder)
    role = Gyroscope(case.clock, **options)
    wire = Wire(role="gyroscope", instance="", instrument="gyro1")
    gyro = InstrumentSpec(name="gyro1", driver="none", dut=True)
    board = InstrumentSpec(name="obc", driver="none")
    effects = case.run.effects
    return case, role, Facade(wire, gyro, role, effects, case.run, {"gyro1": gyro, "obc": board})


def test_a_streamed_role_is_begun_emptied_and_ended(tmp_path):
    """Every sample of the device is stored once, with its own time, until the duration is covered."""
    case, role, facade = case_with(tmp_path)
    case.clock.sleep(3.0)
    recording = case.run.record("rest", facade, duration=10.0, rate=100.0)
    assert role.calls == [("begin", 100.0), ("end",)]
    times = np.arange(len(recording)) * PERIOD
    assert np.allclose(recording.time, 3.0 + times, atol=1e-9)
    assert np.array_equal(recording["x"], np.sin(times))
    assert 10.0 <= times[-1] + 0.01 < 10.02


def test_how_the_stream_went_is_told_and_written_down(tmp_path):
    """Lost frames and the drift of the device's clock are in the journal, and at hand for checks."""
    case, _, facade = case_with(tmp_path)
    recording = case.run.record("rest", facade, duration=1.0, rate=100.0)
    assert (recording.stream.lost, recording.stream.drift) == (1, -1e-4)
    result = case.written.of("effect")[-1]["result"]
    assert result.items() >= {"frames": 7, "lost": 1, "drift": -1e-4, "drift_uncertainty": 1e-6}.items()
    assert result["sha256"] == case.written.of("recording-end")[-1]["sha256"]


def test_a_lost_part_leaves_a_gap_in_device_time(tmp_path):
    """Samples that never came are missing from the times, and the gap is told at the end."""
    case, _, facade = case_with(tmp_path, gap=(0.4, 0.7))
    case.run.record("rest", facade, duration=1.0, rate=100.0)
    assert case.written.of("recording-end")[-1]["gaps"] == pytest.approx(0.3, abs=0.02)


def test_silence_ends_the_recording_incomplete_and_counts_for_the_device_that_is_silent(tmp_path):
    """What came before is kept; the fault is the board's, not the sensor's behind it, and the stream is ended."""
    case, role, facade = case_with(tmp_path, dead_after=2.2)
    with pytest.raises(NoReply):
        case.run.record("rest", facade, duration=10.0, rate=100.0)
    end = case.written.of("recording-end")[-1]
    assert not end["complete"]
    assert end["rows"] > 190
    fault = case.written.of("fault")[-1]
    assert (fault["device"], fault["dut"]) == ("obc", False)
    assert role.calls[-1] == ("end",)


def test_a_streamed_role_is_recorded_alone(tmp_path):
    """Two clocks do not make one table."""
    case, _, facade = case_with(tmp_path)
    with pytest.raises(Misused, match="alone"):
        case.run.record("rest", facade, case.field, duration=1.0, rate=10.0)


def test_a_stream_that_is_refused_says_why(tmp_path):
    """There is nothing to end then, and what is said of that is not what the case hears."""
    case, role, facade = case_with(tmp_path)

    def refuses(*_):
        raise Refused("gyro1 runs at 14.9 Hz, not at 10 Hz", "record at that rate")

    def nothing_to_end():
        raise Refused("gyro1 does not stream", "call begin() first")

    role.begin, role.end = refuses, nothing_to_end
    with pytest.raises(Refused, match=r"runs at 14.9 Hz, not at 10 Hz"):
        case.run.record("rest", facade, duration=1.0, rate=10.0)
    with (
        pytest.raises(Refused, match=r"runs at 14.9 Hz, not at 10 Hz"),
        case.run.record.during("beside", facade, rate=10.0),
    ):
        pass
    assert [end["complete"] for end in case.written.of("recording-end")] == [False, False]
