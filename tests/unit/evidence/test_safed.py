"""Runs that the guardian ended: how they are told, and when they are acknowledged."""

from __future__ import annotations

import pytest
from evidence_runs import begin, sealed_run
from told_as_json import bodies
from typed_events import event_of

from hil.evidence.events import Acknowledged, Results
from hil.evidence.folder import GUARDIAN, create, hold
from hil.evidence.inbox import peek, post
from hil.evidence.journal.reader import read_journal
from hil.evidence.journal.writer import Journal
from hil.evidence.package.consistent import named_results
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import recover
from hil.evidence.package.verification import State, verify
from hil.evidence.runs import status
from hil.evidence.safed import guardian_hash, guardian_lines, is_acknowledged, last_act
from hil.report.material import Material
from hil.report.page.as_run import attributed
from hil.report.page.incidents import happenings

ACTING = b'{"event":"acting","utc":"2026-11-21T10:00:07.250000Z","why":"the executive died"}\n'
PROOF = b'{"event":"proof","output":"tec","ok":%b,"detail":"safe"}\n'
DONE = b'{"event":"done","unproven":[],"proven":["tec"]}\n'
TRYING = b'{"event":"trying","unproven":["tec"],"pid":71}\n'
ACTED = ACTING + PROOF % b"true" + DONE


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a run that the guardian ended."""
    folder = create(tmp_path, bench="b", dut="d")
    begin(folder).close()
    (folder / GUARDIAN).write_bytes(ACTED)
    return folder


def test_a_run_that_the_guardian_ended_is_safed(folder):
    """It is while nobody holds it; an empty journal of the guardian's is none."""
    assert status(folder).state is State.SAFED
    found = verify(folder)
    assert (found.state, found.ok) == (State.SAFED, False)
    assert "the guardian ended the run" in str(found.findings[0])
    with hold(folder):
        assert status(folder).state is State.RUNNING
    (folder / GUARDIAN).write_bytes(b"")
    assert status(folder).state is State.INTERRUPTED


def test_what_the_guardian_wrote_is_read_whatever_it_is(folder):
    """A line that was torn is shown as it is."""
    (folder / GUARDIAN).write_bytes(DONE + b'{"kind":"pro')
    done = {"event": "done", "unproven": [], "proven": ["tec"]}
    assert guardian_lines(folder) == (done, {"text": '{"kind":"pro'})


@pytest.mark.parametrize(
    ("journal", "unproven", "trying"),
    [
        (ACTING, None, False),
        (ACTING + PROOF % b"false", None, False),
        (ACTING + PROOF % b"false" + TRYING, ("tec",), True),
        (ACTING + PROOF % b"false" + TRYING + PROOF % b"true", (), True),
        (ACTING + b'{"event":"done","unproven":["tec"]}\n', ("tec",), False),
        (ACTING + b'{"event":"done","unproven":[]}\n', (), False),
        (ACTING + b'{"event":"done","unproven":[],"proven":[]}\n', (), False),
        (ACTED + ACTING, None, False),
    ],
)
def test_what_was_not_proven_is_not_called_safe(folder, journal, unproven, trying):
    """A guardian that still tries, was killed, gave up or guarded nothing has not made a run safe."""
    (folder / GUARDIAN).write_bytes(journal)
    assert status(folder).state is State.INTERRUPTED
    assert verify(folder).state is State.INTERRUPTED
    act = last_act(guardian_lines(folder))
    assert (act.unproven, act.trying, act.safe) == (unproven, trying, False)


def test_an_acknowledgement_holds_for_what_was_seen(folder):
    """It names the guardian's journal by its hash; what the guardian does afterwards wants one of its own."""
    assert not is_acknowledged(folder)
    post(folder, "ack", by="Ada", text="fuse replaced", seen=guardian_hash(folder))
    assert is_acknowledged(folder)
    assert [message.by for message in peek(folder)] == ["Ada"]
    assert status(folder).state is State.SAFED
    with (folder / GUARDIAN).open("ab") as more:
        more.write(ACTED)
    assert not is_acknowledged(folder)


def test_a_run_that_went_on_is_not_safed_any_more(folder):
    """The acknowledgement is in its journal by then."""
    with Journal(folder / "data/journal.jsonl") as journal:
        journal.write(event_of("acknowledged", by="Ada", text="fuse replaced", guardian=guardian_hash(folder)), 0.0)
    assert is_acknowledged(folder)
    assert status(folder).state is State.INTERRUPTED


def test_a_run_that_was_resumed_is_not_safed_any_more(folder):
    """What was driven since is not what the guardian proved, though the acknowledgement waits in the inbox until then.

    Once the guardian acts again, and proves everything, it is.
    """
    post(folder, "ack", by="Ada", text="fuse replaced", seen=guardian_hash(folder))
    told = {"number": 1, "checkpoint": 0.0, "torn_bytes": 0, "deviation": "", "seconds": 7.0, "text": "resumed"}
    with Journal(folder / "data/journal.jsonl") as journal:
        journal.write(event_of("resumed", **told, guardian=guardian_hash(folder)), 0.0)
    assert status(folder).state is State.INTERRUPTED
    assert verify(folder).state is State.INTERRUPTED
    with (folder / GUARDIAN).open("ab") as more:
        more.write(ACTED)
    assert status(folder).state is State.SAFED


def test_the_guardians_journal_is_sealed_with_the_run(folder):
    """It is in the manifest and named by the journal, with the acknowledgement that waited in the inbox."""
    post(folder, "ack", by="Ada", text="fuse replaced", seen=guardian_hash(folder))
    recover(folder, write_reports=lambda _: None)
    found = verify(folder)
    assert (found.state, found.findings) == (State.SEALED, ())
    assert GUARDIAN in (folder / "manifest-sha256.txt").read_text()
    (told,) = [
        event for event in bodies(read_journal(folder / "data/journal.jsonl")) if event["kind"] == "acknowledged"
    ]
    assert (told["by"], told["text"], told["guardian"]) == ("Ada", "fuse replaced", guardian_hash(folder))
    (folder / GUARDIAN).chmod(0o644)
    (folder / GUARDIAN).write_bytes(ACTED * 2)
    assert verify(folder).state is State.DAMAGED


def test_the_results_name_the_guardians_journal_by_its_hash(folder):
    """It is introduced with its content: another one is found, whatever the journal's end says of the files."""
    recover(folder, write_reports=lambda _: None)
    reading, seen = read_journal(folder / "data/journal.jsonl"), guardian_hash(folder)
    (told,) = [event for event in reading.events if isinstance(event, Results)]
    assert told.guardian == seen
    assert not list(named_results(reading, {GUARDIAN: seen}))
    (found,) = named_results(reading, {GUARDIAN: "0" * 64})
    assert (found.path, found.message) == (
        GUARDIAN,
        "it is not the guardian's journal that the journal's event results names",
    )


def test_the_report_tells_when_it_was_acknowledged(folder):
    """The bench was looked at long before the run was sealed, or went on; its record tells both moments."""
    post(folder, "ack", by="Ada", text="fuse replaced", seen=guardian_hash(folder))
    (message,) = peek(folder)
    recover(folder, write_reports=lambda _: None)
    material = Material(Package(folder))
    (told,) = [event for event in material.events() if isinstance(event, Acknowledged)]
    assert material.sent() == {told.seq: message.utc}
    (row,) = [
        row for row in happenings(attributed(material.events()), {}, (), material.sent()) if row.kind == "acknowledged"
    ]
    assert (row.at, row.text) == (message.utc, "fuse replaced (Ada)")
    (row,) = [row for row in happenings(attributed(material.events()), {}) if row.kind == "acknowledged"]
    assert row.at == "0:00:00.0"  # of an earlier record


def test_a_run_without_a_guardian_needs_no_acknowledgement(tmp_path):
    """There is nothing to acknowledge, sealed or not."""
    folder = create(tmp_path, bench="b", dut="d")
    sealed_run(folder)
    assert is_acknowledged(folder)
    assert status(folder).state is State.SEALED
