"""`hil plan` and `hil status` on a terminal: no line is wider than it."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.cli.commands import plan, status
from hil.evidence.package.verification import State
from hil.evidence.runs import RunSummary
from hil.plugin import rehearsing

LONG = "        checks   LOAD-010 resistance  (95 to 105 ohm, guarded), because the supplier's drawing says so"


@pytest.mark.parametrize(("terminal", "widest", "lines"), [(True, 60, 2), (False, len(LONG), 1)])
def test_a_long_line_is_wrapped_on_a_terminal_alone(monkeypatch, terminal, widest, lines):
    """A file or a pipe gets it whole; on a terminal the rest hangs below it."""
    monkeypatch.setattr(plan, "pin", lambda: None)
    monkeypatch.setattr(rehearsing, "procedure", lambda _: [LONG])
    monkeypatch.setenv("COLUMNS", "60")
    with CliRunner().isolation() as (out, *_):
        monkeypatch.setattr(plan.sys.stdout, "isatty", lambda: terminal)
        plan.command.main(["load", "--bench", "load", "--dut", "SN1"], standalone_mode=False)
        plan.sys.stdout.flush()
        told = out.getvalue().decode().splitlines()
    assert (max(map(len, told)) <= widest, len(told)) == (True, lines)
    assert all(line.startswith("          ") for line in told[1:])


@pytest.mark.parametrize(("terminal", "lines"), [(True, 3), (False, 1)])
def test_the_status_of_a_run_is_wrapped_like_it(monkeypatch, tmp_path, terminal, lines):
    """Why a run was stopped is a sentence, and may be a long one."""
    monkeypatch.setattr(status, "find_run", Path)
    monkeypatch.setattr("hil.evidence.runs.status", lambda _: RunSummary(folder=tmp_path, state=State.SEALED))
    monkeypatch.setattr(status, "status_lines", lambda _: [LONG.strip() + " and so on"])
    monkeypatch.setenv("COLUMNS", "40")
    with CliRunner().isolation() as (out, *_):
        monkeypatch.setattr(status.sys.stdout, "isatty", lambda: terminal)
        status.command.main([str(tmp_path)], standalone_mode=False)
        status.sys.stdout.flush()
        told = out.getvalue().decode().splitlines()
    assert (len(told), max(map(len, told)) <= 40) == (lines, terminal)
