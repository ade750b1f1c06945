"""Errors on a terminal: lines are as wide as it is, and paths and names in them stay whole."""

from __future__ import annotations

import fcntl
import os
import select
import struct
import sys
import termios

import click
import pytest

from hil.cli.display import displays, shown_safely
from hil.cli.main import main

END = b"<end>"
PATH = f"testplans/{'a-long-name' * 8}/requirements.yaml:14:9:"
TOLD = f"hil: {PATH} unknown key 'hihg' of a limit that somebody has written by hand; did you mean 'high'?"
HINT = "     correct what stands there, and call hil requirements diff to see what it means for others"


@pytest.fixture
def on_a_terminal(monkeypatch):
    """A function that calls another one, and returns what it said to a terminal of forty columns."""
    monkeypatch.delenv("COLUMNS", raising=False)
    master, slave = os.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 40, 0, 0))

    def said(what):
        before = os.dup(2)
        os.dup2(slave, 2)
        with monkeypatch.context() as patched, os.fdopen(os.dup(slave), "w", encoding="utf-8") as stream:
            patched.setattr(sys, "stderr", stream)
            what()
        os.dup2(before, 2)
        os.close(before)
        os.write(slave, END)
        read = b""
        while not read.endswith(END):
            assert select.select([master], [], [], 10)[0]
            read += os.read(master, 65536)
        return read.removesuffix(END).decode().replace("\r\n", "\n")

    yield said
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize("within", [shown_safely, displays])
def test_an_error_is_as_wide_as_the_terminal(on_a_terminal, within):
    """It breaks between words, below its first word; a path that is longer stands on a line of its own."""

    def error():
        with within():
            click.echo(TOLD, err=True)
            click.echo(HINT, err=True)

    lines = on_a_terminal(error).splitlines()
    assert " ".join(line.strip() for line in lines) == f"{TOLD} {HINT.strip()}"
    assert lines[0].startswith("hil:")
    assert all(len(line) <= 40 or PATH in line for line in lines)
    assert all(line.startswith("     ") for line in lines[1:])


def test_a_question_and_what_fits_stay_as_they_are(on_a_terminal):
    """A line that is not at its end is not broken, nor are columns that fit."""

    def ask():
        with shown_safely():
            click.echo("one   two\n\n  three", err=True)
            click.echo(f"  ? {'word ' * 12}", err=True, nl=False)

    assert on_a_terminal(ask) == f"one   two\n\n  three\n  ? {'word ' * 12}"


@pytest.mark.parametrize("columns", ["", "0", "no number"])
def test_a_pipe_has_its_lines_whole(monkeypatch, tmp_path, columns):
    """What a program reads is not broken, whatever the environment says of a terminal."""
    monkeypatch.setenv("COLUMNS", columns)
    with (tmp_path / "err").open("w", encoding="utf-8") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        with shown_safely():
            click.echo(TOLD, err=True)
    assert (tmp_path / "err").read_text(encoding="utf-8") == f"{TOLD}\n"


@pytest.mark.parametrize(
    "arguments", [("runs",), ("status", "--banch", "x"), ("analyse", "allan", "no-such-folder/no-such-log.csv")]
)
def test_errors_of_the_command_line_are_wrapped(on_a_terminal, monkeypatch, tmp_path, arguments):
    """Those of files, of options, and of everything that a command refuses."""
    monkeypatch.chdir(tmp_path)

    def refused():
        with pytest.raises(SystemExit):
            main(arguments)

    lines = on_a_terminal(refused).splitlines()
    assert len(lines) > 1
    assert all(len(line) <= 40 or len(line.split()) == 1 for line in lines), lines
