"""The line at the foot of a terminal."""

from __future__ import annotations

import io

from typed_events import event_of

from hil.plugin.terminal.progress import Progress, StatusLine


class Terminal(io.StringIO):
    """A stream at which a person sits."""

    def isatty(self) -> bool:
        """Return that one does."""
        return True


def ticked(stream, *seconds, text="x" * 200):
    """Return what is written when the line is ticked at these wall seconds."""
    moment = [0.0]
    line = StatusLine(stream, lambda: text, now=lambda: moment[0])
    for second in seconds:
        moment[0] = second
        line.tick()
    return line, stream.getvalue()


def test_a_terminal_has_one_line_that_is_written_again(monkeypatch):
    """Once a second, never longer than the terminal is wide, and taken away before anything else."""
    monkeypatch.setenv("TERM", "xterm")
    line, written = ticked(Terminal(), 0.5, 1.0, 1.5, 2.1)
    assert written == ("\r\x1b[2K" + "x" * 79) * 2
    line.clear()
    line.clear()
    assert line._stream.getvalue().endswith("x\r\x1b[2K")


def test_elsewhere_there_is_a_line_every_hour():
    """A log of weeks says now and then that the run goes on, without a control character."""
    _, written = ticked(io.StringIO(), 10.0, 3500.0, 3601.0, 3700.0, 7300.0, text="[1/2]")
    assert written == "  still running: [1/2]\n" * 2


def test_a_question_has_the_terminal_for_itself(monkeypatch):
    """Nothing is written over what a person types."""
    monkeypatch.setenv("TERM", "xterm")
    stream = Terminal()
    progress = Progress(stream)
    progress._status._now = lambda: 1e9
    progress(event_of(kind="question", t=0.0))
    progress.tick()
    assert "\x1b[2K" not in stream.getvalue()
    progress(event_of(kind="effect", effect="asks", t=0.0))
    progress.tick()
    assert "\x1b[2K" in stream.getvalue()
