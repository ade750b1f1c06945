"""What a forked copy of the executive keeps."""

from __future__ import annotations

import multiprocessing
import os
import select
import signal
import socket
import subprocess
import sys
from contextlib import closing

import pytest

from hil.executive.ending.stop import kept_from_copies


def forked(work):
    """Fork a copy that does some work and lives on; return its process id once it has done it."""
    reader, writer = os.pipe()
    copy = os.fork()
    if not copy:
        try:
            work()
        finally:
            os.write(writer, b"done")
            signal.alarm(60)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.pause()
    os.read(reader, 4)
    os.close(reader)
    os.close(writer)
    return copy


@pytest.fixture
def ends():
    """Return two ends of a connection that is one, as a port or a channel is."""
    mine, other = socket.socketpair()
    with closing(mine), closing(other):
        yield mine, other


@pytest.mark.parametrize("way", ["fork", "multiprocessing"])
def test_a_copy_that_lives_on_holds_nothing(ends, way):
    """The far end sees this process close, although a copy of it is still there; what it writes goes nowhere."""
    mine, other = ends
    with kept_from_copies(lambda: [mine.fileno()]):
        if way == "fork":
            copy = forked(lambda: os.write(mine.fileno(), b"from a copy"))
        else:
            process = multiprocessing.get_context("fork").Process(target=signal.pause)
            process.start()
            copy = process.pid
        try:
            mine.sendall(b"mine")
            assert other.recv(100) == b"mine"
            mine.close()
            assert select.select([other], [], [], 10.0)[0] == [other]
            assert other.recv(100) == b""
        finally:
            os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)


def test_a_copy_that_closes_what_it_had_closes_nothing_of_this_process(ends):
    """As its objects do when they are collected."""
    mine, other = ends

    def close():
        mine.shutdown(socket.SHUT_RDWR)

    with kept_from_copies(lambda: [mine.fileno()]):
        copy = os.fork()
        if not copy:
            try:
                close()
            finally:
                os._exit(0)
        os.waitpid(copy, 0)
        mine.sendall(b"mine")
        assert other.recv(100) == b"mine"


def test_after_the_run_a_copy_keeps_what_it_had(ends):
    """A fork that has nothing to do with a bench is anybody's."""
    mine, other = ends
    with kept_from_copies(lambda: [mine.fileno()]):
        pass
    copy = forked(lambda: os.write(mine.fileno(), b"from a copy"))
    os.kill(copy, signal.SIGKILL)
    os.waitpid(copy, 0)
    assert other.recv(100) == b"from a copy"


def test_a_program_that_is_started_has_none_of_it(ends):
    """Not even where its starter closes nothing."""
    mine, _ = ends
    looks = f"import os; os.fstat({mine.fileno()})"
    done = subprocess.run([sys.executable, "-c", looks], close_fds=False, capture_output=True, text=True, check=False)
    assert "Bad file descriptor" in done.stderr
