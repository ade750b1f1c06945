"""What waits for a disk: no signal waits for it as well."""

from __future__ import annotations

import os
import signal
import time

import pytest

from hil.evidence import durable
from hil.evidence.durable import audibly, sync_file, sync_folder, sync_open

FSYNC, RINGS = os.fsync, durable._alarm_rings  # as they are; other tests wait for no disk


@pytest.fixture
def rings(monkeypatch):
    """The instants at which an alarm was heard that rings a hundred times a second."""
    monkeypatch.setattr(durable, "_alarm_rings", RINGS)
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


def test_files_and_folders_are_given_to_the_disk(tmp_path, monkeypatch):
    """The system takes each of them: an open file, one by its path, and a folder's names."""
    given = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: given.append((os.fstat(descriptor).st_ino, FSYNC(descriptor))))
    path = tmp_path / "journal"
    with path.open("wb") as file:
        sync_open(file.fileno())
    sync_file(path)
    sync_folder(tmp_path)
    assert given == [(each.stat().st_ino, None) for each in (path, path, tmp_path)]
