"""`hil verify`: verify a package offline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run, fixtures_folder

if TYPE_CHECKING:
    from hil.evidence.package.verification import Verification

__all__ = ["command"]


@click.command(name="verify", epilog="Example: hil verify latest")
@click.argument("run", metavar="RUN")
@click.option("--report", is_flag=True, help="Also derive the report again and compare it.")
def command(run: str, report: bool) -> int:
    """Verify a package, offline and from its own bytes.

    It checks the manifests, the journal's chain, every file against its hash in the journal, every row of every
    recording, the results, and every verdict against value, uncertainty and frozen limit. Then it compares the package
    with the ledger of its folder, and verifies signatures and approvals. Digests are printed only if nothing is wrong.
    Exit code 0 for an intact package of a complete run whose signatures all count, 1 otherwise.
    """
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State, verify  # noqa: PLC0415 - heavy
    from hil.report.tables import labelled  # noqa: PLC0415 - heavy

    found = verify(find_run(run))
    for finding in found.findings:
        click.echo(shown(str(finding)), err=True)
    short = found.state in {State.SEALED, State.INTERRUPTED, State.SAFED} and not found.complete
    complete = ", the run is incomplete" if short else ""
    click.echo(f"{shown(found.folder.name)}: {found.state}{complete}")
    if found.state is not State.SEALED:
        return 1
    same = _compared(found) if report else True
    word = "not compared; add --report to compare it" if not report else "identical" if same else "DIFFERS"
    renamed = found.run != shown(found.folder.resolve().name)
    facts = (
        ("run", f"{found.run}, in a folder of another name" if renamed else ""),
        ("verdict", _worth(found)),
        ("report", word),
        ("ledger", found.ledger or "none in this folder"),
        ("evidence digest", found.evidence_digest),
        ("content digest", found.content_digest),
    )
    said, problems = _said(found)
    for line in labelled((*facts, *said)):
        click.echo(line)
    for problem in problems:
        click.echo(shown(problem), err=True)
    return 0 if found.ok and same and not problems else 1


def _said(found: Verification) -> tuple[list[tuple[str, str]], list[str]]:
    """Return the signatures and approvals of a package that count, and a sentence for everything that does not."""
    from hil.evidence.ledger.approvals import Subject, said_of, stray_files  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.book import read  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.entries import Approved, Signed  # noqa: PLC0415 - heavy
    from hil.registers.signers import load_signers  # noqa: PLC0415 - heavy

    ledger = read(found.folder.resolve().parent)
    problems = list(stray_files(ledger, found.run))
    if not ledger.of(Signed, found.run) and not ledger.of(Approved, found.run):
        return [("signed", "by nobody")], problems
    subject = Subject(run=found.run, evidence=found.evidence_digest, operator=found.operator)
    said = said_of(ledger, subject, load_signers(fixtures_folder()))
    problems += [f"does not count: {each.kind} {each}: {each.problem}" for each in said if each.problem]
    return [(each.kind, str(each)) for each in said if not each.problem], problems


def _worth(found: Verification) -> str:
    """Return the verdict with what speaks against it at first sight."""
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
