"""What a person can type wrong ends in a sentence and exit code 4, and what cannot be shown changes no exit code."""

from __future__ import annotations

import os
import sys

import pytest

from hil.cli.display import Display
from hil.cli.main import main

RUN = ("run", "p", "--bench", "b", "--dut", "d")


def ended(capsys, *arguments):
    """Return exit code and standard error of a call."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    return left.value.code, capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--output", ""), "no folder is named"),
        (("--operator", "Ad\udce9"), "--operator is not text"),
        (("--operator", ""), "--operator is empty"),
        (("--operator", " "), "--operator is empty"),
        (("--operator", "Ada\x1b[2J"), "--operator contains the character U+001B"),
        (("--operator", "Ada\nPASS"), "--operator contains the character U+000A"),
        (("--operator", "\u202eadA"), "--operator contains the character U+202E"),
        (("--operator", "A" * 201), "--operator has 201 characters, and may have 200"),
        (("--on-call", ""), "--on-call is empty"),
        (("--skip", "x", "--reason", " "), "one of them is empty"),
        (("--skip", "", "--reason", "y"), "one of them is empty"),
        (("--skip", "x", "--reason", "y", "--skip", "x", "--reason", "z"), "--skip x is given 2 times"),
    ],
)
def test_an_option_that_means_nothing_is_refused(capsys, arguments, message):
    """Before a process is started for the run."""
    code, said = ended(capsys, *RUN, *arguments)
    assert (code, message in said) == (4, True), said


@pytest.mark.parametrize("command", ["ack", "answer", "attach", "hold", "note", "stop"])
def test_everybody_who_gives_a_name_gives_one_that_can_be_read(capsys, command):
    """The same rule for every command, before it looks for the run."""
    code, said = ended(capsys, command, "latest", "--by", "Ada\r")
    assert (code, "--by contains the character U+000D" in said) == (4, True), said


def test_what_a_command_quotes_cannot_drive_a_terminal(capsys, tmp_path, monkeypatch):
    """A name with an escape sequence is shown with the escape written out, once for every stream and command."""
    (tmp_path / "hil.toml").touch()
    monkeypatch.chdir(tmp_path)
    code, said = ended(capsys, "requirements", "diff", "\x1b[2Jgone\u202e\x9b")
    assert code == 4
    assert "there is no plan '\\u001b[2Jgone\\u202e\\u009b'" in said


@pytest.mark.parametrize("name", ["hil.toml", "n" * 5000])
def test_a_file_that_cannot_be_read_is_named(capsys, tmp_path, monkeypatch, name):
    """Whichever it is and whoever opened it: no traceback, and not more of its name than a line holds."""

    def broken(*_, **__):
        raise PermissionError(13, "Permission denied", name)

    monkeypatch.setattr("hil.executive.setup.workspace.find_workspace", broken)
    monkeypatch.chdir(tmp_path)
    code, said = ended(capsys, "runs")
    assert code == 4
    assert "Permission denied" in said
    assert name[:100] in said
    assert "Traceback" not in said
    assert len(said) < 500


def test_a_folder_in_the_place_of_the_settings_is_told(capsys, tmp_path, monkeypatch):
    """A workspace that cannot be read is not the one above it."""
    (tmp_path / "hil.toml").mkdir()
    monkeypatch.chdir(tmp_path)
    code, said = ended(capsys, "runs")
    assert (code, "hil.toml" in said, "Traceback" in said) == (4, True, False)


def test_an_error_is_told_to_nobody(tmp_path, monkeypatch):
    """The exit code does not need standard error."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stderr", open(os.devnull))  # noqa: SIM115, PTH123 - a stream that cannot be written to
    with pytest.raises(SystemExit) as left:
        main(["runs"])
    sys.stderr.close()
    assert left.value.code == 4


@pytest.fixture
def pipe():
    """Both ends of a pipe."""
    reader, writer = os.pipe()
    ends = [reader, writer]
    yield ends
    for end in ends:
        os.close(end)


def test_a_display_never_waits_for_its_reader(pipe):
    """What does not fit waits; at the end it comes whole and in order."""
    reader, writer = pipe
    display = Display(writer, "utf-8")
    text = "".join(f"line {number}\n" for number in range(30_000))
    assert display.write(text) == len(text)
    got = b""
    while len(got) < len(text):
        got += os.read(reader, 1 << 16)
        display.flush()
    assert (got.decode(), display.finish(), display.lost) == (text, True, False)


def test_a_display_without_a_reader_is_quiet(pipe):
    """What cannot be written is lost without an error, and told at the end."""
    display = Display(pipe[1], "utf-8")
    os.close(pipe.pop(0))
    display.write("x" * 10_000)
    display.write("y")
    display.close()
    assert (display.finish(), display.lost, display.closed) == (False, True, False)


def test_a_display_has_a_descriptor_of_its_own(pipe):
    """Whoever closes the one it was made of closes nothing."""
    display = Display(pipe[1], "ascii")
    os.close(pipe.pop())
    display.write("1 k\u2126 \udc80\n")
    assert os.read(pipe[0], 100) == b"1 k\\u2126 \\udc80\n"


def test_a_display_shows_what_a_terminal_would_obey(pipe):
    """Whatever a case prints: only what the product itself draws reaches the terminal as it is."""
    display = Display(pipe[1], "utf-8")
    display.write("a\x1b[2J\rb\tc\n")
    display.drawn.write("\r\x1b[2K")
    assert os.read(pipe[0], 100) == b"a\\u001b[2J\\u000db\tc\n\r\x1b[2K"
