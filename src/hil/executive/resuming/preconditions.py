"""Preconditions of a resumption: the run is made of the same as before, or it is not resumed."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from hil.documents.canonical import JsonError, parse_strict
from hil.evidence import events
from hil.evidence.durable import read_plain, sha256_of
from hil.evidence.folder import REGISTERS
from hil.evidence.package.consistent import frozen_files
from hil.evidence.package.listing import shown
from hil.executive.people.answers import SIMULATED_PERSON
from hil.executive.resuming.earlier import Earlier
from hil.executive.setup.configuration import Configuration, Request
from hil.executive.setup.head import PlannedCase, freeze
from hil.executive.setup.software import software_identity
from hil.model.errors import EvidenceError, Refused
from hil.registers.instruments import INSTRUMENTS

__all__ = ["changes", "deviation_of", "require_answers", "require_frozen", "require_same_cases", "resumed_request"]

_REGISTERS = frozenset({"data/bench/duts.yaml", f"{REGISTERS}/{INSTRUMENTS}"})
"""All units and instruments of the workspace; those of the run have files of their own."""

_PARTS = {
    "data/dut.json": "the device under test",
    "data/bench/": "the bench",
    f"{REGISTERS}/": "certificates",
    "data/catalogue/": "requirements or parameters",
    "data/packages/": "drivers of other packages",
    "data/sources/": "plans or fixtures",
}
_MOST_FILES = 3
_DIGITS = 12
_SOFTWARE = ("hil", "python", "packages", "numeric", "byte_order")
"""The software that affects numerical results."""


def resumed_request(
    earlier: Earlier,
    start: Path,
    *,
    answers: Path | None = None,
    person: bool = False,
    served: Path | None = None,
    acknowledge_within_s: float = 600.0,
) -> Request:
    """Return the request with which the run began.

    Args:
        earlier: the interrupted run.
        start: the folder from which the workspace is searched for.
        answers: a file with answers to further questions.
        person: whether a person at the terminal answers.
        served: the folder in which its bench is served, None if it is not.
        acknowledge_within_s: timeout for the person on call of an unattended run to answer [s].

    Raises:
        Refused: if its bench was served and no folder is named, or vice versa.
    """
    run = earlier.run
    was_served = run.live is not None and run.live.served
    if was_served and served is None:
        raise Refused(
            f"{earlier.folder.name}: its bench was served by another process", "name its folder with --served"
        )
    if served is not None and not was_served:
        raise Refused(f"{earlier.folder.name}: its bench was not served", "leave --served out")
    return Request(
        start=start,
        plans=run.plans,
        bench=run.bench,
        dut=run.dut.serial,
        source=run.source,
        purpose=run.purpose,
        operator=run.operator,
        skips=dict(run.skips or {}),
        only=run.only,
        overrides=dict(run.overrides or {}),
        answers=answers,
        person=person,
        output=earlier.folder.parent,
        served=served,
        epoch=(run.epoch or "") if earlier.live else "",
        unattended=run.unattended,
        on_call=run.on_call or "",
        acknowledge_within_s=acknowledge_within_s,
    )


def changes(earlier: Earlier, configuration: Configuration) -> tuple[str, ...]:
    """Return what has changed since the run began, a sentence for each part, with the files."""
    then = {**earlier.of_head(events.Frozen).files, **earlier.frozen_later}
    configuration.inputs.use_again(then)
    with tempfile.TemporaryDirectory(prefix="hil-resume-") as folder:
        now = freeze(configuration, Path(folder)).files
    differing = sorted(path for path in {*then, *now} - _REGISTERS if then.get(path) != now.get(path))
    return tuple(_sentences(differing))


def require_frozen(earlier: Earlier) -> None:
    """Require the files of the beginning as they were: no bench time is spent on a package that cannot verify.

    Raises:
        EvidenceError: with the first that differs, or cannot be read.
    """
    for path, digest in frozen_files(earlier.head).items():
        try:
            there = sha256_of(earlier.folder / path)
        except OSError as error:
            what = f"cannot be read: {error.strerror or error}"
        else:
            what = "" if there == digest else "it is not what was frozen before the first step"
        if what:
            raise EvidenceError(
                f"{earlier.folder.name}: cannot resume: {shown(path)}: {what}",
                "put it back from a copy of the folder, and resume again",
            )


def deviation_of(earlier: Earlier, configuration: Configuration, reason: str) -> str:
    """Return how the software deviates from that at the run's beginning, empty if it does not.

    Args:
        earlier: the interrupted run.
        configuration: what it is made of.
        reason: why it is resumed in spite of that, empty if not given.

    Raises:
        Refused: if it deviates and there is no reason.
    """
    then, now = _software(earlier.folder), software_identity(configuration.workspace.root)
    differing = [name for name in _SOFTWARE if then.get(name) != now.get(name)]
    differences = ", ".join(text for name in differing if (text := _versions(name, then.get(name), now.get(name))))
    if not differences:
        return ""
    if not reason:
        raise Refused(
            f"{earlier.folder.name}: the software differs from the one that started it: {differences}",
            "install that again, or give a reason with --other-software; the run then deviates and closes nothing",
        )
    return f"resumed with other software ({differences}): {reason}"


def require_answers(earlier: Earlier, request: Request) -> None:
    """Require that somebody answers further questions, unless the simulated person has answered so far.

    In an unattended run they wait for an answer from any terminal.

    Raises:
        Refused: with who has answered so far.
    """
    answers = (line.event for line in earlier.lines if isinstance(line.event, events.Answer))
    others = sorted({answer.by for answer in answers} - {SIMULATED_PERSON})
    if others and request.answers is None and not request.person and not request.unattended:
        raise Refused(
            f"{earlier.folder.name}: questions were answered by {', '.join(others)} so far",
            "give --answers FILE, or --ask to answer at the terminal",
        )


def require_same_cases(earlier: Earlier, planned: Sequence[PlannedCase]) -> None:
    """Require that the same cases were collected.

    Raises:
        Refused: with those that are missing or new.
    """
    then = [case.case for case in earlier.of_head(events.Planned).cases]
    now = [case.id for case in planned]
    if then != now:
        differing = sorted(set(then) ^ set(now)) or ["their order"]
        raise Refused(
            f"{earlier.folder.name}: the cases differ from before: {', '.join(differing)}", "seal it as it is"
        )


def _sentences(paths: Sequence[str]) -> Iterator[str]:
    for part, name in _PARTS.items():
        files = [path.removeprefix("data/") for path in paths if path.startswith(part)]
        if files:
            yield f"{name} ({', '.join(files)})"
    if others := [path for path in paths if not path.startswith(tuple(_PARTS))]:
        yield f"other files ({', '.join(others)})"


def _software(folder: Path) -> Mapping[str, object]:
    path = folder / "data/software.json"
    try:
        found = parse_strict(read_plain(path))
    except (OSError, JsonError) as error:
        raise EvidenceError(f"{path}: cannot be read: {error}", "seal the run as it is with hil seal") from error
    return found if isinstance(found, dict) else {}


def _versions(name: str, then: object, now: object) -> str:
    if isinstance(then, dict) and isinstance(now, dict):
        keys = [key for key in sorted({*then, *now}) if then.get(key) != now.get(key)]
        differences = (_version(f"{name} {key}", then.get(key, "none"), now.get(key, "none")) for key in keys)
        return ", ".join(text for text in differences if text)
    return f"{name} {then} is {now}"


def _version(name: str, then: object, now: object) -> str:
    """Return in words what differs, empty if it only looks different; of a commit, which, and the changed files."""
    if not isinstance(then, dict) or not isinstance(now, dict):
        return f"{name} {then} is {now}"
    differences = [] if then.get("id") == now.get("id") else [f"{name} {_short(then)} is {_short(now)}"]
    before, after = then.get("files", {}), now.get("files", {})
    if files := sorted(path for path in {*before, *after} if before.get(path) != after.get(path)):
        more = f" and {len(files) - _MOST_FILES} more" if len(files) > _MOST_FILES else ""
        differences.append(f"its source differs in {', '.join(files[:_MOST_FILES])}{more}")
    elif bool(then.get("changed")) != bool(now.get("changed")):  # a run from before files were named
        differences.append(f"its source was {'changed' if then.get('changed') else 'not changed'} then")
    return ", ".join(differences)


def _short(commit: Mapping[str, object]) -> str:
    return str(commit.get("id") or "none")[:_DIGITS]
