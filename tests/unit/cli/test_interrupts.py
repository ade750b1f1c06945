"""Requests to end that reach a command before its run has handlers of its own."""

from __future__ import annotations

import io
import os
import signal

import pytest
from workspaces import make

from hil.cli.supervision import Word
from hil.evidence.package.verification import verify
from hil.plugin import closing, running

GOOD = """
@pytest.mark.requirement("T-010")
def test_ratio(check):
    check("T-010", "ratio", 1.0)
"""
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


@pytest.mark.usefixtures("handlers")
def test_none_disturbs_a_run_that_is_being_sealed():
    """Afterwards its report may wait for a reader, and Ctrl-C ends that."""
    word = Word(-1)
    word.listen()
    with word.undisturbed():
        for number in ASKS:
            os.kill(os.getpid(), number)
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.usefixtures("handlers")
def test_a_sealed_run_is_verified_to_its_end(tmp_path, monkeypatch):
    """Its own handlers are gone by then, and the exit code in its package is 0."""
    workspace = make(tmp_path / "workspace", GOOD)
    findings = closing._findings

    def asked(*package):
        for number in ASKS:
            os.kill(os.getpid(), number)
        return findings(*package)

    monkeypatch.setattr(closing, "_findings", asked)
    word = Word(-1)
    word.listen()
    assert running.run(workspace.request(), io.StringIO(), word=word) == 0
    (folder,) = workspace.folders()
    assert verify(folder).findings == ()
