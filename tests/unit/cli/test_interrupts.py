"""Requests to end that reach a command before its run has handlers of its own."""

from __future__ import annotations

import os
import signal

import pytest

from hil.cli.supervision import Word

ASKS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture
def handlers():
    """Put back what handled these signals before."""
    before = {number: signal.getsignal(number) for number in ASKS}
    yield
    for number, action in before.items():
        signal.signal(number, action)


@pytest.mark.usefixtures("handlers")
@pytest.mark.parametrize("number", ASKS)
def test_the_first_interrupts_and_no_other_disturbs_the_ending(number):
    """Ctrl-C at a terminal reaches the process that runs, and the one that waits passes it on."""
    word = Word(-1)
    word.listen()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    for again in ASKS:
        os.kill(os.getpid(), again)
