"""Replay: a package becomes a workspace again, and its cases must come to the same verdicts."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from hil.evidence import events
from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request
from hil.executive.setup.head import DESELECTED, ENDED_BEFORE
from hil.model.errors import Diverged, EvidenceError
from hil.model.identity import Purpose, Source
from hil.model.verdict import Verdict

__all__ = ["STOPPED", "differences", "replay_request", "unpack"]

STOPPED = frozenset({Verdict.ABORTED, Verdict.NOT_RUN})
"""The verdicts of cases that did not come to an end of their own."""

_LAYOUT = ("testplans", "fixtures")
_OF_REQUEST = frozenset({"bench", "dut", "operator", "overrides", "plans", "purpose", "skips"})

_MINUS_ZERO = re.compile(r"(?<!\S)-0(?!\S)")
"""What earlier versions said of a current that is zero from below."""

_OF_BENCH = ("gate", "trip", "rest", "safe", "safe-end")


def unpack(package: Package, root: Path) -> None:
    """Lay the frozen catalogue, sources and bench out as the workspace that they came from.

    Raises:
        EvidenceError: if the package does not say what was run and where they were, or names places outside of a
            workspace.
    """
    if not package.run().keys() >= _OF_REQUEST:
        raise EvidenceError(f"{package.name}: its journal does not tell what was run", "see hil verify")
    layout = _layout(package)
    testplans, fixtures = (_within(root, layout[name], package) for name in _LAYOUT)
    bench = _within(fixtures / "benches", str(package.run()["bench"]), package)
    data = package.folder / "data"
    shutil.copytree(data / "sources", root, dirs_exist_ok=True)
    for plan in (path for path in (data / "catalogue").iterdir() if path.is_dir()):
        shutil.copytree(plan, testplans / plan.name, dirs_exist_ok=True)
    shutil.copytree(data / "bench", bench, dirs_exist_ok=True)
    shutil.copy(data / "bench/duts.yaml", fixtures / "duts.yaml")
    lines = (f"{name} = {json.dumps(layout[name], ensure_ascii=False)}\n" for name in _LAYOUT)
    (root / "hil.toml").write_text("".join(lines), encoding="utf-8")


def _layout(package: Package) -> Mapping[str, str]:
    place = package.json("data/place.json")
    layout = place.get("workspace") if isinstance(place, dict) else None
    if not isinstance(layout, dict) or not all(isinstance(layout.get(name), str) for name in _LAYOUT):
        raise EvidenceError(f"{package.name}: its place.json does not tell the workspace's layout", "see hil verify")
    return layout


def _within(folder: Path, name: str, package: Package) -> Path:
    """Return a place below a folder: nothing of a package is written anywhere else."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder):
        raise EvidenceError(f"{package.name}: {name!r} is outside of the workspace of its replay", "see hil verify")
    return path


def replay_request(package: Package, root: Path, output: Path) -> Request:
    """Return the request of the recorded run, for its replay."""
    run = package.run()
    return Request(
        start=root,
        plans=tuple(run["plans"]),
        bench=str(run["bench"]),
        dut=str(run["dut"]["serial"]),
        source=Source.REPLAYED,
        purpose=Purpose(run["purpose"]),
        operator=str(run["operator"]),
        skips={**run["skips"], **_left_out(package)},
        overrides=dict(run["overrides"]),
        output=output,
    )


def _left_out(package: Package) -> dict[str, str]:
    """Return the cases that plain pytest was not asked for, or did not come to, with why."""
    left_out = (each for each in package.of(events.NotRun) if each.reason in {DESELECTED, ENDED_BEFORE})
    return {each.case: each.reason for each in left_out}


def differences(recorded: Package, replayed: Package) -> tuple[tuple[str, ...], int]:
    """Return a sentence for every verdict, value and recording that came out otherwise, and how many more follow.

    Where a case left the record, that is the last sentence: nothing behind it finds the bytes that it needs, so that
    what else came out otherwise is counted only. A person's stop is not replayed: of an interrupted run the cases
    count that had ended before.
    """
    found = tuple(_differences(recorded, replayed))
    for place, (_, cause) in enumerate(found, 1):
        if cause:
            return tuple(sentence for sentence, _ in found[:place]), len(found) - place
    return tuple(sentence for sentence, _ in found), 0


def _differences(recorded: Package, replayed: Package) -> Iterator[tuple[str, bool]]:
    """Yield sentences, each with whether it is why others follow."""
    before, after = (_by_case(package.results()["cases"]) for package in (recorded, replayed))
    interrupted = recorded.results()["interrupted"]
    for case, was in before.items():
        if interrupted and was["verdict"] in STOPPED:
            continue
        now = after.get(case)
        if now is None:
            yield f"{case}: {was['verdict']} in the record, not replayed", False
            continue
        for reason in now["reasons"]:
            if reason.startswith(f"{Diverged.__name__}:"):
                yield f"{case}: {reason}", True
        if now["verdict"] != was["verdict"]:
            why = "; ".join(now["reasons"])
            yield f"{case}: {was['verdict']} in the record, {now['verdict']} replayed: {why}", False
        yield from ((sentence, False) for sentence in _check_differences(case, was["checks"], now["checks"]))
    if not interrupted:
        yield from ((sentence, False) for sentence in _bench_differences(recorded, replayed))
        yield from ((sentence, False) for sentence in _row_differences(recorded, replayed))


def _by_case(cases: Sequence[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    return {case["case"]: case for case in cases}


def _check_differences(
    case: str, before: Sequence[Mapping[str, Any]], after: Sequence[Mapping[str, Any]]
) -> Iterator[str]:
    if len(before) != len(after):
        yield f"{case}: {len(before)} checks in the record, {len(after)} replayed"
    for was, now in zip(before, after, strict=False):
        for field in ("requirement", "parameter", "of", "verdict", "value", "uncertainty"):
            if was[field] != now[field]:
                name = f"{was['requirement']} {was['parameter']}"
                yield f"{case}: {field} of {name} was {was[field]} in the record, {now[field]} replayed"


def _row_differences(recorded: Package, replayed: Package) -> Iterator[str]:
    before, after = (
        {event["recording"]: event["sha256"] for event in package.events("recording-end")}
        for package in (recorded, replayed)
    )
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            there = "other rows than in the record" if name in before and name in after else "only in one of them"
            yield f"recording {name}: {there}"


def _bench_differences(recorded: Package, replayed: Package) -> Iterator[str]:
    """Yield the first thing that the bench did otherwise between cases, if any."""
    before, after = ([_told(event) for event in package.events(*_OF_BENCH)] for package in (recorded, replayed))
    for was, now in zip_longest(before, after, fillvalue="nothing"):
        if was != now:
            yield f"the bench: {was} in the record, {now} replayed"
            return


def _told(event: Mapping[str, Any]) -> str:
    words = (event.get(field) for field in ("kind", "name", "limit", "output", "ok", "detail", "text"))
    return _MINUS_ZERO.sub("0", " ".join(str(word) for word in words if word is not None))
