"""Each condition keeps a requirement open by itself, with its code and a sentence; nothing else does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import pytest
from audited import ASKED, DUT, INSTRUMENT, certificate, closed_world, codes, package, result, row, seal_of, world_of

from hil.audit.conditions import Claim, Conditions, of_claim
from hil.audit.engine import audit
from hil.audit.inputs import Policy, Register, World
from hil.audit.ledgered import ledgered
from hil.audit.remembered import remember
from hil.evidence.ledger.entries import Baseline, Entry, Head, Replayed
from hil.model.identity import UnitEvent, UnitEventKind
from hil.registers.instruments import AsFound


def changed(**fields: Any) -> World:
    """Return the closed world with a changed result."""
    return closed_world(results={ASKED.id: result(**fields)})


def register(**fields: Any) -> Register:
    """Return the register of the closed world with changes."""
    return replace(closed_world().register, **fields)


def test_evidence_that_meets_every_condition_closes_a_requirement_and_its_parent():
    """Evidence that meets every condition closes a requirement and its parent."""
    world = closed_world()
    assert codes(world) == codes(world, "EPS-001") == []
    assert row(world).closed_by == "run-1"
    assert row(world).compliance == row(world, "EPS-001").compliance == "yes"


FM7_AGAIN = {"duts": {"FM-7": replace(DUT, hardware="C")}}
REPAIRED = UnitEvent(kind=UnitEventKind.REPAIR, date="2026-07-01", text="resistor replaced", reverify=True)
RECALLED = replace(
    INSTRUMENT,
    certificates=(
        *INSTRUMENT.certificates,
        certificate("C-2", "2026-09-01", "2027-09-01", as_found=AsFound.OUT_OF_TOLERANCE),
    ),
)
WORLDS = {
    "no package": (world_of([]), "NO_EVIDENCE", "no package has evidence for it"),
    "a verdict that is not good": (changed(verdict="INCONCLUSIVE"), "NO_VERDICT", "its verdict is INCONCLUSIVE"),
    "the run says why not": (
        changed(eligible=False, reasons=("the operator is not named",)),
        "NOT_ELIGIBLE",
        "the operator is not named",
    ),
    "not eligible without a word": (changed(eligible=False), "NOT_ELIGIBLE", "without a reason"),
    "a simulated instrument": (
        changed(eligible=False, reasons=("SIMULATED: dmm",)),
        "SIM_ONLY",
        "SIMULATED: dmm",
    ),
    "a simulated run whose results claim otherwise": (
        closed_world(source="simulated"),
        "SIM_ONLY",
        "the run's source is simulated",
    ),
    "a text that changed": (
        changed(fingerprint="0" * 64),
        "SUSPECT_REQ",
        "rev 1 (00000000), and is now rev 1 (ffffffff)",
    ),
    "a package that the ledger does not know": (world_of([package()], []), "UNKNOWN_TO_LEDGER", "no seal"),
    "a missing signature": (
        replace(closed_world(), policy=Policy(signatures=True)),
        "UNSIGNED",
        "no valid signature",
    ),
    "a missing approval": (
        replace(closed_world(), policy=Policy(approvals=("quality",))),
        "AWAITING_APPROVAL",
        "the approval by quality is missing",
    ),
    "another part": (
        replace(closed_world(), asked=(msgspec.structs.replace(ASKED, part_numbers=("LOAD-2",)),)),
        "WRONG_DUT",
        "the plan is for LOAD-2, and FM-7 is LOAD-1",
    ),
    "a unit that nobody registered": (
        replace(closed_world(), register=register(duts={})),
        "WRONG_DUT",
        "the register has no unit FM-7",
    ),
    "another hardware revision": (
        replace(closed_world(), register=register(**FM7_AGAIN)),
        "STALE_DUT",
        "FM-7 has hardware C now, and had B then",
    ),
    "a repair since": (
        replace(closed_world(), register=register(duts={"FM-7": replace(DUT, events=(REPAIRED,))})),
        "STALE_DUT",
        "FM-7: repair on 2026-07-01: resistor replaced",
    ),
    "used after its due date": (
        replace(closed_world(day="2027-03-01"), date="2027-03-01"),
        "STALE_CAL",
        "its calibration was due on 2027-01-10",
    ),
    "an instrument that was taken out of the register": (
        replace(closed_world(), register=register(instruments={})),
        "STALE_CAL",
        "the register no longer has dmm-1",
    ),
    "found out of tolerance later": (
        replace(closed_world(), register=register(instruments={"dmm-1": RECALLED})),
        "CAL_RETRO",
        "was found out of tolerance on 2026-09-01",
    ),
    "another analysis": (replace(closed_world(), analysis="b" * 64), "STALE_ANALYSIS", "the analysis is now bbbbbbbb"),
    "evidence of an age that is not allowed": (
        replace(closed_world(), asked=(msgspec.structs.replace(ASKED, max_age_s=90 * 86400.0),)),
        "EXPIRED",
        "it is 174 days old, and may be 90",
    ),
}


ALIKE = {
    "asked": {"part_numbers": ("OTHER",), "max_age_s": 1.0, "fingerprint": "1" * 64, "rev": 2},
    "result": {
        "verdict": "FAIL",
        "reasons": ("no operator is named",),
        "eligible": False,
        "instruments": ("dmm", "psu"),
        "fingerprint": "2" * 64,
        "rev": 3,
    },
}


def test_claims_that_differ_in_anything_are_judged_on_their_own():
    """What is found out once for claims that are alike is what each of them would have been told."""
    claim = Claim(
        asked=ASKED,
        package=package(),
        result=result(),
        world=closed_world(),
        ledgered=ledgered((), (), Policy(), ""),
    )
    others = [
        msgspec.structs.replace(claim, **{part: msgspec.structs.replace(getattr(claim, part), **{name: value})})
        for part, changes in ALIKE.items()
        for name, value in changes.items()
    ]
    others.append(msgspec.structs.replace(claim, package=package(source="simulated")))
    others += [
        msgspec.structs.replace(claim, result=result(reasons=("x",), of_simulation=each)) for each in ((), ("x",))
    ]
    conditions = Conditions()
    for each in (claim, *others, claim, *others):
        assert conditions.of_claim(each) == of_claim(each)


@pytest.mark.parametrize("name", WORLDS)
def test_a_condition_that_does_not_hold_keeps_the_requirement_open(name: str):
    """A condition that does not hold keeps the requirement open."""
    world, code, sentence = WORLDS[name]
    found = row(world)
    assert [str(reason.code) for reason in found.reasons] == [code]
    assert sentence in found.reasons[0].text
    assert (found.close_out, found.closed_by) == ("open", "")


def test_every_reason_that_applies_is_told():
    """Every reason that applies is told."""
    world = closed_world(source="simulated", results={ASKED.id: result(fingerprint="0" * 64, verdict="NOT_RUN")})
    assert codes(replace(world, analysis="b" * 64, entries=())) == [
        "NO_VERDICT",
        "SIM_ONLY",
        "SUSPECT_REQ",
        "UNKNOWN_TO_LEDGER",
        "STALE_ANALYSIS",
    ]


def test_evidence_may_be_as_old_as_is_allowed_to_the_day():
    """Evidence may be as old as is allowed to the day."""
    asked = (msgspec.structs.replace(ASKED, max_age_s=174 * 86400.0),)
    assert codes(replace(closed_world(), asked=asked)) == []


def replayed(analysis, *, same=True, day="2026-07-01"):
    """Return the ledger's entry of a replay of the package."""
    utc = f"{day}T10:00:00.000000Z"
    return Replayed(seq=9, utc=utc, run="run-1", evidence="run-1-digest", analysis=analysis, same=same)


def test_an_analysis_that_gave_the_same_verdict_again_counts():
    """A replay by the analysis of now closes again; one by another analysis, or of another package, does not."""
    world = replace(closed_world(), analysis="b" * 64)
    assert codes(world) == ["STALE_ANALYSIS"]
    assert codes(replace(world, entries=(*world.entries, replayed("b" * 64)))) == []
    assert codes(replace(world, entries=(*world.entries, replayed("c" * 64)))) == ["STALE_ANALYSIS"]
    other = msgspec.structs.replace(replayed("b" * 64), evidence="another")
    assert codes(replace(world, entries=(*world.entries, other))) == ["STALE_ANALYSIS"]


@pytest.mark.parametrize(
    ("analysis", "by"), [("a" * 64, "the analysis that judged it"), ("b" * 64, "the analysis bbbbbbbb")]
)
def test_a_replay_that_comes_out_otherwise_reopens(analysis, by):
    """Whether or not the analysis changed since; the last replay counts."""
    bad = replayed(analysis, same=False, day="2026-07-02")
    world = replace(closed_world(), analysis=analysis)
    world = replace(world, entries=(*world.entries, replayed(analysis), bad))
    (reason,) = row(world).reasons
    assert reason.code == "STALE_ANALYSIS"
    assert reason.text == f"its replay on 2026-07-02 by {by} gave a different result: hil replay shows the differences"
    assert codes(replace(world, entries=(*world.entries, replayed(analysis, day="2026-07-03")))) == []


def test_an_instrument_is_known_by_its_certificate_where_the_package_does_not_name_its_entry():
    """An instrument is known by its certificate where the package does not name its entry."""
    instruments = {"dmm": msgspec.structs.replace(package().instruments["dmm"], entry="")}
    world = closed_world(instruments=instruments)
    assert codes(replace(world, register=register(instruments={"dmm-1": RECALLED}))) == ["CAL_RETRO"]
    assert codes(replace(world, register=register(instruments={}))) == []  # the bench file gave its calibration itself


def test_a_certificate_that_was_taken_out_of_the_register_is_missed():
    """A certificate that was taken out of the register is missed."""
    other = replace(INSTRUMENT, certificates=(certificate("C-9", "2026-01-10", "2027-01-10"),))
    assert codes(replace(closed_world(), register=register(instruments={"dmm-1": other}))) == ["STALE_CAL"]


def entered(instrument, seq, utc="2027-03-01T08:00:00Z"):
    """Return what the ledger remembers of an instrument's certificates, first entered by an entry of this number."""
    entry = Baseline(seq=seq, utc=utc, subject="instruments", object="x")
    return remember([entry], lambda *_: [instrument])


def test_a_certificate_that_was_entered_after_the_run_proves_nothing_of_it():
    """Of an earlier day, while in the run the last calibration had run out: what proves it has to be there before."""
    before, after = certificate("C-1", "2025-01-10", "2026-01-10"), certificate("C-9", "2026-04-20", "2027-04-20")
    instrument = replace(INSTRUMENT, certificates=(before, after))
    world = replace(closed_world(), register=register(instruments={"dmm-1": instrument}))
    for remembered, told in (((), "not in the ledger yet"), (entered(instrument, 5), "in the ledger since 2027-03-01")):
        (reason,) = row(replace(world, remembered=remembered)).reasons
        assert reason.code == "STALE_CAL"
        proves = (
            f"certificate C-9 of 2026-04-20, {told}, was entered after the run was sealed, and proves nothing about it"
        )
        assert reason.text.endswith(f"and its calibration was due on 2026-01-10; {proves}")
    assert codes(replace(world, remembered=entered(instrument, 0))) == []


def test_a_certificate_that_was_entered_later_does_not_end_a_doubt():
    """Nor one that would have found the instrument good between the run and what found it out of tolerance."""
    bad = certificate("C-2", "2026-12-01", "2027-12-01", as_found=AsFound.OUT_OF_TOLERANCE)
    good = certificate("C-9", "2026-04-20", "2027-04-20")
    instrument = replace(INSTRUMENT, certificates=(*INSTRUMENT.certificates, good, bad))
    world = replace(closed_world(), register=register(instruments={"dmm-1": instrument}))
    assert codes(world) == ["CAL_RETRO"]


def set_back_by(days: int, *, run: str = "run-1", kind: str = "seal") -> World:
    """Return a world with a run that closes, after an entry of the ledger that is some days younger than its seal."""
    item, before = package(run), package("before", f"2026-06-{1 + days:02}", results={})
    stamps = {"seq": 3, "utc": item.ended}
    own: Entry = Head(run=run, events=1, sha256="0" * 64, state="RUNNING", **stamps)
    late = msgspec.structs.replace(seal_of(item, 4), utc="2026-06-30T00:00:00Z" if kind == "head" else item.ended)
    return world_of([before, item], [seal_of(before, 2), own, late])


@pytest.mark.parametrize("kind", ["seal", "head"])
def test_a_clock_that_was_set_back_between_two_runs_keeps_open(kind):
    """The ledger's order is older than any clock: also where the clock was put right again before the seal."""
    (reason,) = (each for each in row(set_back_by(9, kind=kind)).reasons)
    assert reason.code == "INTEGRITY"
    assert reason.text == (
        "the times of the run are implausible: line 4 of the ledger is of 2026-06-01T11:00, and line 3 before it of "
        "2026-06-10T11:00: a clock was set back, or had been ahead"
    )
    assert any("a clock was set back" in each for each in audit(set_back_by(9)).problems)


def test_clocks_of_two_computers_that_differ_by_minutes_keep_nothing_open():
    """Runs go on where the clock is as it should be, and where time has caught up."""
    item, other = package(), package("before", results={})
    before = msgspec.structs.replace(seal_of(other, 2), utc="2026-06-01T11:04:59Z")
    assert codes(world_of([other, item], [before, seal_of(item, 3)])) == []
    before = msgspec.structs.replace(before, utc="2026-06-01T11:05:01Z")
    assert codes(world_of([other, item], [before, seal_of(item, 3)])) == ["INTEGRITY"]
    assert codes(set_back_by(0)) == []


@pytest.mark.parametrize("utc", ["", "soon", "2026-06-01T11:00:00"])
def test_a_seal_without_a_moment_closes_nothing(utc):
    """Whoever takes the stamp out of a line has gained nothing."""
    item = package()
    world = world_of([item], [msgspec.structs.replace(seal_of(item), utc=utc)])
    assert [each.text.rpartition(": ")[2] for each in row(world).reasons] == [
        "line 2 of the ledger does not say when it was written"
    ]


def test_evidence_of_a_later_day_than_today_closes_nothing():
    """A clock that was ahead keeps evidence young, and a certificate valid that is not yet."""
    (reason,) = row(world_of([package(day="2026-11-23")])).reasons
    assert reason.text == "the run ended 2026-11-23, which is after 2026-11-22: a clock is wrong"
    assert codes(world_of([package(day="2026-11-22")])) == []
