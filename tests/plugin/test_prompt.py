"""The terminal at which a person answers: a look never waits, and no line is lost."""

from __future__ import annotations

import os
import sys

import pytest

from hil.plugin.terminal.prompt import NoTerminal, Terminal


@pytest.fixture
def typing(monkeypatch):
    """Return a function that types at standard input; called with nothing it closes it."""
    read, write = os.pipe()
    stream = os.fdopen(read)
    monkeypatch.setattr(sys, "stdin", stream)
    still_open = [write]

    def typed(text: str = "") -> None:
        if text:
            os.write(write, text.encode())
        else:
            os.close(still_open.pop())

    yield typed
    while still_open:
        os.close(still_open.pop())
    stream.close()


@pytest.fixture
def keyboard(monkeypatch):
    """Return the descriptor at which a person types at a real terminal, which is standard input."""
    keyboard, terminal = os.openpty()
    with os.fdopen(terminal) as stream:
        monkeypatch.setattr(sys, "stdin", stream)
        yield keyboard
    os.close(keyboard)


def test_lines_that_wait_in_a_terminal_are_thrown_away_and_told(keyboard, capsys):
    """Those that were read already, those that were not, and one that was only begun."""
    terminal = Terminal()
    os.write(keyboard, b"no\nno\n")
    assert terminal.line() == "no\n"
    os.write(keyboard, b"yes\nye")
    terminal.discard()
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "  ! input typed before this question was asked is discarded\n")
    assert terminal.line() is None
    os.write(keyboard, b"no\n")
    assert terminal.line() == "no\n"


@pytest.mark.usefixtures("keyboard")
def test_where_nothing_was_typed_nothing_is_said(capsys):
    """At a terminal, and where there is none."""
    Terminal().discard()
    NoTerminal().discard()
    assert capsys.readouterr().err == ""


def test_nothing_typed_is_no_line(typing):
    """Half a line is not one yet."""
    terminal = Terminal()
    assert terminal.line() is None
    typing("ye")
    assert terminal.line() is None
    typing("s\n")
    assert terminal.line() == "yes\n"
    assert terminal.line() is None


def test_lines_typed_ahead_are_kept(typing):
    """Two lines that came at once answer two questions."""
    typing("yes\n12.5\n")
    terminal = Terminal()
    assert [terminal.line(), terminal.line(), terminal.line()] == ["yes\n", "12.5\n", None]


def test_the_end_of_input_is_an_empty_text(typing):
    """An empty line is a line; the end of input is none, however often one looks."""
    typing("\n")
    typing()
    terminal = Terminal()
    assert [terminal.line(), terminal.line(), terminal.line()] == ["\n", "", ""]


def test_questions_go_to_standard_error(capsys):
    """Standard output stays clean, so that its last line is the package."""
    Terminal().show("Closed?")
    told = capsys.readouterr()
    assert (told.out, told.err) == ("", "  ? Closed? ")


@pytest.mark.usefixtures("typing")
def test_an_input_that_was_closed_has_ended():
    """Whoever closed it, nobody will answer."""
    sys.stdin.close()
    assert Terminal().line() == ""


def test_a_question_that_cannot_be_shown_is_no_error(monkeypatch):
    """Whether somebody is left to answer shows at the next look for input."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w", buffering=1, closefd=True) as gone:
        monkeypatch.setattr(sys, "stderr", gone)
        Terminal().show("Is anybody there?")
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, writer)  # so that closing it is no error
        os.close(nothing)
