"""The engine: what stands against evidence, roll-up, gaps, counts."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace

import msgspec
import pytest
from audited import ASKED, PARENT, changed_package, closed_world, codes, package, result, row, seal_of, world_of

from hil.audit.engine import audit
from hil.audit.inputs import Policy
from hil.audit.ledgered import DISPOSITION
from hil.audit.pages.page import as_html
from hil.audit.pages.terminal import GROUPS, as_lines
from hil.audit.pages.workbook import _summary as summary_sheet
from hil.audit.pages.workbook import as_xlsx
from hil.audit.reasons import Code
from hil.audit.tables import as_csv, as_json
from hil.evidence.ledger.entries import Head
from hil.evidence.results.eligibility import of_simulation
from hil.model.identity import Source
from hil.requirements.carried import CarryingCase

FAIL = {ASKED.id: result(verdict="FAIL", failed=True, eligible=False, reasons=("its verdict is FAIL",))}


def test_a_fail_after_good_evidence_opens_the_requirement_again():
    """A fail after good evidence opens the requirement again."""
    world = world_of([package(), package("run-2", "2026-06-02", results=FAIL)])
    assert codes(world) == ["SUPERSEDED_BY_FAIL"]
    assert row(world).compliance == "no"
    assert "it failed on 2026-06-02" in row(world).reasons[0].text


def test_running_again_until_it_passes_leaves_the_fail_open():
    """A flaky case is run again until it passes, without anybody saying what was done about the FAIL."""
    world = world_of([package("run-0", "2026-05-01", results=FAIL), package()])
    assert codes(world) == ["OPEN_NCR"]
    assert row(world).compliance == "partial"


def test_old_trials_on_a_simulated_bench_are_not_why_a_requirement_is_open():
    """Only the newest of a unit is; each is still listed as evidence, and a FAIL of hardware is never left out."""
    broken = {
        ASKED.id: result(verdict="ERROR", eligible=False, reasons=("the envelope tripped", "its verdict is ERROR"))
    }
    trial = {"source": Source.SIMULATED, "purpose": "development"}
    runs = [package(f"run-{n}", f"2026-06-0{n}", results=broken, **trial) for n in (1, 2)]
    runs += [package("run-3", "2026-06-03", **trial)]
    assert codes(world_of(runs)) == ["SIM_ONLY"]
    assert len(row(world_of(runs)).evidence) == 3
    assert codes(world_of([package("run-0", "2026-05-01", results=FAIL), *runs])) == [
        "NO_VERDICT",
        "FAILED",
        "SIM_ONLY",
    ]


def test_a_fail_that_was_disposed_of_no_longer_counts():
    """A fail that was disposed of no longer counts."""
    world = world_of([package("run-0", "2026-05-01", results=FAIL), package()])
    said = Policy(valid={"run-0-digest": frozenset({DISPOSITION})})
    assert codes(replace(world, policy=said)) == []


def test_a_fail_alone():
    """A fail alone."""
    world = world_of([package(results=FAIL)])
    assert codes(world) == ["NO_VERDICT", "FAILED"]
    assert row(world).compliance == "no"


def test_a_fail_below_a_worse_verdict_is_still_a_fail():
    """A fail below a worse verdict is still a fail."""
    aborted = {ASKED.id: result(verdict="ABORTED", failed=True)}
    assert codes(world_of([package(), package("run-2", "2026-06-02", results=aborted)])) == ["SUPERSEDED_BY_FAIL"]


def test_a_fail_of_a_simulated_or_a_development_run_speaks_against_nothing():
    """A fail of a simulated or a development run speaks against nothing."""
    for field in ({"source": "simulated"}, {"purpose": "development"}):
        assert codes(world_of([package(), package("run-2", "2026-06-02", results=FAIL, **field)])) == []


def test_a_damaged_package_opens_its_requirements_and_no_other():
    """One flipped bit in a raw file: everything that the package speaks of is open, and nothing else."""
    other = msgspec.structs.replace(ASKED, id="LOAD-020")
    results = {"LOAD-020": result()}
    damaged = package(
        "run-2", "2026-06-02", sealed=False, digest="", problem="data/journal.jsonl: changed", results=results
    )
    world = replace(world_of([package(), package("run-3", results=results), damaged]), asked=(PARENT, ASKED, other))
    assert codes(world, "LOAD-010") == []
    assert codes(world, "LOAD-020") == ["INTEGRITY"]
    assert row(world, "LOAD-020").reasons[0].package == "run-2"


def test_a_rewritten_package_is_not_the_one_that_was_sealed():
    """A full rewrite, bagged again: whole in itself, and another than the ledger saw."""
    rewritten = package(digest="other", named="other")
    assert codes(world_of([rewritten], [seal_of(package())])) == ["INTEGRITY", "MISSING_PACKAGE"]


def test_a_package_that_was_taken_away_opens_everything_that_it_may_have_spoken_of():
    """A package that was taken away opens everything that it may have spoken of."""
    failing = package("run-2", "2026-06-02", results=FAIL)
    world = world_of([package()], [seal_of(package(), 1), seal_of(failing, 2)])
    assert codes(world) == ["MISSING_PACKAGE"]
    assert "run-2" in audit(world).problems[0]


def heads_of(run, *counts, **fields):
    """Return heads of a running journal in the ledger."""
    return [
        Head(seq=9 + number, utc="2026-06-02T10:00:00Z", run=run, events=count, sha256="", state="RUNNING", **fields)
        for number, count in enumerate(counts)
    ]


def test_a_run_that_was_deleted_before_its_seal_is_missed():
    """A run measured a FAIL, and its folder or its journal is deleted before the seal: the ledger saw it running."""
    there = package("run-2", "2026-06-02", sealed=False, digest="", named="", results={})
    seal, heads = seal_of(package()), heads_of("run-2", 3, 9, source="hardware")
    assert codes(world_of([package()], [seal, *heads])) == ["MISSING_PACKAGE"]
    assert codes(world_of([package(), there], [seal, *heads])) == []
    cut = changed_package(there, known=False, problem="the journal was cut")
    assert codes(world_of([package(), cut], [seal, *heads])) == ["MISSING_PACKAGE"]
    assert "run-2 ran until 2026-06-02T10:00:00Z, and was not sealed: the journal was cut; its outcome is unknown" in (
        audit(world_of([package(), cut], [seal, *heads])).problems
    )


def test_nobody_misses_a_run_that_measured_nothing_or_was_simulated():
    """A run that ended before its first reading, and one on a simulated bench."""
    seal = seal_of(package())
    assert codes(world_of([package()], [seal, *heads_of("run-2", 3, source="hardware")])) == []
    assert codes(world_of([package()], [seal, *heads_of("run-2", 3, 9, source="simulated")])) == []
    assert codes(world_of([package()], [seal, *heads_of("run-2", 3, 9)])) == ["MISSING_PACKAGE"]


def test_a_damaged_ledger_closes_nothing():
    """The line of a FAIL's seal is made unreadable and its package deleted: nobody can tell what is missing."""
    world = replace(closed_world(), problems=(".ledger/ledger.jsonl:3:1: the line was changed",))
    assert codes(world) == ["INTEGRITY"]
    assert row(world).reasons[0].text.startswith("the ledger cannot show which packages are missing")


def test_nobody_misses_a_simulated_package():
    """Nobody misses a simulated package."""
    simulated = package("run-2", source="simulated")
    assert codes(world_of([package()], [seal_of(package(), 1), seal_of(simulated, 2)])) == []


def test_a_parent_is_closed_by_its_children_and_tells_whose_fail_it_has():
    """A parent is closed by its children and tells whose fail it has."""
    world = world_of([package(results=FAIL)])
    found = row(world, "EPS-001")
    assert [(reason.code, reason.origin) for reason in found.reasons] == [
        ("CHILD_OPEN", "LOAD-010"),
        ("FAILED", "LOAD-010"),
    ]
    assert found.compliance == "no"


def test_a_parent_with_some_children_met_is_met_in_part():
    """A parent with some children met is met in part."""
    other = msgspec.structs.replace(ASKED, id="LOAD-020")
    world = replace(closed_world(), asked=(PARENT, ASKED, other))
    assert row(world, "EPS-001").compliance == "partial"
    assert [reason.text for reason in row(world, "EPS-001").reasons] == ["LOAD-020 is open: NO_EVIDENCE"]


def test_a_fail_is_told_all_the_way_up():
    """A fail is told all the way up."""
    top = msgspec.structs.replace(PARENT, id="SAT-001")
    middle = msgspec.structs.replace(PARENT, parents=("SAT-001",))
    world = replace(world_of([package(results=FAIL)]), asked=(top, middle, ASKED))
    assert ("FAILED", "LOAD-010") in [(each.code, each.origin) for each in row(world, "SAT-001").reasons]


def test_a_parent_without_children_is_a_gap_and_open():
    """A parent without children is a gap and open."""
    world = replace(closed_world(), asked=(PARENT,))
    assert codes(world, "EPS-001") == ["NO_CHILDREN"]
    assert ("parent without children", "EPS-001") in [(gap.kind, gap.name) for gap in audit(world).gaps]


def test_a_withdrawn_requirement_is_not_asked_for():
    """A withdrawn requirement is not asked for."""
    world = replace(
        closed_world(), asked=(PARENT, ASKED, msgspec.structs.replace(ASKED, id="LOAD-099", withdrawn=True))
    )
    assert [found.id for found in audit(world).rows] == ["EPS-001", "LOAD-010"]
    assert codes(world, "EPS-001") == []


def test_gaps_in_both_directions():
    """Gaps in both directions."""
    unasked = changed_package(package(), orphans=("test_load.py::test_x",), results={"OLD-010": result(cases=())})
    gaps = [(gap.kind, gap.name) for gap in audit(world_of([unasked])).gaps]
    assert gaps == [
        ("case without requirement", "test_load.py::test_x"),
        ("evidence without requirement", "OLD-010"),
        ("requirement without case", "LOAD-010"),
    ]


CASE = CarryingCase(
    case="testplans/load/test_load.py::test_load", place="test_load.py:1", requirements=(ASKED.id,), marked=True
)


def test_a_plan_that_never_ran_is_no_gap():
    """A requirement whose case stands in the plan has one, although no package knows it."""
    world = replace(world_of([]), cases=(CASE,))
    assert not audit(world).gaps
    assert row(world).planning.cases == (CASE.case,)


def test_a_case_that_was_taken_out_of_its_plan_leaves_a_gap():
    """An old package does not hide that nothing verifies the requirement any more."""
    world = replace(closed_world(), cases=())
    assert [(gap.kind, gap.name) for gap in audit(world).gaps] == [("requirement without case", ASKED.id)]


def test_ids_that_a_marker_computes_are_known_by_the_packages():
    """What the sources do not tell is no gap where a package has the case."""
    computed = replace(CASE, requirements=())
    assert not audit(replace(closed_world(), cases=(computed,))).gaps


def test_parameters_of_a_case_come_from_the_package():
    """The newest package knows the cases with their parameters."""
    several = (f"{CASE.case}[x]", f"{CASE.case}[y]", "testplans/load/test_load.py::test_gone")
    world = replace(closed_world(results={ASKED.id: result(cases=several)}), cases=(CASE,))
    assert row(world).planning.cases == several[:2]


def test_a_case_without_requirement_is_found_in_the_sources():
    """An orphan is told with its place, and not again for each of its parameters."""
    orphan = replace(CASE, requirements=(), marked=False, case="testplans/load/test_load.py::test_x")
    world = replace(closed_world(orphans=(f"{orphan.case}[1]",)), cases=(CASE, orphan))
    assert [(gap.kind, gap.name, gap.where) for gap in audit(world).gaps] == [
        ("case without requirement", orphan.case, orphan.place)
    ]


def test_what_no_case_can_verify_says_so():
    """What no case can verify says so."""
    review = msgspec.structs.replace(ASKED, method="review")
    found = row(replace(world_of([]), asked=(review,)))
    assert found.reasons[0].text == "it is verified by review, and neither a package nor a verification shows that"
    assert not audit(replace(world_of([]), asked=(review,))).gaps


def test_a_simulated_campaign_closes_nothing_and_says_what_it_would_close():
    """A simulated campaign closes nothing and says what it would close."""
    source = "the run's source is simulated"
    said = {ASKED.id: result(eligible=False, reasons=(source, "SIMULATED: dmm"), of_simulation=(source,))}
    simulated = closed_world(source="simulated", results=said)
    assert audit(simulated).summary.on_hardware == ("EPS-001", "LOAD-010")
    assert audit(simulated).summary.closed == 0
    also = {ASKED.id: result(eligible=False, reasons=("SIMULATED: dmm", "the operator is not named"))}
    assert audit(closed_world(source="simulated", results=also)).summary.on_hardware == ()


PORT = "it is not known what is at the port of dmm"
DEVELOPMENT = "the purpose development does not close requirements"
SIMULATED = result(
    eligible=False,
    reasons=("the run's source is simulated", PORT, DEVELOPMENT, "no operator is named"),
    of_simulation=("the run's source is simulated", PORT, DEVELOPMENT),
)


def test_what_a_simulated_run_leaves_open_on_hardware_is_listed():
    """What comes from the simulation falls away, and every other reason stays, counted in the summary."""
    document = audit(closed_world(source="simulated", results={ASKED.id: SIMULATED}))
    left = row(document).on_hardware
    assert left is not None
    assert left.package == "run-1"
    assert [(each.code, each.text) for each in left.reasons] == [("NOT_ELIGIBLE", "no operator is named")]
    assert document.summary.elsewhere == 2
    assert document.summary.left_open == {"a requirement below it would stay open": 1, "no operator is named": 1}


def test_a_simulated_unit_stands_for_one_that_has_to_be_there():
    """On hardware, a unit of the requirement's stage is needed, and the register has one or not."""
    simulated = result(eligible=False, reasons=SIMULATED.reasons[:3], of_simulation=SIMULATED.of_simulation)
    changes = {"source": "simulated", "serial": "SIM-1", "simulated_unit": True, "purpose": "development"}
    there = closed_world(results={ASKED.id: simulated}, **changes)
    there = replace(there, asked=(PARENT, msgspec.structs.replace(ASKED, stage="acceptance")))
    assert audit(there).summary.on_hardware == ("EPS-001", "LOAD-010")
    left = row(replace(there, register=replace(there.register, duts={}))).on_hardware
    assert left is not None
    assert [each.text for each in left.reasons] == ["the register has no FM of the part LOAD-1"]


def test_a_fail_on_hardware_stays_whatever_a_simulated_run_says():
    """A simulated PASS would not close on hardware what failed there."""
    simulated = package("run-2", "2026-06-02", source="simulated", results={ASKED.id: SIMULATED})
    left = row(world_of([package("run-0", "2026-05-01", results=FAIL), simulated])).on_hardware
    assert left is not None
    assert "FAILED" in {each.code for each in left.reasons}


def test_evidence_from_hardware_is_not_supposed_to_be_anywhere_else():
    """Where every run was on hardware, there is nothing to suppose."""
    world = closed_world(results={ASKED.id: result(eligible=False, reasons=("no operator is named",))})
    assert row(world).on_hardware is None
    assert audit(world).summary.elsewhere == 0


@pytest.mark.parametrize(
    ("name", "text", "bench", "unit"),
    [
        ("source", "the run's source is simulated", True, True),
        ("instruments", "SIMULATED: dmm", True, True),
        ("port", PORT, True, True),
        ("model", "the device under test is the model EM: it closes nothing", False, True),
        ("purpose", DEVELOPMENT, False, True),
        ("stage", "its stage is acceptance, but the run's purpose is development", False, True),
        ("stage", "the requirement names no stage", False, False),
        ("operator", "no operator is named", False, False),
        ("product", "the product is not in version control", False, False),
        ("calibration", "dmm has no calibration record", False, False),
        ("verdict", "its verdict is FAIL", False, False),
    ],
)
def test_what_a_simulated_bench_or_unit_cannot_meet(name, text, bench, unit):
    """Conditions that are consequences of the simulation, of the bench alone and of the unit with it."""
    assert of_simulation(name, text, unit=False) is bench
    assert of_simulation(name, text, unit=True) is unit


def test_every_form_of_the_document_says_what_hardware_would_leave_open():
    """JSON, CSV, HTML and XLSX."""
    document = audit(closed_world(source="simulated", results={ASKED.id: SIMULATED}))
    told = json.loads(as_json(document))
    assert [each.get("on_hardware", {}).get("reasons", [])[-1]["text"] for each in told["rows"]] == [
        "LOAD-010 would stay open",
        "no operator is named",
    ]
    assert "NOT_ELIGIBLE: no operator is named" in as_csv(document).decode().splitlines()[-1]
    assert "The same run on hardware: open: NOT_ELIGIBLE" in "".join(as_html(document, ""))
    with zipfile.ZipFile(io.BytesIO(as_xlsx(document))) as book:
        assert 'name="On hardware"' in book.read("xl/workbook.xml").decode()


def test_a_chain_of_ten_thousand_parents_is_walked():
    """A chain of ten thousand parents is walked."""
    chain = [msgspec.structs.replace(PARENT, id=f"A-{n:05}", parents=(f"A-{n - 1:05}",)) for n in range(10_000)]
    assert audit(replace(world_of([]), asked=tuple(chain))).summary.open == 10_000


def test_counts():
    """Counts."""
    summary = audit(world_of([package(results=FAIL)])).summary
    assert (summary.requirements, summary.closed, summary.open) == (2, 0, 2)
    assert summary.reasons == {"NO_VERDICT": 1, "FAILED": 2, "CHILD_OPEN": 1}
    assert summary.compliance == {"yes": 0, "partial": 0, "no": 2}


def test_every_form_of_the_document_tells_what_stands_for_hardware():
    """The requirement is closed, and nobody overlooks by whose word its instrument is hardware."""
    reason = "socket://localhost:1 stands for hardware: a bridge"
    world = world_of([package(exceptions=(("dmm", reason),)), package("run-2", "2026-06-02")])
    document = audit(world)
    assert [(each.package, each.instrument, each.reason) for each in document.exceptions] == [("run-1", "dmm", reason)]
    assert [each.exceptions for each in row(document).evidence] == [("dmm",), ()]
    assert document.summary.by_exception == 0  # the newer package closes it without one
    alone = audit(world_of([package(exceptions=(("dmm", reason),))]))
    assert (row(alone).close_out, alone.summary.by_exception) == ("closed", 1)
    assert json.loads(as_json(alone))["exceptions"] == [{"instrument": "dmm", "package": "run-1", "reason": reason}]
    assert f"EXCEPTION: run-1: dmm: {reason}" in as_csv(alone).decode()
    page = "".join(as_html(alone, "reports"))
    assert f"run-1: dmm: {reason}" in page
    assert "EXCEPTION: dmm" in page
    told = "\n".join(as_lines(alone))
    assert f"  run-1\n    dmm: {reason}" in told
    assert "1 requirement is closed by such runs" in told
    with zipfile.ZipFile(io.BytesIO(as_xlsx(alone))) as book:
        summary, evidence = (book.read(f"xl/worksheets/sheet{number}.xml").decode() for number in (1, 3))
    assert f"run-1: dmm: {reason}" in summary
    assert "<t>dmm</t>" in evidence


def test_every_form_of_the_document_lists_drivers_of_other_packages():
    """Also where nothing speaks against them."""
    told = "driver ina226 of package hil-ina226 1.2 is as it was installed from an index"
    document = audit(world_of([package(others=(told,))]))
    assert json.loads(as_json(document))["others"] == [{"package": "run-1", "text": told}]
    lines = list(as_lines(document))
    assert lines[lines.index("parts of other packages:") + 1].startswith(f"  {told[:60]}")
    twice = audit(world_of([package(others=(told,)), package("run-2", others=(told,))]))
    text = " ".join(" ".join(as_lines(twice)).split())
    assert (text.count(told), f"{told} (2 runs)" in text) == (1, True)
    assert f"run-1: {told}" in "".join(as_html(document, "reports"))
    assert ("Part of another package", f"run-1: {told}") in list(summary_sheet(document))


def test_every_code_has_one_place_on_the_terminal():
    """Nothing that keeps a requirement open is left out, or told twice."""
    assert sorted(code for codes in GROUPS.values() for code in codes) == sorted(Code)


def test_the_terminal_keeps_to_its_width():
    """Sentences are wrapped, the worst group comes first, and what follows a count is aligned."""
    told = list(as_lines(audit(world_of([package(results=FAIL)]))))
    assert max(map(len, told)) <= 80
    assert told.index("  Failed on hardware") < told.index("  Evidence not sufficient")
