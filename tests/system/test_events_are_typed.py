"""Whoever writes or reads an event by a name that it does not have hears of it from mypy."""

from __future__ import annotations

from pathlib import Path

import pytest

CONFIGURATION = Path(__file__).parents[2] / "pyproject.toml"
WRONG = {
    "events.Trip(limit='x', value=1.0, unit='V', words='y')": 'Unexpected keyword argument "words"',
    "events.Trip(limit='x', value=1.0, unit='V')": 'Missing named argument "text"',
    "events.Trip(limit='x', value='1', unit='V', text='y')": 'incompatible type "str"',
    "events.CaseEnd.words": 'has no attribute "words"',
    "RunState().run.bench": 'has no attribute "bench"',
    "[check.result for case in RunState().cases.values() for check in case.checks]": 'has no attribute "result"',
}


@pytest.mark.soak
@pytest.mark.timeout(300)
def test_a_renamed_field_is_caught_by_mypy(tmp_path):
    """At the place that writes it, and at the place that reads it from an event or from the state of a run."""
    from mypy import api  # noqa: PLC0415 - slow to import

    lines = ["from hil.evidence import events", "from hil.evidence.state import RunState", *WRONG]
    snippet = tmp_path / "renamed.py"
    snippet.write_text("\n".join([*lines, ""]), encoding="utf-8")
    told, _, code = api.run(["--config-file", str(CONFIGURATION), "--cache-dir", str(tmp_path / "cache"), str(snippet)])
    assert code == 1
    for number, message in enumerate(WRONG.values(), 3):
        assert any(f"renamed.py:{number}: error:" in line and message in line for line in told.splitlines()), told
