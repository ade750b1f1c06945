"""What a case pays for its evidence: a check, an effect, a line of the journal, a row."""

from __future__ import annotations

from hil.evidence import events
from hil.evidence.journal.writer import Journal
from hil.evidence.recordings.rows import Rows
from hil.executive.cases.checks import Checks
from hil.executive.cases.effects import Effects
from hil.executive.cases.steps import Steps
from hil.model.figure import Figure
from hil.requirements.requirement import Decision, Kind, Limit, Requirement

CALLS = 200
LIMIT = Limit(parameter="angle", unit="deg", minimum="0", maximum="15", decision=Decision.GUARDED)
REQUIREMENT = Requirement(id="MTQ-010", rev=1, text="Small.", kind=Kind.LIMIT, limits=(LIMIT,), source="own")
FOUND = Figure(value=0.02, unit="rad", uncertainty=0.001, dof=7)


class Sink:
    """Takes events, and keeps them."""

    def __init__(self):
        self.written = []

    def write(self, event, *, beside=None):
        """Take one event."""
        self.written.append(event)


def test_a_check(cost):
    """Limit, unit, expanded uncertainty and decision; without the disk."""
    sink = Sink()
    check = Checks({REQUIREMENT.id: REQUIREMENT}, Steps("case", sink, lambda: 0.0), sink)

    def many():
        for _ in range(CALLS):
            verdict = check(REQUIREMENT.id, "angle", FOUND)
        return verdict

    assert cost("check (guarded, unit converted)", many, units=CALLS) == "PASS"
    assert sink.written[0].verdict == "PASS"


def test_an_effect(cost):
    """Numbering, arguments and result of one call of a role; without the disk."""
    sink = Sink()
    effects = Effects(sink, Steps("case", sink, lambda: 0.0))

    def many():
        for _ in range(CALLS):
            effects.perform("supply.coil.current", "reads", {}, lambda: FOUND)

    cost("effect (a reading)", many, units=CALLS)
    assert sink.written[0].result["value"] == 0.02


def test_a_line_of_the_journal(cost, tmp_path):
    """Canonical JSON, chain and write of an event that need not be on the disk at once."""
    fields = {"case": "case", "step": "1.2", "name": "supply.coil.current", "ordinal": 3, "effect": "reads"}
    with Journal(tmp_path / "journal.jsonl") as journal:

        def many():
            for _ in range(CALLS):
                journal.write(events.Effect(**fields, arguments={}, result={"value": 0.016, "unit": "A"}), 1.5)

        cost("journal line (not synced)", many, units=CALLS)
    assert b'"kind":"effect"' in (tmp_path / "journal.jsonl").read_bytes()


def test_a_row_of_a_recording(cost, tmp_path):
    """One row of four channels: packed, buffered, hashed and written."""
    told = []
    channels = [(name, "uT") for name in "xyzt"]
    rows = Rows(tmp_path / "a.rows", recording="a", channels=channels, on_block=lambda *block: told.append(block))

    def many():
        for index in range(10 * CALLS):
            rows.append((index / 100, 10.0, -20.5, 48.25, 21.0))

    cost("row of a recording (four channels)", many, units=10 * CALLS)
    end = rows.finish()
    assert told[-1] == (end.rows, end.sha256)
