"""`hil verify`: verify a package offline."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click

from hil.cli.run_names import find_run, fixtures_folder
from hil.model.errors import HilError

if TYPE_CHECKING:
    from hil.evidence.package.verification import Verification

__all__ = ["command", "damage_of_transcript"]

_REFUSED = 4


@click.command(name="verify", epilog="Example: hil verify latest")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True)
@click.option("--report", is_flag=True, help="Also regenerate the report, and compare it.")
@click.option("--replay", "again", is_flag=True, help="Also rerun the cases on the recorded bytes, as hil replay does.")
def command(runs: tuple[str, ...], report: bool, again: bool) -> int:
    """Verify packages, offline and from their own bytes.

    It checks the manifests, the journal's chain, every file against its hash in the journal, every row of every
    recording, the results, and every verdict against value, uncertainty and frozen limit. Then it compares the package
    with the ledger of its folder, and verifies signatures and approvals. Digests are printed only if nothing is wrong.
    Several runs get one line each.

    Exit code 0 for intact packages of complete runs whose signatures all count, and whose report and replay, if
    requested, are identical; 1 otherwise; for several runs, the worst.
    """
    folders = [find_run(run) for run in runs]
    if len(folders) == 1:
        return _tell(folders[0], report=report, again=again)
    return max([_tell_in_short(folder, report=report, again=again) for folder in folders])


def _tell_in_short(folder: Path, *, report: bool, again: bool) -> int:
    """Print a package's verification in one line, any problems below it, and return the exit code."""
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - heavy

    try:
        line, wrong = _in_short(folder, report=report, again=again)
    except HilError as error:
        click.echo(f"{shown(folder.name)}  not verified\n  {shown(error.message)}")
        return _REFUSED
    click.echo(shown(line))
    for each in wrong:
        click.echo(f"  {shown(each)}")
    return 1 if wrong else 0


def _in_short(folder: Path, *, report: bool, again: bool) -> tuple[str, list[str]]:
    """Return a package's state and verdict in one line, and everything that is wrong with it."""
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy

    found = verify(folder)
    wrong = [found.problem] if found.problem else []
    if found.state is State.SEALED:
        wrong += _said(found)[1]
        wrong += [] if found.complete else ["the run is incomplete"]
        wrong += [] if found.sure else [f"ledger: {found.ledger}"]
        wrong += [] if not report or _compared(found) else ["its report DIFFERS"]
        wrong += [] if not again or (replayed := _replayed(found)).same else [f"replay: {replayed.word}"]
    worth = f"  {_worth(found)}" if found.state is State.SEALED else ""
    return f"{folder.name}  {found.state}{worth}", wrong


def _tell(folder: Path, *, report: bool, again: bool) -> int:
    """Print the full verification of a package, and return the exit code."""
    from hil.evidence.folder import TRANSCRIPT  # noqa: PLC0415 - heavy
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy
    from hil.report.tables import labelled  # noqa: PLC0415 - heavy

    found = verify(folder)
    for finding in found.findings:
        click.echo(shown(str(finding)), err=True)
    short = found.state in {State.SEALED, State.INTERRUPTED, State.SAFED} and not found.complete
    complete = ", the run is incomplete" if short else ""
    click.echo(f"{shown(found.folder.name)}: {found.state}{complete}")
    if found.state is not State.SEALED:
        if any(each.path == TRANSCRIPT for each in found.findings) and (folder / TRANSCRIPT).is_file():
            for line in damage_of_transcript(folder):
                click.echo(line, err=True)
        if again:
            click.echo("not replayed: only what a sealed package holds can be compared with it", err=True)
        return 1
    same = _compared(found) if report else True
    word = "not compared; add --report to compare it" if not report else "identical" if same else "DIFFERS"
    renamed = found.run != shown(found.folder.resolve().name)
    facts = (
        ("run", f"{found.run}, in a folder of another name" if renamed else ""),
        ("verdict", _worth(found)),
        *(("EXCEPTION", shown(each)) for each in found.exceptions),
        ("report", word),
        ("replay", (replayed := _replayed(found) if again else _Replayed()).word),
        ("ledger", found.ledger or "none in this folder"),
        ("evidence digest", found.evidence_digest),
        ("content digest", found.content_digest),
    )
    said, problems = _said(found)
    for line in labelled((*facts, *said)):
        click.echo(line)
    for problem in problems:
        click.echo(shown(problem), err=True)
    return 0 if found.ok and same and replayed.same and not problems else 1


class _Replayed(NamedTuple):
    """The outcome of a replay: in words, and whether everything was the same."""

    word: str = "not done; add --replay to run the cases again"
    same: bool = True


def _replayed(found: Verification) -> _Replayed:
    """Replay the package in a separate process with the pinned environment; differences are printed at once."""
    from hil.executive.setup.pins import pinned_environment  # noqa: PLC0415 - only where it is asked for

    done = subprocess.run(  # noqa: S603 - ourselves
        [sys.executable, "-P", "-m", "hil.cli", "replay", str(found.folder.resolve())],
        env=pinned_environment(),
        capture_output=True,
        encoding="utf-8",
        errors="backslashreplace",
        check=False,
    )
    if done.stderr:
        click.echo(done.stderr, err=True, nl=False)
    return _Replayed("; ".join(done.stdout.splitlines()) or "not possible", same=done.returncode == 0)


_MOST_LINES = 20


def damage_of_transcript(folder: Path) -> Iterator[str]:
    """Give the damaged lines of a run's transcript, as far as they tell by themselves, or that it is missing."""
    from hil.evidence.folder import TRANSCRIPT  # noqa: PLC0415 - heavy
    from hil.evidence.package.listing import list_folder, shown  # noqa: PLC0415 - heavy
    from hil.wire.transcript import damaged_lines  # noqa: PLC0415 - heavy

    path = folder / TRANSCRIPT
    if list_folder(folder).odd:  # a link may lead anywhere
        return
    if not path.is_file():
        yield f"{TRANSCRIPT}: it is missing"
        return
    if not path.stat().st_size:  # the process was killed before its first lines were written
        return
    for number, message in islice(damaged_lines(path), _MOST_LINES):
        yield shown(f"{TRANSCRIPT}:{number}:1: {message}")


def _said(found: Verification) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the signatures and approvals of a package that count, and a sentence for everything that does not."""
    from hil.evidence.ledger.approvals import Subject, said_of, stray_files  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.book import read  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.entries import Approved, Signed  # noqa: PLC0415 - heavy
    from hil.registers.signers import load_signers  # noqa: PLC0415 - heavy

    ledger = read(found.folder.resolve().parent)
    problems = list(stray_files(ledger, found.run))
    if not ledger.of(Signed, found.run) and not ledger.of(Approved, found.run):
        return [("signed", "no")], problems
    subject = Subject(run=found.run, evidence=found.evidence_digest, operator=found.operator)
    said = said_of(ledger, subject, load_signers(fixtures_folder()))
    problems += [f"does not count: {each.kind} {each}: {each.problem}" for each in said if each.problem]
    return [(each.kind, str(each)) for each in said if not each.problem], problems


def _worth(found: Verification) -> str:
    """Return the verdict with its obvious qualifications."""
    source = "" if found.source == "hardware" else f", {found.source.upper() or 'SOURCE NOT RECORDED'}"
    return f"{found.verdict}{source}{', deviates' if found.deviates else ''}"


def _compared(found: Verification) -> bool:
    from hil.cli.commands.report import derived  # noqa: PLC0415 - heavy

    whole = True
    for name, (_, word, same) in derived(found.folder, found).items():
        if not same:
            click.echo(f"{name}: {word}", err=True)
            whole = False
    return whole
