"""Runs at a glance: which there are, how far they came, and what became of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hil.clock import wall
from hil.evidence.folder import JOURNAL, RESULTS, is_held, is_sealed
from hil.evidence.journal.reader import Body, JournalLine, read_journal
from hil.evidence.package.verification import State
from hil.evidence.results.facts import read_json
from hil.model.errors import EvidenceError

__all__ = ["RunSummary", "find_runs", "status"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSummary:
    """One run at a glance; nothing here was verified.

    Attributes:
        folder: the run's folder.
        state: RUNNING, INTERRUPTED, SEALED, or DAMAGED where it cannot be read.
        plans: the plans it was asked for.
        bench: the bench's name.
        dut: the serial number of the device under test.
        source: where its bytes come from.
        purpose: why it was made.
        planned: how many cases were planned.
        ended: how many of them ended.
        case: the case that is going on, empty where none is.
        step: its step, as `1.2 title`.
        t: bench time of the newest event in s.
        age: seconds since the newest event; None where the machine was booted since.
        verdict: the sealed verdict, empty before.
    """

    folder: Path
    state: State
    plans: tuple[str, ...] = ()
    bench: str = ""
    dut: str = ""
    source: str = ""
    purpose: str = ""
    planned: int = 0
    ended: int = 0
    case: str = ""
    step: str = ""
    t: float = 0.0
    age: float | None = None
    verdict: str = ""


def find_runs(reports: Path) -> list[RunSummary]:
    """Return every run in the folder of reports, oldest first."""
    if not reports.is_dir():
        return []
    return [status(folder) for folder in sorted(reports.iterdir()) if (folder / JOURNAL).is_file()]


def status(folder: Path) -> RunSummary:
    """Return one run at a glance; it is only read, also while it goes on.

    Raises:
        EvidenceError: where this is no run's folder.
    """
    try:
        lines = read_journal(folder / JOURNAL).lines
        return _summary(folder, lines)
    except (KeyError, TypeError, AttributeError, ValueError):
        return RunSummary(folder=folder, state=State.DAMAGED)


def _summary(folder: Path, lines: tuple[JournalLine, ...]) -> RunSummary:
    events = [line.body for line in lines]
    run = next((event for event in events if event["kind"] == "run"), {})
    planned = {case["case"] for event in events if event["kind"] == "planned" for case in event["cases"]}
    case, step = _current(events)
    return RunSummary(
        folder=folder,
        state=_state(folder),
        plans=tuple(run.get("plans", ())),
        bench=run.get("bench", ""),
        dut=run.get("dut", {}).get("serial", ""),
        source=run.get("source", ""),
        purpose=run.get("purpose", ""),
        planned=len(planned),
        ended=len({event["case"] for event in events if event["kind"] == "case-end"}),
        case=case,
        step=step,
        t=events[-1]["t"] if events else 0.0,
        age=_age(lines[-1]) if lines else None,
        verdict=_verdict(folder),
    )


def _state(folder: Path) -> State:
    if is_sealed(folder):
        return State.SEALED
    return State.RUNNING if is_held(folder) else State.INTERRUPTED


def _current(events: list[Body]) -> tuple[str, str]:
    case, steps = "", list[str]()
    for event in events:
        match event["kind"]:
            case "case":
                case, steps = event["case"], []
            case "case-end":
                case, steps = "", []
            case "step":
                steps.append(f"{event['number']} {event['path'][-1]}")
            case "step-end" if steps:
                steps.pop()
    return case, steps[-1] if steps else ""


def _age(line: JournalLine) -> float | None:
    now = wall.stamp()
    return now.boot - float(line.wall["boot"]) if line.wall.get("boot_id") == now.boot_id else None


def _verdict(folder: Path) -> str:
    try:
        return str(read_json(folder / RESULTS)["verdict"]) if is_sealed(folder) else ""
    except (EvidenceError, KeyError, TypeError):
        return ""
