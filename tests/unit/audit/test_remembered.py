"""What was taken out of catalogue and registers counts on, until a named person says why."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, DUT, INSTRUMENT, PARENT, certificate, closed_world, codes, package, result, row, world_of

from hil.audit.engine import audit
from hil.audit.inputs import Instrument, Register, World
from hil.audit.recorded import explain, keep, past, record, remembered
from hil.evidence.ledger.book import append_all, read
from hil.evidence.ledger.entries import Explained
from hil.model.errors import EvidenceError
from hil.model.identity import UnitEvent, UnitEventKind
from hil.registers.instruments import AsFound, AsLeft

REPAIR = UnitEvent(kind=UnitEventKind.REPAIR, date="2026-07-01", text="J3 replaced", reference="NCR-7", reverify=True)
REPAIRED = Register(duts={DUT.serial: replace(DUT, events=(REPAIR,))}, instruments={INSTRUMENT.id: INSTRUMENT})
BAD = certificate("C-2", "2026-09-01", "2027-09-01", as_found=AsFound.OUT_OF_TOLERANCE, as_left=AsLeft.ADJUSTED)
SPOILT = certificate("C-9", "2026-08-01", "2027-08-01", as_left=AsLeft.OUT_OF_TOLERANCE)
GOOD = replace(BAD, as_found=AsFound.IN_TOLERANCE)


def recalled(*certificates) -> Register:
    """Return the registers with further certificates of the instrument."""
    known = replace(INSTRUMENT, certificates=(*INSTRUMENT.certificates, *certificates))
    return Register(duts={DUT.serial: DUT}, instruments={INSTRUMENT.id: known})


def kept(reports, world: World, *earlier: World) -> World:
    """Enter the catalogue and the registers of earlier days into a ledger; return a world that remembers them."""
    append_all(reports, [msgspec.structs.replace(each, seq=-1, utc="") for each in world.entries])
    for each in earlier:
        keep(reports, each.asked, each.register)
    ledger = read(reports)
    return replace(world, entries=ledger.entries, head=ledger.head, remembered=remembered(reports, ledger.entries))


CLOSED = closed_world()
TAKEN_OUT = {
    "a repair": (replace(CLOSED, register=REPAIRED), CLOSED, "STALE_DUT", "FM-7: repair on 2026-07-01: J3 replaced"),
    "whether a repair counts": (
        replace(CLOSED, register=REPAIRED),
        replace(
            CLOSED,
            register=Register(
                duts={DUT.serial: replace(DUT, events=(replace(REPAIR, reverify=False),))},
                instruments={INSTRUMENT.id: INSTRUMENT},
            ),
        ),
        "STALE_DUT",
        "FM-7: repair on 2026-07-01: J3 replaced",
    ),
    "a certificate": (
        replace(CLOSED, register=recalled(BAD)),
        CLOSED,
        "CAL_RETRO",
        "dmm-1 (certificate C-2) was found out of tolerance on 2026-09-01",
    ),
    "how a certificate left the instrument": (
        replace(CLOSED, register=recalled(SPOILT, BAD)),
        replace(CLOSED, register=recalled(replace(SPOILT, as_left=AsLeft.ADJUSTED), BAD)),
        "CAL_RETRO",
        "dmm-1 (certificate C-2) was found out of tolerance on 2026-09-01",
    ),
    "what a certificate found": (
        replace(CLOSED, register=recalled(BAD)),
        replace(CLOSED, register=recalled(GOOD)),
        "CAL_RETRO",
        "dmm-1 (certificate C-2) was found out of tolerance on 2026-09-01",
    ),
}


@pytest.mark.parametrize("case", TAKEN_OUT)
def test_what_was_taken_out_of_a_register_counts_on(tmp_path, case):
    """An event, a certificate, and what either of them says: the requirement stays open, and the entry is named."""
    before, after, code, text = TAKEN_OUT[case]
    assert (codes(before), codes(after)) == ([code], [])
    now = kept(tmp_path, after, before)
    (found,) = row(now).reasons
    assert found.code == code
    assert found.text.startswith(text)
    assert found.text.endswith("(since removed from the register, and the reason is not on record)")
    assert any("it was removed or changed, and the reason is not on record" in each for each in audit(now).problems)


@pytest.mark.parametrize("case", TAKEN_OUT)
def test_recording_does_not_accept_what_is_gone_and_an_explanation_does(tmp_path, case):
    """`--record` alone changes nothing of it; who says why, and what, stands in the ledger."""
    before, after, code, _ = TAKEN_OUT[case]
    now = kept(tmp_path, after, before)
    record(tmp_path, now, audit(now))
    again = replace(now, remembered=remembered(tmp_path, read(tmp_path).entries))
    assert codes(again) == [code]
    explained = explain(tmp_path, again, by="Ada", text="entered for the wrong unit")
    assert codes(explained) == []
    (why,) = read(tmp_path).of(Explained)
    assert (why.by, why.text) == ("Ada", "entered for the wrong unit")
    assert remembered(tmp_path, read(tmp_path).entries) == explained.remembered
    assert codes(past(explained, tmp_path, why.utc[:10])) == []


def test_what_comes_back_after_its_explanation_is_remembered_again(tmp_path):
    """An explanation is for one removal."""
    before = replace(CLOSED, register=REPAIRED)
    explain(tmp_path, kept(tmp_path, CLOSED, before), by="Ada", text="a mistake")
    for each in (CLOSED, before):
        keep(tmp_path, each.asked, each.register)
    assert codes(replace(CLOSED, remembered=remembered(tmp_path, read(tmp_path).entries))) == ["STALE_DUT"]


def test_a_register_that_is_gone_is_remembered_by_the_certificate_of_a_bench(tmp_path):
    """The bench file gives the certificate itself, and the register found it bad: without the register it stays so."""
    used = {"dmm": Instrument(certificate="certificates/C-1.txt")}
    world = closed_world(instruments=used)
    before = replace(world, register=recalled(BAD))
    after = replace(world, register=Register(duts={DUT.serial: DUT}))
    assert (codes(before), codes(after)) == (["CAL_RETRO"], [])
    assert codes(kept(tmp_path, after, before)) == ["STALE_CAL", "CAL_RETRO"]


OPEN_CHILD = msgspec.structs.replace(ASKED, id="LOAD-020")
GONE = "LOAD-020 is open: NO_EVIDENCE, WITHDRAWN"


@pytest.mark.parametrize(
    ("asked", "text"),
    [
        ((PARENT, ASKED), GONE),
        ((PARENT, ASKED, msgspec.structs.replace(OPEN_CHILD, withdrawn=True)), GONE),
        ((PARENT, ASKED, msgspec.structs.replace(OPEN_CHILD, parents=())), "LOAD-020 is no longer below it"),
    ],
    ids=["taken out", "withdrawn", "no longer below"],
)
def test_a_requirement_that_is_gone_closes_nothing(tmp_path, asked, text):
    """Its parent was open because of it, and stays open."""
    before = replace(CLOSED, asked=(PARENT, ASKED, OPEN_CHILD))
    after = replace(CLOSED, asked=asked)
    assert (row(before, PARENT.id).closed, row(after, PARENT.id).closed) == (False, True)
    now = kept(tmp_path, after, before)
    assert any(each.text.startswith(text) for each in row(now, PARENT.id).reasons)
    assert row(explain(tmp_path, now, by="Ada", text="met by LOAD-010"), PARENT.id).closed


@pytest.mark.parametrize("asked", [(PARENT,), (PARENT, msgspec.structs.replace(ASKED, withdrawn=True))])
def test_a_fail_stays_though_its_requirement_is_gone(tmp_path, asked):
    """Also where no baseline ever had the requirement: the package has it. A signed approval ends it."""
    failed = package(results={ASKED.id: result(verdict="FAIL", failed=True)})
    found = row(replace(world_of([failed]), asked=asked))
    assert "WITHDRAWN" in {each.code for each in found.reasons}
    assert "FAILED" in {each.code for each in found.reasons}
    disposed = replace(world_of([failed]), asked=asked)
    disposed = replace(disposed, policy=replace(disposed.policy, valid={failed.digest: frozenset({"nonconformance"})}))
    assert ASKED.id not in {each.id for each in audit(disposed).rows}


def test_requirements_that_were_taken_out_in_a_circle_are_open(tmp_path):
    """Two that were below each other at different times do not end the audit."""
    one, two = (msgspec.structs.replace(ASKED, id=name, parents=()) for name in ("A-1", "B-1"))
    first = replace(CLOSED, asked=(msgspec.structs.replace(one, parents=("B-1",)), two))
    second = replace(CLOSED, asked=(one, msgspec.structs.replace(two, parents=("A-1",))))
    now = kept(tmp_path, CLOSED, first, second, first)
    assert {each.id: each.closed for each in audit(now).rows}["A-1"] is False


def test_a_baseline_that_cannot_be_read_is_damage(tmp_path):
    """Without it nobody knows what was there."""
    now = kept(tmp_path, CLOSED, replace(CLOSED, register=REPAIRED))
    for path in (tmp_path / ".ledger/objects").iterdir():
        path.unlink()
    with pytest.raises(EvidenceError, match="cannot be read"):
        remembered(tmp_path, now.entries)


def test_registers_are_kept_once_for_each_change(tmp_path):
    """The same registers are no news."""
    keep(tmp_path, CLOSED.asked, CLOSED.register)
    count = len(read(tmp_path).entries)
    keep(tmp_path, CLOSED.asked, CLOSED.register)
    assert len(read(tmp_path).entries) == count
    keep(tmp_path, CLOSED.asked, REPAIRED)
    assert len(read(tmp_path).entries) == count + 1
