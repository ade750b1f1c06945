"""What is said of a process that did not come to its end."""

from __future__ import annotations

import io
import signal
import sys

import pytest

from hil.cli import supervision


class Terminal(io.StringIO):
    """A stream at which a person sits."""

    def isatty(self) -> bool:
        """Return that one does."""
        return True


@pytest.mark.parametrize(("stream", "begun"), [(Terminal, "[1/2] 0:01:00.0\n"), (io.StringIO, "[1/2] 0:01:00.0")])
def test_what_is_said_of_a_killed_run_begins_a_line(monkeypatch, capsys, stream, begun):
    """Its progress is left half-written at the foot of a terminal; nowhere else is there a foot."""
    shown = stream()
    shown.write("[1/2] 0:01:00.0")
    monkeypatch.setattr(sys, "stdout", shown)
    assert supervision._believed(signal.SIGKILL, {}) == 3
    assert shown.getvalue() == begun
    assert capsys.readouterr().err.startswith("hil: the process of the run was ended by SIGKILL")


def test_nothing_is_added_behind_a_run_that_ended_by_itself(monkeypatch):
    """It has taken its line away."""
    monkeypatch.setattr(sys, "stdout", shown := Terminal())
    assert supervision._believed(0, {"ended": (1, "")}) == 1
    assert shown.getvalue() == ""
