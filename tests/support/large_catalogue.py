"""A large workspace: ten thousand requirements with thirty thousand results, and the same catalogue for StrictDoc."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta
from itertools import count, groupby
from pathlib import Path
from random import Random

import msgspec
from evidence_runs import DUTS_FILE, LIMIT, begin, planned
from typed_events import event_of

from hil.clock.wall import WallStamp
from hil.documents.canonical import canonical
from hil.evidence.folder import PARAMETERS
from hil.evidence.package.sealing import seal
from hil.model.figure import Figure
from hil.requirements.catalogue import load_catalogue
from hil.requirements.decision import judge
from hil.requirements.lock import LOCK, lock_text
from hil.requirements.requirement import Requirement
from hil.requirements.schema import REQUIREMENTS

__all__ = ["make_workspace", "write_sdoc"]

_PER_FILE = 500
_PER_CASE = 25
_WORDS = (
    "battery bus case cell charge command converter current cycle discharge driver error failure heater interface line"
    " load margin mission mode noise output panel phase power range ripple sensor signal state step supply telemetry"
    " temperature time transient value voltage"
)
_TEXT_WORDS = 24


def make_workspace(root: Path, requirements: int = 10_000, packages: int = 3) -> None:
    """Make a workspace in which a tenth of the requirements are above the others, and every package has all of them.

    Everything is written as the product writes it: locks, journals, results, seals and a ledger.

    Args:
        root: the folder of the workspace, which is made.
        requirements: how many requirements.
        packages: how many packages, with one result per requirement each.
    """
    testplans, fixtures = root / "testplans", root / "fixtures"
    fixtures.mkdir(parents=True)
    (root / "hil.toml").write_text('name = "large"\n', encoding="utf-8")
    (fixtures / "duts.yaml").write_text(DUTS_FILE, encoding="utf-8")
    for plan, entries in _plans(requirements):
        (testplans / plan).mkdir(parents=True)
        (testplans / plan / REQUIREMENTS).write_text(_file(plan, entries), encoding="utf-8")
    plans = sorted(file.parent for file in testplans.glob(f"*/{REQUIREMENTS}"))
    catalogue = load_catalogue(root, plans, locked=False)
    for plan in plans:
        (plan / LOCK).write_text(lock_text(catalogue.of_plan(plan.name)), encoding="utf-8")
    items = [item for plan in plans for item in catalogue.of_plan(plan.name)]
    for number in range(packages):
        day = f"2026-11-{number + 1:02}"
        _package(root / "reports" / f"{day.replace('-', '')}T100000Z-flight-SN1-{number:06}", items, testplans, day)


def write_sdoc(folder: Path, requirements: int = 10_000) -> None:
    """Write the catalogue of `make_workspace` as documents of StrictDoc, with the same texts, parents and fields.

    Args:
        folder: where the documents go, which is made.
        requirements: how many requirements.
    """
    folder.mkdir(parents=True)
    for plan, entries in _plans(requirements):
        text = "".join(_sdoc(name, words, parent) for name, words, parent in entries)
        (folder / f"{plan}.sdoc").write_text(f"[DOCUMENT]\nTITLE: {plan}\n\n{_GRAMMAR}\n{text}", encoding="utf-8")


_GRAMMAR = """\
[GRAMMAR]
ELEMENTS:
- TAG: REQUIREMENT
  FIELDS:
  - TITLE: UID
    TYPE: String
    REQUIRED: True
  - TITLE: LEVEL
    TYPE: String
    REQUIRED: False
  - TITLE: METHOD
    TYPE: String
    REQUIRED: False
  - TITLE: STATEMENT
    TYPE: String
    REQUIRED: True
  RELATIONS:
  - TYPE: Parent
"""


def _plans(requirements: int) -> Iterator[tuple[str, Sequence[tuple[str, str, str]]]]:
    """Give the plans, each with the id, the text and the parent of its requirements."""
    words = Random(7)
    above = requirements // 10
    entries = []
    for number in range(requirements):
        kind, own = ("SYS", number) if number < above else ("EPS", number - above)
        text = " ".join(words.choices(_WORDS.split(), k=_TEXT_WORDS - 3))
        parent = f"SYS-{own % above:05}" if kind == "EPS" else ""
        entries.append((f"{kind}-{own:05}", f"The {kind} shall {text}.", parent))
    for number, part in enumerate(_batched(entries, _PER_FILE)):
        yield f"plan_{number:02}", part


def _batched(items, size):
    return [items[first : first + size] for first in range(0, len(items), size)]


def _file(plan: str, entries: Sequence[tuple[str, str, str]]) -> str:
    head = f'schema: hil/requirements/1\ndocument: {{id: {plan.upper().replace("_", "-")}, issue: "1.0"}}\n'
    return f"{head}requirements:\n" + "".join(_entry(*entry) for entry in entries)


def _entry(name: str, text: str, parent: str) -> str:
    return (
        f"- id: {name}\n  rev: 1\n  text: {text}\n  kind: limit\n  method: test\n  level: equipment\n"
        + (f"  parents: [{parent}]\n" if parent else "")
        + '  limits:\n  - {parameter: rate_error, unit: deg/s, min: "-0.5", max: "0.5"}\n'
    )


def _sdoc(name: str, text: str, parent: str) -> str:
    above = f"RELATIONS:\n- TYPE: Parent\n  VALUE: {parent}\n" if parent else ""
    return f"[REQUIREMENT]\nUID: {name}\nLEVEL: equipment\nMETHOD: test\nSTATEMENT: {text}\n{above}\n"


def _package(folder: Path, items: Sequence[Requirement], testplans: Path, day: str) -> None:
    cases = list(_cases(items))
    plans = sorted({item.plan for item in items})
    files = {PARAMETERS: canonical({"format": 1, "plans": {plan: [] for plan in plans}})}
    for file in testplans.glob("*/*"):
        files[f"data/catalogue/{file.relative_to(testplans)}"] = file.read_bytes()
    journal = begin(
        folder,
        files=files,
        requirements=items,
        cases=[planned(name, [item.id for item in asked], asked[0].plan) for name, asked in cases],
        stamp=_stamps(day),
        plans=plans,
    )
    judged = judge(Figure(value=0.1, unit="deg/s", uncertainty=0.01), LIMIT)
    measured = event_of(
        "check", step="", parameter="rate_error", of=None, value=0.1, unit="deg/s", uncertainty=judged.uncertainty,
        dof=None, limit={"min": "-0.5", "max": "0.5", "equals": None}, limit_unit="deg/s", decision="guarded",
        expanded=judged.expanded, margin=judged.margin, tur=judged.tur, verdict=judged.verdict,
        reason=judged.reason, instruments=["psu1"],
    )  # fmt: skip
    for name, asked in cases:
        journal.write(event_of("case", case=name, attempt=1), 0.0)
        for item in asked:
            journal.write(msgspec.structs.replace(measured, case=name, requirement=item.id), 1.0)
        verdicts = {item.id: "PASS" for item in asked}
        ended = {"case": name, "attempt": 1, "verdict": "PASS", "reasons": [], "duration": 1.0}
        journal.write(event_of("case-end", **ended, requirements=verdicts, used={"psu1": "hardware"}), 2.0)
    journal.write(event_of("safe-end", ok=True), 3.0)
    seal(folder, journal, exit_code=0, write_reports=lambda _: None)


def _cases(items: Sequence[Requirement]) -> Iterator[tuple[str, Sequence[Requirement]]]:
    for plan, asked in groupby(items, key=lambda item: item.plan):
        for number, part in enumerate(_batched(list(asked), _PER_CASE)):
            yield f"testplans/{plan}/test_many.py::test_{number:03}", part


def _stamps(day: str) -> Callable[[], WallStamp]:
    """Return a wall clock that goes on by a tenth of a second every time it is looked at."""
    tenths = count()
    began = datetime.fromisoformat(f"{day}T10:00:00")

    def stamp() -> WallStamp:
        passed = next(tenths) / 10
        utc = (began + timedelta(seconds=passed)).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
        return WallStamp(utc=utc, boot=1.5 + passed, boot_id="one-boot")

    return stamp
