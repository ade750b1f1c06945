"""Output that nobody takes: every command ends with a code that says so, and never with a traceback."""

from __future__ import annotations

import os
import sys

import click
import pytest
from workspaces import ROOT

from hil.cli import supervision
from hil.cli.display import shown_safely, write_bytes
from hil.cli.main import cli, main


def walk(command=cli, path=()):
    """Yield every command, with its path."""
    yield path
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from walk(command.get_command(context, name), (*path, name))


COMMANDS = [*((*path, "--help") for path in walk()), ("runs",), ("status", "reports/reference")]


def ended(monkeypatch, descriptor, arguments):
    """Return the exit code of a command whose standard output is this descriptor, and close that without a word."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "stdout", os.fdopen(descriptor, "w", encoding="utf-8"))
    with pytest.raises(SystemExit) as left:
        main(arguments)
    sys.stdout.close()
    return left.value.code


@pytest.mark.parametrize("data", [b"PK\x03\x04\xff\x1b", "≥ 3 \x1b Ω".encode()])
def test_a_file_on_standard_output_is_written_as_it_is(monkeypatch, tmp_path, data):
    """A workbook is sent into a file by the shell: every byte arrives, in order with what was said."""
    with (tmp_path / "out").open("w", encoding="ascii") as stream:
        monkeypatch.setattr(sys, "stdout", stream)
        with shown_safely():
            click.echo("before ", nl=False)
            write_bytes(data)
            click.echo(" after", nl=False)
    assert (tmp_path / "out").read_bytes() == b"before " + data + b" after"


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_reader_that_has_gone_is_code_141(monkeypatch, capsys, arguments):
    """`hil runs | true`: the command ends with the code of a closed pipe, and says nothing."""
    reader, writer = os.pipe()
    os.close(reader)
    assert ended(monkeypatch, writer, arguments) == 141
    assert "Traceback" not in capsys.readouterr().err


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_full_disk_is_a_sentence(monkeypatch, capsys, arguments):
    """`hil verify RUN > /dev/full`: what could not be written, and what to do."""
    assert ended(monkeypatch, os.open("/dev/full", os.O_WRONLY), arguments) == 4
    told = capsys.readouterr().err
    assert "hil: standard output could not be written: No space left on device\n     free some space" in told
    assert "Traceback" not in told


def test_a_bench_is_made_safe_whoever_reads_it(monkeypatch):
    """`hil bench safe adcs | true`: every line of the safe-off is carried out before the code says that nobody read."""
    done = []

    def lines(*_, **__):
        for name in ("coil", "heater"):
            done.append(name)
            yield type("Proof", (), {"ok": name == "coil", "output": name, "state": "off", "detail": ""})

    monkeypatch.setattr("hil.executive.bench_visit.safe_bench", lines)
    reader, writer = os.pipe()
    os.close(reader)
    assert ended(monkeypatch, writer, ("bench", "safe", "adcs")) == 7
    assert done == ["coil", "heater"]


@pytest.mark.parametrize("value", ["x", "1", "1 x", "0 99999", "-1 -1", "1 " + "9" * 40])
def test_a_variable_that_somebody_else_set_is_no_supervisor(monkeypatch, value):
    """`HIL_SUPERVISED=x hil runs` is an ordinary command."""
    monkeypatch.setenv("HIL_SUPERVISED", value)
    monkeypatch.setenv("HIL_ONLOOKER", value)
    assert supervision.Word.given() is None
    assert supervision._onlooker() is None
    assert "HIL_SUPERVISED" not in os.environ
