"""Eligibility: everything that has to be proven, taken away one by one from a run that proves it all."""

from __future__ import annotations

import dataclasses

import msgspec
import pytest
from evidence_runs import REQUIREMENTS, begin, sealed_run, whole_case

from hil.evidence.events import Answer, Case, CaseEnd, Question
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.verification import verify
from hil.evidence.results.derived import derive
from hil.evidence.results.facts import entries_of, facts_of
from hil.evidence.results.software import FrozenSoftware
from hil.executive.setup.software import require_assertions
from hil.model.errors import Refused
from hil.model.identity import Source


@pytest.fixture(scope="module")
def proven(tmp_path_factory):
    """Return events and facts of a run that can close its requirements."""
    folder = tmp_path_factory.mktemp("proven")
    with begin(folder) as journal:
        whole_case(folder, journal)
    reading = read_journal(folder / JOURNAL)
    return reading.events, facts_of(folder, reading)


def reasons(events, facts):
    """Return why the first requirement cannot be closed."""
    found = derive(events, facts, content_digest="").requirements
    return list(next(each for each in found if each.id == "GYR-030").reasons)


def changed(events, kind, **fields):
    """Return the events with other fields in those of a kind."""
    return [replaced(each, fields) if each.kind() == kind else each for each in events]


def replaced(event, fields):
    """Return an event with other fields."""
    return msgspec.structs.replace(event, **{name: each for name, each in fields.items() if hasattr(event, name)})


def test_a_run_that_proves_everything_can_close(proven):
    """Nothing is against it, and every condition tells what proves it."""
    assert reasons(*proven) == []
    found = derive(*proven, content_digest="")
    assert all(each.proven and each.text for each in found.conditions)


def test_limits_of_the_envelope_are_counted_in_words(proven):
    """One limit was tried, two were tried."""
    events, facts = proven
    gate = next(each for each in events if each.kind() == "gate" and each.name.startswith("envelope "))
    others = [each for each in events if each.kind() != "gate" or not each.name.startswith("envelope ")]
    for gates, told in (
        ([gate], "1 limit of the envelope was tried"),
        ([gate] * 2, "2 limits of the envelope were tried"),
    ):
        found = derive([*others, *gates], facts, content_digest="")
        assert told in {each.text for each in found.conditions}


def test_a_bench_that_was_not_armed_may_have_an_envelope(proven):
    """Nobody tried it: that is another reason than a bench without one."""
    events, facts = proven
    found = reasons([each for each in events if each.kind() not in {"armed", "gate"}], facts)
    assert "the bench was not armed, so no limit of the envelope was tried" in found
    assert "the bench has no envelope" not in found


@pytest.mark.parametrize(
    ("kind", "fields", "reason"),
    [
        ("run", {"operator": ""}, "no operator is named"),
        ("run", {"live": None}, "the run's source is hardware, but its bench was in the process of the run"),
        ("gate", {"unproven": "the bench file does not say who psu1 is"}, "the bench file does not say who psu1 is"),
        ("gate", {"name": "other"}, "the bench has no envelope"),
        ("gate", {"instrument": ""}, "it was not asked who psu1 is"),
        ("host-gate", {"instrument": ""}, "it is not known what is at the port of psu1"),
        ("host-gate", {"unproven": "psu1: its bytes were not seen"}, "psu1: its bytes were not seen"),
        ("host-gate", {"ok": False, "detail": "gone"}, "readiness gate source of psu1: gone"),
        ("host-gate", {"source": Source.SIMULATED}, "SIMULATED: psu1"),
    ],
)
def test_what_the_journal_does_not_show_is_a_reason(proven, kind, fields, reason):
    """Attack: hardware in name, with no identity, no operator, no envelope, or a bench that is served."""
    events, facts = proven
    assert reason in reasons(changed(events, kind, **fields), facts)


@pytest.mark.parametrize(
    ("software", "reason"),
    [
        ({"workspace": {"commit": {"id": ""}}}, "the workspace is not in version control"),
        ({"workspace": {"commit": {"id": "2" * 40, "changed": True}}}, "the workspace differs from its commit"),
        ({"hil": {"commit": {"id": "1" * 40, "changed": True}}}, "the product differs from its commit 111111111111"),
        ({"flags": {"optimize": 1}}, "Python ran without assertions"),
        ({"flags": None}, "it is not recorded that Python ran with assertions"),
    ],
)
def test_software_that_is_not_proven_is_a_reason(proven, software, reason):
    """Attack: a workspace outside version control, a changed product, a Python that leaves assertions out."""
    events, facts = proven
    whole = msgspec.to_builtins(facts.software) | software
    told = reasons(events, dataclasses.replace(facts, software=msgspec.convert(whole, FrozenSoftware)))
    assert len(told) == 1
    assert told[0].startswith(reason)


@pytest.mark.parametrize(
    ("purpose", "model", "fields", "reason"),
    [
        ("acceptance", "FM", {}, "its stage is qualification, but the run's purpose is acceptance"),
        ("qualification", "EM", {}, "the device under test is an EM, which closes nothing"),
        ("qualification", "FM", {}, "its stage is qualification, which takes a QM, but the device under test is an FM"),
        ("qualification", "QM", {"stage": ""}, "the requirement names no stage"),
        ("qualification", "QM", {"stage": "in-orbit"}, "its stage is in-orbit, which no run closes"),
        (
            "qualification",
            "QM",
            {"method": "review"},
            "its method is review, and no document was attached in its cases",
        ),
        (
            "qualification",
            "QM",
            {"witness": "quality"},
            "it asks for a witness (quality), and none confirmed an answer",
        ),
        ("qualification", "QM", {"independent": True}, "it asks for a witness (somebody else than who did it)"),
        ("qualification", "QM", {"method": "inspection"}, "its method is inspection, and nobody answered"),
    ],
)
def test_purpose_stage_model_and_method_must_fit(proven, purpose, model, fields, reason):
    """Attack: an engineering model, a requirement of another stage, one that is verified by review."""
    events, facts = proven
    first = events[0]
    run = msgspec.structs.replace(
        first,
        purpose=type(first.purpose)(purpose),
        dut=msgspec.structs.replace(first.dut, model=type(first.dut.model)(model)),
    )
    entries = entries_of(REQUIREMENTS)
    entries["GYR-030"] = msgspec.structs.replace(entries["GYR-030"], **fields)
    told = reasons([run, *events[1:]], dataclasses.replace(facts, catalogue=entries))
    assert any(each.startswith(reason) for each in told), told


@pytest.mark.parametrize(
    ("fields", "asked", "witness", "reason"),
    [
        ({"witness": "quality"}, "Quality", "Quinn", ""),
        ({"independent": True}, "technician", "Quinn", ""),
        ({"witness": "quality"}, "technician", "Quinn", "by Quinn (technician)"),
        ({"witness": "quality"}, "quality", "", "none confirmed an answer of its cases"),
    ],
)
def test_a_witness_counts_in_the_role_that_was_asked_for(proven, fields, asked, witness, reason):
    """Attack: the requirement asks for quality assurance, and a technician saw some answer of its cases."""
    events, facts = proven
    case = next(each.case for each in events if isinstance(each, Case))
    question = Question(case=case, step="", name="q", form="confirm", text="?", options=(), witness=asked)
    answer = Answer(case=case, step="", name="q", value=True, by="Ada", witness=witness)
    place = next(number for number, each in enumerate(events) if isinstance(each, CaseEnd))
    entries = entries_of(REQUIREMENTS)
    entries["GYR-030"] = msgspec.structs.replace(entries["GYR-030"], **fields)
    told = reasons([*events[:place], question, answer, *events[place:]], dataclasses.replace(facts, catalogue=entries))
    assert len(told) == bool(reason), told
    assert reason in "".join(told)


def test_records_beside_limits_are_due(proven):
    """Attack: a requirement of kind limit asks for a recording that is never made; formats before did not notice."""
    events, facts = proven
    entries = entries_of(REQUIREMENTS)
    entries["GYR-030"] = msgspec.structs.replace(entries["GYR-030"], records={"recording": "rest"})
    with_records = dataclasses.replace(facts, catalogue=entries)
    verdicts = [
        {each.id: each.verdict for each in derive(events, with_records, content_digest="", form=form).requirements}
        for form in (2, 3)
    ]
    assert [each["GYR-030"] for each in verdicts] == ["PASS", "NOT_EVALUATED"]


def test_a_package_that_claims_hardware_and_was_simulated_is_damaged(tmp_path):
    """Attack: the source is rewritten to hardware in a run whose bench lived in its own process."""
    sealed_run(tmp_path, live=None)
    (finding,) = verify(tmp_path).findings
    assert finding.message == "field 'source' is hardware, but its bench was in the process of the run"


def test_a_python_without_assertions_is_refused():
    """Attack: PYTHONOPTIMIZE=1 lets a plan's assertions pass unseen."""
    require_assertions(0)
    with pytest.raises(Refused, match="leaves assertions out"):
        require_assertions(1)
