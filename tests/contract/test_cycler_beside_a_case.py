"""A cycler recorded beside a case: its own test from the first line to the last, judged and waited for row by row."""

from __future__ import annotations

import itertools

import pytest
from case_parts import Case, limit, monitor, scheduler
from cell_stream import adopt, facade_of
from cycler_bench import cycler

from hil.model.errors import NotInTime, Tripped


@pytest.fixture
def bench():
    """A cycler of level 2 whose half-cycles last twenty lines."""
    with cycler(lines=20) as made:
        yield made


def held(bench, folder, *monitors):
    """Return a case that holds the cycler, and its façade."""
    case = Case(folder)
    case.clock = bench.clock
    adopt(case, scheduler(bench.clock, *monitors, flags=case.flags, watch=case.watch))
    return case, facade_of(case, bench.role)


def test_a_test_is_followed_to_its_end(bench, tmp_path):
    """Charge and discharge are seen in the rows in which they begin, and the end when the device tells it."""
    case, facade = held(bench, tmp_path)
    facade.prepare(cycles=2)
    with case.run.record.during("test", facade, rate=0.2) as test:
        facade.start()
        seen = [test.until("phase", equals=phase, within=300) for phase in (1.0, -1.0, 1.0, -1.0)]
        assert test.latest("voltage").unit == "V"
        ended = test.until_over(within=300)
    recording = test.recording
    changes = [
        time for time, (a, b) in zip(recording.time[1:], itertools.pairwise(recording["phase"]), strict=True) if a != b
    ]
    assert seen[1:] == pytest.approx([time for time in changes if time > seen[0]][:3])
    assert recording["cycle"].max() == 2
    assert recording.stream.lost == 0
    assert recording.time[-1] <= ended
    assert facade.state() == "ended"


def test_its_rows_feed_the_envelope(bench, tmp_path):
    """While it waits it is asked; while it tests nobody asks beside its lines, and a row beyond a limit trips."""
    asked = []
    spec = limit("cell-voltage", maximum=4.3, output="cycler", period=10.0, max_age=60.0)
    watching = monitor(bench.clock, spec, value=lambda: asked.append(bench.clock.now()) or 3.6)
    case, facade = held(bench, tmp_path, watching)
    facade.prepare(cycles=2)
    with (
        pytest.raises(Tripped, match=r"voltage 4.4 V is above 4.3 V, at .* s of recording 001-test_x-test"),
        case.run.record.during("test", facade, rate=0.2) as test,
    ):
        case.scheduler.sleep(30.0)
        assert len(asked) == 2
        facade.start()
        test.until("phase", equals=1.0, within=60.0)
        before = len(asked)
        case.scheduler.sleep(60.0)
        assert len(asked) == before
        bench.cell.lines, bench.cell.shown["voltage"] = 0, 4.4
        case.scheduler.sleep(60.0)
    assert len(asked) == before


def test_a_wait_ends_with_the_test(bench, tmp_path):
    """A row that comes in a test only is not waited for any longer when the test is over."""
    case, facade = held(bench, tmp_path)
    facade.prepare(cycles=1)
    with (
        pytest.raises(NotInTime, match=r"no phase equal to 1 until its test was over, the newest is -1"),
        case.run.record.during("test", facade, rate=0.2) as test,
    ):
        facade.start()
        test.until("phase", equals=-1.0, within=300.0)
        test.until("phase", equals=1.0, within=30000.0)
    assert bench.clock.now() < 600.0
