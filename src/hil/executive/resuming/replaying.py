"""Replay: a package is unpacked as a workspace, and its cases must reach the same verdicts."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from hil.evidence import events
from hil.evidence.folder import REGISTERS
from hil.evidence.package.contents import Package
from hil.executive.setup.configuration import Request
from hil.executive.setup.head import DESELECTED, ENDED_BEFORE
from hil.model.errors import ConfigurationError, Diverged, EvidenceError, Finding
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.registers.instruments import INSTRUMENTS

__all__ = ["STOPPED", "Differences", "as_packed", "differences", "replay_request", "unpack"]

STOPPED = frozenset({Verdict.ABORTED, Verdict.NOT_RUN})
"""The verdicts of cases that did not end by themselves."""

_LAYOUT = ("testplans", "fixtures")

_MINUS_ZERO = re.compile(r"(?<!\S)-0(?!\S)")
"""How earlier versions wrote a current of zero from below."""

_NUMBERS = ("value", "uncertainty")
"""Fields of a check that a later version may compute more exactly without changing the verdict."""

_OF_BENCH = (events.Gate, events.Trip, events.Rest, events.Safe, events.SafeEnd)


def unpack(package: Package, root: Path) -> None:
    """Unpack the frozen catalogue, sources and bench as the workspace that they came from.

    Raises:
        EvidenceError: if the package does not say what was run or where the files were, or names places outside a
            workspace.
    """
    run = package.state.run
    if run is None or run.overrides is None or run.skips is None:
        raise EvidenceError(f"{package.name}: its journal does not say what was run", "see hil verify")
    layout = _layout(package)
    testplans, fixtures = (_within(root, layout[name], package) for name in _LAYOUT)
    bench = _within(fixtures / "benches", run.bench, package)
    data = package.folder / "data"
    shutil.copytree(data / "sources", root, dirs_exist_ok=True)
    for plan in (path for path in (data / "catalogue").iterdir() if path.is_dir()):
        shutil.copytree(plan, testplans / plan.name, dirs_exist_ok=True)
    shutil.copytree(data / "bench", bench, dirs_exist_ok=True)
    shutil.copy(data / "bench/duts.yaml", fixtures / "duts.yaml")
    if (registers := package.folder / REGISTERS).is_dir():
        shutil.copytree(registers, fixtures, dirs_exist_ok=True)
    lines = (f"{name} = {json.dumps(layout[name], ensure_ascii=False)}\n" for name in _LAYOUT)
    (root / "hil.toml").write_text("".join(lines), encoding="utf-8")


def as_packed(package: Package, error: ConfigurationError) -> ConfigurationError:
    """Return an error in a replay's files with their paths in the package."""
    run, layout = package.state.run, _layout(package)
    testplans, fixtures = (PurePosixPath(layout[name]) for name in _LAYOUT)
    bench = fixtures / "benches" / (run.bench if run else "")
    data = package.folder / "data"
    places = (
        (bench, "bench"),
        (fixtures / "duts.yaml", "bench/duts.yaml"),
        (fixtures / INSTRUMENTS, f"registers/{INSTRUMENTS}"),
        (testplans, "catalogue"),
    )

    def packed(finding: Finding) -> Finding:
        path = PurePosixPath(finding.path)
        for place, inside in places:
            if path.is_relative_to(place) and (data / inside / path.relative_to(place)).exists():
                found = PurePosixPath("data", inside, path.relative_to(place))
                return replace(finding, path=str(found))
        return replace(finding, path=f"data/sources/{path}")

    return ConfigurationError(tuple(map(packed, error.findings)))


def _layout(package: Package) -> Mapping[str, str]:
    place = package.json("data/place.json")
    layout = place.get("workspace") if isinstance(place, dict) else None
    if not isinstance(layout, dict) or not all(isinstance(layout.get(name), str) for name in _LAYOUT):
        raise EvidenceError(f"{package.name}: its place.json does not give the workspace's layout", "see hil verify")
    return layout


def _within(folder: Path, name: str, package: Package) -> Path:
    """Return a path below a folder: nothing of a package is written anywhere else."""
    path = (folder / name).resolve()
    if not path.is_relative_to(folder):
        raise EvidenceError(f"{package.name}: {name!r} is outside of the workspace of its replay", "see hil verify")
    return path


def replay_request(package: Package, root: Path, output: Path) -> Request:
    """Return the request of the recorded run, for its replay."""
    run = package.state.run
    if run is None:
        raise EvidenceError(f"{package.name}: its journal does not say what was run", "see hil verify")
    return Request(
        start=root,
        plans=run.plans,
        bench=run.bench,
        dut=run.dut.serial,
        source=Source.REPLAYED,
        purpose=run.purpose,
        operator=run.operator,
        skips={**(run.skips or {}), **_left_out(package)},
        only=run.only,
        overrides=dict(run.overrides or {}),
        output=output,
    )


def _left_out(package: Package) -> dict[str, str]:
    """Return the cases that plain pytest was not asked for, or did not reach, with the reason."""
    left_out = (each for each in package.of(events.NotRun) if each.reason in {DESELECTED, ENDED_BEFORE})
    return {each.case: each.reason for each in left_out}


class Differences(NamedTuple):
    """Differences of a replay.

    Attributes:
        sentences: one for each difference.
        following: how many more follow after a case left the record.
        of_numbers: how many of the sentences are about a value or uncertainty only; all verdicts may be the same.
    """

    sentences: tuple[str, ...]
    following: int
    of_numbers: int


class _Difference(NamedTuple):
    sentence: str
    cause: bool = False
    number: bool = False


def differences(recorded: Package, replayed: Package) -> Differences:
    """Return a sentence for every verdict, value and recording that differs, and how many more follow.

    If a case left the record, that is the last sentence: nothing after it finds the bytes that it needs, so further
    differences are only counted. Neither a person's stop nor the end of a process is replayed: for a run that was
    cut short, only the cases that had ended before count.
    """
    found = tuple(_differences(recorded, replayed))
    shown = next((place for place, each in enumerate(found, 1) if each.cause), len(found))
    return Differences(
        sentences=tuple(each.sentence for each in found[:shown]),
        following=len(found) - shown,
        of_numbers=sum(each.number for each in found[:shown]),
    )


def _differences(recorded: Package, replayed: Package) -> Iterator[_Difference]:
    """Yield every difference, with whether others follow from it."""
    outcome, cut_short = recorded.outcome(), recorded.cut_short
    before, after = ({case.case: case for case in found.cases} for found in (outcome, replayed.outcome()))
    for case, was in before.items():
        if cut_short and was.verdict in STOPPED:
            continue
        now = after.get(case)
        if now is None:
            yield _Difference(f"{case}: {was.verdict} in the record, not replayed")
            continue
        for reason in now.reasons:
            if reason.startswith(f"{Diverged.__name__}:"):
                yield _Difference(f"{case}: {reason}", cause=True)
        if now.verdict is not was.verdict:
            why = "; ".join(now.reasons)
            yield _Difference(f"{case}: {was.verdict} in the record, {now.verdict} replayed: {why}")
        yield from _check_differences(case, was.checks, now.checks)
    if not cut_short:
        yield from map(_Difference, _bench_differences(recorded, replayed))
        yield from map(_Difference, _row_differences(recorded, replayed))


def _check_differences(
    case: str, before: Sequence[events.Check], after: Sequence[events.Check]
) -> Iterator[_Difference]:
    if len(before) != len(after):
        yield _Difference(f"{case}: {len(before)} checks in the record, {len(after)} replayed")
    for was, now in zip(before, after, strict=False):
        for field in ("requirement", "parameter", "of", "verdict", *_NUMBERS):
            found, again = getattr(was, field), getattr(now, field)
            if found != again:
                said = f"{field} of {was.requirement} {was.parameter} was {found} in the record, {again} replayed"
                yield _Difference(f"{case}: {said}", number=field in _NUMBERS and _are_numbers(found, again))


def _are_numbers(*values: object) -> bool:
    return all(value is None or isinstance(value, float | int) for value in values)


def _row_differences(recorded: Package, replayed: Package) -> Iterator[str]:
    before, after = (
        {name: ended.sha256 for name, ended in package.state.ended.items()} for package in (recorded, replayed)
    )
    for name in sorted(before.keys() | after.keys()):
        if before.get(name) != after.get(name):
            there = "other rows than in the record" if name in before and name in after else "only in one of them"
            yield f"recording {name}: {there}"


def _bench_differences(recorded: Package, replayed: Package) -> Iterator[str]:
    """Yield the first thing that the bench did differently between cases, if any.

    A gate that the record lacks is new in this version: what it checks is not in the record.
    """
    before, after = (
        [event for event in package.events if type(event) in _OF_BENCH] for package in (recorded, replayed)
    )
    gates = {event.name for event in before if isinstance(event, events.Gate)}
    after = [event for event in after if not isinstance(event, events.Gate) or event.name in gates]
    for was, now in zip_longest(before, after):
        if was is None or now is None or _essence(was) != _essence(now):
            yield f"the bench: {_described(was)} in the record, {_described(now)} replayed"
            return


def _described(event: events.Event | None) -> str:
    if event is None:
        return "nothing"
    words = (getattr(event, field, None) for field in ("name", "limit", "output", "ok", "detail", "text"))
    return " ".join(str(word) for word in (event.kind(), *words) if word is not None)


def _essence(event: events.Event) -> tuple[object, ...]:
    """Return what happened to what, and every number read; the wording depends on the version."""
    words = f"{getattr(event, 'detail', '')} {getattr(event, 'text', '')}".split()
    numbers = tuple(_MINUS_ZERO.sub("0", word.strip(",;:.()")) for word in words if any(map(str.isdigit, word)))
    return (event.kind(), *(getattr(event, field, None) for field in ("name", "limit", "output", "ok")), numbers)
