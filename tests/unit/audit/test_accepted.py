"""Nonconformance reports and waivers: what they close, and everything by which they close nothing."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, PARENT, UNIT, approval, codes, package, result, row, seal_of, world_of

from hil.audit.engine import audit
from hil.audit.inputs import Filed
from hil.audit.pages.page import as_html
from hil.audit.recorded import past, record, reports_ever
from hil.audit.tables import as_csv, as_json
from hil.evidence.ledger.book import append_all, read
from hil.registers.nonconformances import Action, Disposition, Nonconformance, Records, UnitName, Waiver

FAIL = {ASKED.id: result(verdict="FAIL", failed=True, eligible=False, reasons=("its verdict is FAIL",))}
REPORT = Nonconformance(
    id="NCR-7",
    title="111 ohm",
    date="2026-06-02",
    by="Ada",
    requirements=(ASKED.id,),
    units=(UNIT,),
    run="run-1",
    check="resistance",
    disposition=Disposition.REWORK,
    action=Action(text="Resistor changed", date="2026-06-10"),
)
WAIVER = Waiver(
    id="W-1",
    title="111 ohm is accepted",
    date="2026-06-03",
    until="2027-06-03",
    by="Ada",
    requirement=ASKED.id,
    rev=ASKED.rev,
    fingerprint=ASKED.fingerprint,
    units=(UNIT,),
    reason="The converter stands it",
    nonconformance="NCR-7",
)


def filed(*items, approvals=None, earlier=()):
    """Return registers of reports and waivers, all of them approved unless their approvals are given."""
    registers = Records(
        nonconformances={each.id: each for each in items if isinstance(each, Nonconformance)},
        waivers={each.id: each for each in items if isinstance(each, Waiver)},
    )
    given = tuple(map(approval, items)) if approvals is None else tuple(approvals)
    return Filed(registers=registers, earlier=tuple(earlier), approvals=given)


def failed(*later, **changed):
    """Return a world in which LOAD-010 failed, and what came later."""
    return replace(world_of([package(results=FAIL), *later]), **changed)


def test_a_waiver_closes_in_part_and_never_silently():
    """The row is closed, its compliance is partial, and it says by whom; so does its parent."""
    world = failed(filed=filed(WAIVER))
    found = row(world)
    assert (found.close_out, found.compliance, found.waiver, found.closed_by) == ("closed", "partial", "W-1", "")
    told = "waiver W-1 for LOAD-1 FM-7 until 2027-06-03, approved by bo@x as waiver on 2026-06-20"
    assert found.records == (told,)
    assert (row(world, PARENT.id).close_out, row(world, PARENT.id).compliance) == ("closed", "partial")
    document = audit(world)
    assert document.summary.waived == (ASKED.id,)
    assert document.summary.compliance == {"yes": 0, "partial": 2, "no": 0}
    for form in ("".join(as_html(document, "reports")), as_csv(document).decode()):
        assert "closed by waiver W-1" in form
        assert told in form
    assert b'"waiver":"W-1"' in as_json(document)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"rev": 2}, "it is for rev 2 (ffffffff) of the requirement, which is now rev 1 (ffffffff)"),
        ({"fingerprint": "0" * 64}, "it is for rev 1 (00000000) of the requirement, which is now rev 1 (ffffffff)"),
        ({"until": "2026-11-21"}, "it counted until 2026-11-21"),
        ({"units": (UnitName(part="LOAD-1", serial="FM-8"),)}, "the register has no unit FM-8 of the part LOAD-1"),
        ({"units": (UnitName(part="LOAD-2", serial="FM-7"),)}, "the register has no unit FM-7 of the part LOAD-2"),
    ],
)
def test_a_waiver_for_something_else_closes_nothing(changed, problem):
    """Another revision, another meaning, after its last day, another unit: the row is open, and says why."""
    waiver = replace(WAIVER, **changed)
    world = failed(filed=filed(waiver))
    assert codes(world) == ["NO_VERDICT", "FAILED"]
    assert (row(world).compliance, row(world).records) == ("no", (f"W-1 closes nothing: {problem}",))


def test_its_last_day_counts():
    """A waiver counts on the day on which it ends."""
    assert codes(failed(filed=filed(replace(WAIVER, until="2026-11-22")))) == []


@pytest.mark.parametrize(
    "approvals",
    [
        (),
        (approval(WAIVER, role="nonconformance"),),
        (approval(replace(WAIVER, until="2030-01-01")),),
        (approval(WAIVER, record="W-2"),),
    ],
)
def test_a_waiver_that_is_not_approved_as_it_is_closes_nothing(approvals):
    """Nobody approved it, or in another role, or another content, or another waiver."""
    world = failed(filed=filed(WAIVER, approvals=approvals))
    assert codes(world) == ["NO_VERDICT", "FAILED"]
    assert row(world).records == (
        "W-1 closes nothing: it is not approved in its present form by anyone but its author",
    )


def test_a_waiver_covers_no_other_unit_and_nothing_that_failed_later():
    """Another unit failed, or the same one once more after the approval: it is open."""
    other = package("run-2", "2026-06-05", results=FAIL, serial="FM-8")
    assert "FAILED" in codes(failed(other, filed=filed(WAIVER)))
    again = package("run-2", "2026-06-05", results=FAIL)
    assert codes(failed(again, filed=filed(WAIVER))) == []
    assert "FAILED" in codes(failed(again, filed=filed(WAIVER, approvals=[approval(WAIVER, seq=2)])))


def test_a_waiver_hides_neither_a_missing_package_nor_an_open_report():
    """What may hold worse stays in the way."""
    gone = seal_of(package("run-2", "2026-06-05"), 2)
    world = world_of([package(results=FAIL)], [seal_of(package()), gone])
    assert codes(replace(world, filed=filed(WAIVER))) == ["MISSING_PACKAGE"]
    use = replace(REPORT, disposition=Disposition.USE_AS_IS, action=None)
    assert codes(failed(filed=filed(use, WAIVER))) == []
    assert codes(failed(filed=filed(use, WAIVER, approvals=[approval(WAIVER)]))) == ["OPEN_NCR"]


def test_a_waiver_that_is_not_needed_takes_nothing_away():
    """There is good evidence, and no FAIL: compliance is yes."""
    found = row(replace(world_of([package()]), filed=filed(WAIVER)))
    assert (found.compliance, found.waiver, found.closed_by) == ("yes", "", "run-1")


def test_a_waiver_closes_what_was_never_tested_in_part_too():
    """Nobody ran the case; the waiver says so."""
    found = row(replace(world_of([]), filed=filed(WAIVER)))
    assert (found.close_out, found.compliance, found.waiver) == ("closed", "partial", "W-1")


GOOD = package("run-2", "2026-06-11")


def test_a_closed_report_disposes_of_the_fail_in_the_run_that_it_names():
    """Reworked, measured once more, approved by somebody else: closed, and the row tells of the report."""
    found = row(failed(GOOD, filed=filed(REPORT)))
    assert (found.close_out, found.compliance, found.closed_by) == ("closed", "yes", "run-2")
    assert found.records == ("NCR-7, rework, approved by bo@x as nonconformance on 2026-06-20",)


@pytest.mark.parametrize(
    ("report", "why"),
    [
        (replace(REPORT, disposition=None), "the disposition of LOAD-1 FM-7 is undecided"),
        (replace(REPORT, action=None), "rework is decided but not done"),
    ],
)
def test_a_report_that_is_not_complete_keeps_open_what_it_names(report, why):
    """Whatever was measured, and whoever approved it."""
    world = replace(world_of([package()]), filed=filed(report))
    assert codes(world) == ["OPEN_NCR"]
    assert why in row(world).reasons[0].text


def test_a_report_that_nobody_approved_keeps_open_what_it_names():
    """Its author alone closes nothing; neither does an approval of what it said before."""
    for approvals in ([], [approval(replace(REPORT, cause="unknown"))]):
        world = failed(GOOD, filed=filed(REPORT, approvals=approvals))
        assert codes(world) == ["OPEN_NCR", "OPEN_NCR"]  # the report, and the FAIL itself
        assert "is not approved in its present form by anyone but its author" in row(world).reasons[0].text


@pytest.mark.parametrize(
    ("report", "found"),
    [
        (replace(REPORT, run="run-9"), ["OPEN_NCR"]),
        (replace(REPORT, units=(UnitName(part="LOAD-1", serial="FM-9"),)), ["OPEN_NCR"]),
        (replace(REPORT, disposition=Disposition.USE_AS_IS), ["OPEN_NCR"]),
        (replace(REPORT, disposition=Disposition.SCRAP), ["STALE_DUT"]),
        (replace(REPORT, action=Action(text="Done", date="2026-06-11")), ["STALE_DUT"]),
    ],
)
def test_a_closed_report_does_no_more_than_it_says(report, found):
    """Another run, another unit, used as it is, scrapped, or reworked on the day of the good evidence."""
    assert (
        list(dict.fromkeys(each for each in codes(failed(GOOD, filed=filed(report))) if each != "NO_VERDICT")) == found
    )


def test_an_approval_from_before_the_seal_disposes_of_nothing():
    """Nobody approves what was done about a FAIL that has not happened."""
    assert "OPEN_NCR" in codes(failed(GOOD, filed=filed(REPORT, approvals=[approval(REPORT, seq=0)])))


def test_removing_or_shrinking_a_report_closes_nothing():
    """The ledger has it: it is open, though the register no longer has it, or no longer names the requirement."""
    world = replace(world_of([package()]), filed=filed(earlier=[REPORT]))
    assert codes(world) == ["OPEN_NCR"]
    assert 'NCR-7 "111 ohm" is no longer in the register' in row(world).reasons[0].text
    other = replace(REPORT, requirements=("LOAD-020",), action=None)
    assert codes(replace(world, filed=filed(other, approvals=[], earlier=[REPORT]))) == ["OPEN_NCR"]


def test_what_was_recorded_is_remembered_and_told_of_its_day(tmp_path):
    """A report and a waiver are entered with the catalogue; a report that changed or is gone is still known."""
    world = failed(filed=filed(REPORT, WAIVER))
    append_all(tmp_path, [msgspec.structs.replace(each, seq=-1, utc="") for each in world.entries])
    record(tmp_path, replace(world, entries=read(tmp_path).entries, head=read(tmp_path).head), audit(world))
    entries = read(tmp_path).entries
    assert reports_ever(tmp_path, entries) == (REPORT,)
    day = entries[-1].utc[:10]
    later = replace(world, entries=entries, filed=replace(world.filed, registers=Records()))
    then = past(later, tmp_path, day).filed
    assert (then.registers, then.earlier) == (world.filed.registers, (REPORT,))
    assert past(replace(later, filed=filed(REPORT, WAIVER)), tmp_path, day).filed.approvals == world.filed.approvals
