"""What is entered into the ledger, past days, changes supposed, and runs that stand twice."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, closed_world, package, row

from hil.audit.changes import changes
from hil.audit.engine import audit
from hil.audit.inputs import Register, World
from hil.audit.packages import _once
from hil.audit.recorded import past, record
from hil.evidence.ledger.book import append_all, read
from hil.model.errors import EvidenceError, Refused


def recorded(reports, world: World) -> World:
    """Enter the seals and the state of a world into a ledger, and return the world with that ledger."""
    append_all(reports, [msgspec.structs.replace(each, seq=-1, utc="") for each in world.entries])
    known = replace(world, entries=read(reports).entries, head=read(reports).head)
    record(reports, known, audit(known))
    return replace(known, entries=read(reports).entries, head=read(reports).head)


def test_the_same_run_imported_twice_says_nothing_new():
    """A copy of a package is left out, whatever its folder is called."""
    assert list(_once([package(), package(folder="a copy")])) == [package()]


def test_two_contents_of_one_run_are_refused_with_both_places():
    """The same run with another content: nobody can say which one it was."""
    with pytest.raises(EvidenceError, match=r"run-1 and a copy: both are the run run-1, and their contents differ"):
        list(_once([package(), package(folder="a copy", digest="other")]))


def test_a_state_that_did_not_change_is_entered_once(tmp_path):
    """Recording again enters nothing."""
    world = recorded(tmp_path, closed_world())
    assert record(tmp_path, world, audit(world)) == (0, 0)
    changed = replace(world, asked=(msgspec.structs.replace(ASKED, fingerprint="0" * 64),))
    assert record(tmp_path, changed, audit(changed)) == (1, 1)


def test_what_another_audit_entered_meanwhile_is_entered_once(tmp_path):
    """Of two that were computed from one ledger the second is refused, and enters nothing."""
    world = recorded(tmp_path, closed_world())
    changed = replace(world, asked=(msgspec.structs.replace(ASKED, fingerprint="0" * 64),))
    document = audit(changed)
    record(tmp_path, changed, document)
    entered = read(tmp_path).head
    with pytest.raises(
        EvidenceError, match=r"continued while this was computed; nothing was entered; repeat the command"
    ):
        record(tmp_path, changed, document)
    assert read(tmp_path).head == entered


def test_a_past_day_is_told_from_the_ledger(tmp_path):
    """What changed after the day changes nothing of it: neither text, nor register, nor analysis."""
    world = recorded(tmp_path, closed_world())
    day = world.entries[-1].utc[:10]
    later = replace(
        world,
        asked=(msgspec.structs.replace(ASKED, fingerprint="0" * 64),),
        register=Register(),
        analysis="b",
    )
    assert row(later).close_out == "open"
    assert audit(past(later, tmp_path, day)).rows == audit(world).rows


def test_a_day_before_anything_was_recorded_is_refused(tmp_path):
    """There is no catalogue of that day, and none is made up."""
    world = recorded(tmp_path, closed_world())
    with pytest.raises(Refused, match="no catalogue was recorded up to 2020-01-01: the first one is of 20"):
        past(world, tmp_path, "2020-01-01")


def test_a_change_says_what_it_would_reopen():
    """Another text reopens the requirement and its parent, with the reason."""
    before = closed_world()
    after = replace(before, asked=(before.asked[0], msgspec.structs.replace(ASKED, rev=2, fingerprint="0" * 64)))
    found = changes(audit(before), audit(after))
    assert [(each.what, each.id) for each in found] == [("reopened", "EPS-001"), ("reopened", "LOAD-010")]
    assert found[1].gained[0].code == "SUSPECT_REQ"
    assert changes(audit(before), audit(before)) == ()


def test_no_cell_of_the_csv_is_a_formula():
    """A requirement whose text is a formula, or a link."""
    from hil.audit.tables import as_csv  # noqa: PLC0415 - only here

    asked = msgspec.structs.replace(ASKED, text='=HYPERLINK("http://x")')
    assert b"'=HYPERLINK" in as_csv(audit(replace(closed_world(), asked=(asked,))))


def test_a_clock_that_was_set_back_puts_nothing_into_the_past(tmp_path):
    """What was written after an entry of a later day is left out, and the state of the days between is not sure."""
    world = recorded(tmp_path, closed_world())
    first = world.entries[-1]
    day = first.utc[:10]
    later = msgspec.structs.replace(first, seq=first.seq + 1, utc="2999-01-01T00:00:00Z", prev=world.head)
    back = msgspec.structs.replace(first, seq=first.seq + 2)
    ahead = past(replace(world, entries=(*world.entries, later)), tmp_path, day)
    assert (audit(ahead).rows, ahead.head) == (audit(world).rows, world.head)
    found = past(replace(world, entries=(*world.entries, later, back)), tmp_path, day)
    assert found.entries == world.entries
    assert [each.split(", of ")[0] for each in found.problems] == [f"line {back.seq + 1} of the ledger"]
    assert {each.close_out for each in audit(found).rows} == {"open"}
