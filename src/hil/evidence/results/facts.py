"""What was frozen before the first step, and what verdicts are judged by: catalogue, calibration, date."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.evidence.durable import read_plain, write_whole
from hil.evidence.events import Results
from hil.evidence.folder import CALIBRATION, CATALOGUE
from hil.evidence.journal.reader import JournalReading
from hil.model.errors import EvidenceError
from hil.requirements.requirement import Decision, Limit, Requirement

__all__ = [
    "Entries",
    "Facts",
    "entries_of",
    "facts_of",
    "freeze_calibration",
    "freeze_catalogue",
    "limit_of",
    "read_json",
]

Entries = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """What results are derived from, in addition to the events.

    Attributes:
        catalogue: per requirement id: rev, text, kind, method, source, and its limits where it has some.
        calibration: per instrument: certificate, due (ISO 8601, empty if unknown), dut.
        date: the day on which calibrations must still count, ISO 8601; the run's last one.
    """

    catalogue: Entries
    calibration: Entries = field(default_factory=dict)
    date: str = ""


def entries_of(requirements: Iterable[Requirement]) -> Entries:
    """Return requirements as `freeze_catalogue` takes them."""
    return {item.id: {**_entry(item), "limits": [_limit(limit) for limit in item.limits]} for item in requirements}


def freeze_catalogue(folder: Path, requirements: Entries) -> str:
    """Write the requirements as they stand into the package; return the SHA-256 that the `run` event names.

    Args:
        folder: the run's folder.
        requirements: what `entries_of` gives.
    """
    return _freeze(folder / CATALOGUE, {"format": 1, "requirements": requirements})


def freeze_calibration(folder: Path, instruments: Entries) -> str:
    """Write every instrument's calibration record (certificate, due, dut) into the package; return the SHA-256."""
    return _freeze(folder / CALIBRATION, {"format": 1, "instruments": instruments})


def facts_of(folder: Path, reading: JournalReading) -> Facts:
    """Return what the results of this run are derived by.

    A run that ended before something was frozen has nothing there, and nothing in it can close a requirement.

    Raises:
        EvidenceError: if a frozen file cannot be read.
    """
    before = takewhile(lambda line: not isinstance(line.event, Results), reading.lines)
    return Facts(
        catalogue=_frozen(folder / CATALOGUE, "requirements"),
        calibration=_frozen(folder / CALIBRATION, "instruments"),
        date=max((str(line.wall.get("utc", ""))[:10] for line in before), default=""),
    )


def read_json(path: Path) -> Any:  # noqa: ANN401 - JSON holds what it holds
    """Return what a JSON file of the package says.

    Raises:
        EvidenceError: if it is missing or is not strict JSON.
    """
    try:
        return parse_strict(read_plain(path))
    except OSError as error:
        raise EvidenceError(f"{path}: cannot be read: {error.strerror}", "see hil verify") from error
    except JsonError as error:
        raise EvidenceError(f"{path}: {error.message}", "see hil verify") from error


def limit_of(item: Mapping[str, Any]) -> Limit:
    """Return a limit from its frozen form."""
    return Limit(
        parameter=item["parameter"],
        of=tuple(item["of"]),
        unit=item["unit"],
        minimum=item["min"],
        maximum=item["max"],
        equals=item["equals"],
        decision=Decision(item["decision"]),
        min_tur=item["min_tur"],
    )


def _entry(item: Requirement) -> dict[str, Any]:
    return {
        "rev": item.rev,
        "text": item.text,
        "kind": item.kind,
        "method": item.method,
        "source": item.source,
        "plan": item.plan,
        "parents": list(item.parents),
        "level": item.level,
        "stage": item.stage,
        "over": {key: list(values) for key, values in item.over.items()},
        "fingerprint": item.fingerprint,
        "withdrawn": item.withdrawn,
        "records": None if item.records is None else asdict(item.records),
    }


def _limit(limit: Limit) -> dict[str, Any]:
    return {
        "parameter": limit.parameter,
        "of": list(limit.of),
        "unit": limit.unit,
        "min": limit.minimum,
        "max": limit.maximum,
        "equals": limit.equals,
        "decision": limit.decision,
        "min_tur": limit.min_tur,
    }


def _freeze(path: Path, value: Mapping[str, Any]) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    data = canonical(value)
    write_whole(path, data)
    return hashlib.sha256(data).hexdigest()


def _frozen(path: Path, key: str) -> Entries:
    if not path.exists():
        return {}
    value = read_json(path)
    entries = value.get(key) if isinstance(value, dict) else None
    if not isinstance(entries, dict) or not all(isinstance(entry, dict) for entry in entries.values()):
        raise EvidenceError(f"{path}: {key} are missing", "see hil verify")
    return entries
