"""A role that samples by itself: begun, emptied in time, ended."""

from __future__ import annotations

from contextlib import suppress

from hil.clock.port import NANOSECONDS
from hil.executive.case.facade import Facade
from hil.executive.run.row_store import OpenRecording
from hil.executive.run.scheduler import Scheduler
from hil.instruments.sampled import Streamed, StreamReport
from hil.model.errors import DeviceFault

__all__ = ["take_stream"]


def take_stream(
    source: Facade, role: Streamed, scheduler: Scheduler, recording: OpenRecording, *, duration: float, rate: float
) -> StreamReport:
    """Let a role run by itself until its samples cover `duration` [s], and store them as they come.

    The time of a row is the bench time at the beginning plus the time that the device counted since. What the
    device's clock does against the bench's is told in the report, and changes no row.

    Raises:
        DeviceFault: if the device, or one on the way to it, falls silent; the stream is ended where that is possible.
    """
    source.guarded(lambda: role.begin(rate))
    try:
        _empty(source, role, scheduler, recording, duration + 0.5 / rate)
    except BaseException:
        with suppress(DeviceFault):
            role.end()
        raise
    return source.guarded(role.end)


def _empty(source: Facade, role: Streamed, scheduler: Scheduler, recording: OpenRecording, enough: float) -> None:
    """Take block after block until the last sample stands for the time up to `enough` after the first."""
    start_ns = scheduler.now_ns()
    pause_ns = round(role.longest_pause * NANOSECONDS)
    first: float | None = None
    turn = 0
    while True:
        turn += 1
        scheduler.wait_until(start_ns + turn * pause_ns)
        block = source.guarded(role.drain)
        if not len(block):
            continue
        if first is None:
            first = float(block[0, 0])
        wanted = block[block[:, 0] - first <= enough]
        rows = wanted.copy()
        rows[:, 0] += start_ns / NANOSECONDS
        recording.rows.append_rows(rows)
        if len(wanted) < len(block):
            return
