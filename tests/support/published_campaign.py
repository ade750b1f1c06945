"""A campaign that was published as a report, put in as packages: what is known of it, and no more.

The figures are those of the published characterisation of a PocketQube's battery, photodiodes, magnetorquers and
gyroscope: cycles between 4.2 V and 2.7 V in June 2023 (table 1), 844 hours of degradation (sections 9, 14 to 19), a
calibration of photodiodes whose results are those of a simulation (section 23), a polarity check without results
(section 26), and slopes of the gyroscope's axes at 25 degC (section 29). It names no serial number, no calibration, no
commit and no bench that could be read; photodiodes and gyroscope have no requirements at all.
"""

from __future__ import annotations

import hashlib
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evidence_runs import stamps, write_report
from typed_events import event_of

from hil.documents.canonical import canonical
from hil.evidence.events.event import NOTHING
from hil.evidence.folder import DUT, JOURNAL, PARAMETERS, RESERVE, TRANSCRIPT
from hil.evidence.journal.writer import Journal
from hil.evidence.package.bag import inventory
from hil.evidence.package.sealing import seal
from hil.evidence.results.facts import entries_of, freeze_calibration, freeze_catalogue
from hil.model.figure import Figure
from hil.requirements.catalogue import load_catalogue
from hil.requirements.decision import judge

__all__ = ["AS_PUBLISHED", "PLANS", "Said", "as_published", "put_in"]

_HEAD = 'schema: hil/requirements/1\ndocument: {{id: {id}, issue: "1.0", title: {title}}}\nrequirements:\n'
_ENTRY = "- {{id: {id}, rev: 1, text: {text}, kind: {kind}, method: test, stage: qualification{more}}}\n"
_ANY = ", limits: [{{parameter: {parameter}, unit: {unit}}}]"

_PLACE, _SOFTWARE = "data/place.json", "data/software.json"
AS_PUBLISHED = {
    "charge": ("PQ-BAT-001", "The battery can be charged."),
    "degradation": ("PQ-BAT-001", "The battery can be charged again."),
}
PLANS = {
    "charge": {
        "PQ-CHG-001": ("The charge energy of a cycle is recorded.", "characterise", _ANY, "charge_energy", "W.h"),
        "PQ-CHG-008": ("Five cycles are made at 40 and at 4 degC.", "characterise", _ANY, "cycles", '"1"'),
    },
    "degradation": {
        "PQ-DEG-003": (
            "The cell stays at or below 4.2 V.",
            "limit",
            ', limits: [{{parameter: {parameter}, unit: {unit}, max: "4.2", decision: simple}}]',
            "cell_voltage",
            "V",
        ),
        "PQ-DEG-006": ("The discharge energy of a cycle is recorded.", "characterise", _ANY, "discharge_energy", "W.h"),
    },
    "magnetorquer": {
        "PQ-MTQ-001": (
            "The field leaves the outer face.",
            "limit",
            ", limits: [{{parameter: {parameter}, equals: {unit}}}]",
            "direction",
            "outward",
        )
    },
    "photodiode": {
        "PQ-PHD-001": ("The sensitivity over temperature is recorded.", "characterise", _ANY, "sensitivity", '"1"'),
    },
    "gyroscope": {
        "PQ-GYR-001": ("The slope of the x axis at 25 degC is recorded.", "characterise", _ANY, "slope_x", '"1"'),
        "PQ-GYR-002": ("The bias over temperature is recorded.", "characterise", _ANY, "bias_x", "deg/s"),
    },
}
_PARTS = {"magnetorquer": "outer board", "photodiode": "outer board", "gyroscope": "ADCS board"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """What the report says of one campaign: cases that ran with their values, and cases that did not."""

    plan: str
    day: str
    ran: tuple[tuple[str, str, float | None], ...]
    not_run: tuple[tuple[str, str], ...] = ()
    deviations: tuple[str, ...] = ()
    source: str = "hardware"


CAMPAIGNS = (
    Said(
        plan="charge",
        day="2023-06-05",
        ran=(("ambient", "PQ-CHG-001", 7.98),),
        not_run=(("hot", "PQ-CHG-008"), ("cold", "PQ-CHG-008")),
    ),
    Said(
        plan="degradation",
        day="2023-08-01",  # the report has no date
        ran=(("cycles", "PQ-DEG-003", 4.3), ("energy", "PQ-DEG-006", 70.0)),
        deviations=("the discharges ran at 10 degC instead of the lowest 2 degC",),
    ),
    Said(plan="magnetorquer", day="2023-08-02", ran=(("polarity", "PQ-MTQ-001", None),)),
    Said(plan="photodiode", day="2023-08-03", ran=(("temperature", "PQ-PHD-001", None),), source="simulated"),
    Said(
        plan="gyroscope",
        day="2023-08-04",
        ran=(("sensitivity", "PQ-GYR-001", 1.073), ("bias", "PQ-GYR-002", None)),
        deviations=("the temperature sensor may have been damaged when the chip was soldered",),
    ),
)


def as_published(root: Path, *, judged: bool) -> Sequence[Path]:
    """Write catalogues with the ids that were published, one for two requirements, and return the plans.

    Args:
        root: the workspace.
        judged: whether they are to be judged, as they were, without limits; else they only ask for a number.
    """
    kind, more = ("limit", "") if judged else ("characterise", _ANY.format(parameter="charge_energy", unit="W.h"))
    return [
        _plan(root, plan, _ENTRY.format(id=name, text=text, kind=kind, more=more))
        for plan, (name, text) in AS_PUBLISHED.items()
    ]


def put_in(root: Path, *, bench: Mapping[str, bytes] = NOTHING, silent: Container[str] = ()) -> None:
    """Write the campaign as a workspace: catalogues with ids of their own, and a sealed package per campaign.

    Args:
        root: the workspace.
        bench: bench files that are put into the packages of some plans, where none belongs.
        silent: plans whose packages do not say that they were recorded elsewhere.
    """
    plans = [
        _plan(
            root,
            plan,
            "".join(
                _ENTRY.format(id=name, text=text, kind=kind, more=more.format(parameter=parameter, unit=unit))
                for name, (text, kind, more, parameter, unit) in entries.items()
            ),
        )
        for plan, entries in PLANS.items()
    ]
    catalogue = load_catalogue(root, plans, locked=False)
    for each, plan in zip(CAMPAIGNS, plans, strict=True):
        said = {} if each.plan in silent else {"recorded_elsewhere": "the published report of the campaign"}
        files = {"data/bench/bench.yaml": bench[each.plan]} if each.plan in bench else {}
        folder = root / "reports" / f"{each.day}-{each.plan}"
        _package(folder, each, plan, catalogue.of_plan(each.plan), more=files, said_of_itself=said)


def _plan(root: Path, plan: str, entries: str) -> Path:
    folder = root / "testplans" / plan
    folder.mkdir(parents=True)
    head = _HEAD.format(id=plan.upper(), title=plan)
    (folder / "requirements.yaml").write_text(head + entries, encoding="utf-8")
    return folder


def _package(folder: Path, said: Said, plan: Path, requirements, *, more, said_of_itself) -> str:
    """Write a run as far as the report tells, and seal it."""
    known = {item.id: item for item in requirements}
    shown = f"testplans/{said.plan}/requirements.yaml"
    text = (plan / "requirements.yaml").read_bytes()
    dut = {"serial": "", "part": _PARTS.get(said.plan, "battery"), "model": "QM",
           "hardware": "", "firmware": "", "title": ""}  # fmt: skip
    (folder / "data/recordings").mkdir(parents=True)
    hashes = {
        "catalogue": freeze_catalogue(folder, entries_of(requirements)),
        "calibration": freeze_calibration(folder, {}),
    }
    for path, data in {
        f"data/catalogue/{said.plan}/requirements.yaml": text,
        PARAMETERS: canonical({"format": 1, "plans": {said.plan: []}}),
        DUT: canonical({**dut, "format": 1}),
        _PLACE: b'{"format":1,"host":"","workspace":{"fixtures":"fixtures","testplans":"testplans"}}',
        _SOFTWARE: b'{"format":1}',
        **more,
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(data)
    files = inventory(folder)
    beside = {path: files.pop(path) for path in (_PLACE, _SOFTWARE)}
    (folder / TRANSCRIPT).write_bytes(b"hil/transcript/1\n")
    hashes["parameters"] = hashlib.sha256((folder / PARAMETERS).read_bytes()).hexdigest()
    hashes["sources"] = _over(f"{hashlib.sha256(text).hexdigest()}  {shown}\n")
    hashes["bench_files"] = _over(
        "".join(f"{hashlib.sha256(data).hexdigest()}  {Path(path).name}\n" for path, data in more.items())
    )
    journal = Journal(folder / JOURNAL, reserve=folder / RESERVE, stamp=stamps(said.day))
    run = {"format": 1, "bench": "as published", "source": said.source, "purpose": "qualification", "dut": dut,
           "operator": "", "plans": [said.plan], "seed": "", "version": "", "overrides": {}, "skips": {},
           "deviations": list(said.deviations), "live": {"speed": 1.0, "served": False}, **said_of_itself}  # fmt: skip
    journal.write(event_of("run", **run, **hashes), 0.0)
    journal.write(event_of("frozen", files=files), 0.0, beside={"files": beside})
    cases = [(case, name) for case, name, _ in said.ran] + list(said.not_run)
    planned = [
        {"case": case, "title": "", "plan": said.plan, "requirements": [name], "max_duration": 0.0}
        for case, name in cases
    ]
    journal.write(event_of("planned", cases=planned), 0.0)
    for case, name, value in said.ran:
        _case(journal, case, known[name], value)
    for case, name in said.not_run:
        _end(journal, case, name, "NOT_RUN", "the report says that it was left for later")
    return seal(folder, journal, exit_code=1, write_reports=write_report)


def _over(lines: str) -> str:
    return hashlib.sha256(lines.encode()).hexdigest()


def _case(journal: Journal, case: str, item, value: float | None) -> None:
    journal.write(event_of("case", case=case, attempt=1), 0.0)
    if value is None:
        _end(journal, case, item.id, "NOT_EVALUATED", "the report has no result")
        return
    (limit,) = item.limits
    judged = judge(Figure(value=value, unit=limit.unit), limit)
    bounds = {"min": limit.minimum, "max": limit.maximum, "equals": limit.equals}
    fields = {"case": case, "step": "", "requirement": item.id, "parameter": limit.parameter, "of": None,
              "value": value, "unit": limit.unit, "uncertainty": None, "dof": None, "limit": bounds,
              "limit_unit": limit.unit,
              "decision": limit.decision, "expanded": None, "margin": judged.margin, "tur": None,
              "verdict": judged.verdict, "reason": judged.reason, "instruments": [],
              "unproven": ["the number was taken from a printed report"]}  # fmt: skip
    journal.write(event_of("check", **fields), 1.0)
    _end(journal, case, item.id, str(judged.verdict), judged.reason)


def _end(journal: Journal, case: str, name: str, verdict: str, reason: str) -> None:
    fields = {"case": case, "attempt": 1, "verdict": verdict, "reasons": [reason] if reason else [], "duration": 1.0,
              "requirements": {name: verdict}, "used": {}}  # fmt: skip
    journal.write(event_of("case-end", **fields), 1.0)
