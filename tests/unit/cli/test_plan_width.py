"""`hil plan` on a terminal: no line is wider than it."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from hil.cli.commands import plan
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
