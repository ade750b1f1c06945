"""What waits for a disk: no signal waits for it as well."""

from __future__ import annotations

import os
import signal
import time

import pytest

from hil.evidence.durable import audibly, sync_open


@pytest.fixture
def rings():
    """The instants at which an alarm was heard that rings a hundred times a second."""
    heard: list[float] = []
    before = signal.signal(signal.SIGALRM, lambda *_: heard.append(time.monotonic()))
    signal.setitimer(signal.ITIMER_REAL, 0.01, 0.01)
    yield heard
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def waits_for_the_disk(_descriptor: int) -> None:
    """Wait as the kernel does for a disk: no signal interrupts it."""
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    time.sleep(0.15)
    signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def test_an_alarm_is_heard_while_a_file_waits_for_a_slow_disk(tmp_path, monkeypatch, rings):
    """The heartbeat of a run is rung by it."""
    monkeypatch.setattr(os, "fsync", waits_for_the_disk)
    with (tmp_path / "journal").open("wb") as file:
        began = time.monotonic()
        sync_open(file.fileno())
        ended = time.monotonic()
    assert ended - began >= 0.15
    assert len([at for at in rings if began < at < ended - 0.02]) >= 3


@pytest.mark.usefixtures("rings")
def test_what_the_disk_refuses_is_raised():
    """As if nobody had waited in between."""

    def full():
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        audibly(full)
    audibly(lambda: None)
