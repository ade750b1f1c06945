"""`hil ledger`: check the ledger of the packages, and print its head."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import reports_folder
from hil.model.errors import Refused

if TYPE_CHECKING:
    from hil.evidence.ledger.book import Ledger
    from hil.evidence.ledger.entries import Entry

__all__ = ["command", "require_head"]

_TOLD = (
    "run",
    "requirement",
    "subject",
    "role",
    "principal",
    "verdict",
    "status",
    "state",
    "same",
    "evidence",
    "analysis",
    "sha256",
)
_SAME = {True: "same verdicts", False: "other verdicts"}
_SHORT = 12


@click.command(name="ledger", epilog="Example: hil ledger --head 5d41402abc4b2a76b9719d911017c592…")
@click.argument("reports", required=False, type=click.Path(path_type=Path, file_okay=False, exists=True))
@click.option("--head", metavar="SHA256", help="A head published earlier; the ledger must still contain it.")
@click.option("--log", is_flag=True, help="Also list every entry.")
def command(reports: Path | None, head: str | None, log: bool) -> int:
    """Check the package ledger, and print its head.

    It checks every line, the chain, and the objects and signatures that lines name; with --head also that nothing
    up to a published head was cut off or rewritten. The last line of standard output is the head: publish it, for
    example in a git tag or an email. REPORTS is the folder of reports, by default that of the workspace. Exit code 1
    if something is wrong.
    """
    from hil.evidence.ledger.approvals import stray_files  # noqa: PLC0415 - heavy
    from hil.evidence.ledger.book import check, read  # noqa: PLC0415 - heavy
    from hil.evidence.package.listing import shown  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned, labelled  # noqa: PLC0415 - heavy

    if head is not None:
        require_head(head)
    place = reports or reports_folder()
    ledger = read(place)
    wrong = [str(each) for each in check(place, head)]
    wrong += [text for run in sorted({*_signed(ledger)}) for text in stray_files(ledger, run)]
    for text in wrong:
        click.echo(shown(text), err=True)
    if log:
        for line in aligned([(str(each.seq + 1), each.utc, each.kind(), _facts(each)) for each in ledger.entries]):
            click.echo(shown(line))
    for line in labelled(_counted(ledger, head, bool(wrong))):
        click.echo(line)
    click.echo(ledger.head)
    return 1 if wrong else 0


def require_head(head: str) -> None:
    """Require that a text can be the head of a ledger.

    Raises:
        Refused: if it is not a SHA-256.
    """
    if not re.fullmatch("[0-9a-f]{64}", head):
        raise Refused(f"--head {head}: not a head", "a head is a SHA-256: 64 digits of 0-9 and a-f")


def _signed(ledger: Ledger) -> Iterator[str]:
    from hil.evidence.ledger.entries import Approved, Signed  # noqa: PLC0415 - heavy

    return (each.run for each in ledger.entries if isinstance(each, Approved | Signed))


def _facts(entry: Entry) -> str:
    found = (getattr(entry, name, "") for name in _TOLD)
    told = (_SAME[each] if isinstance(each, bool) else str(each) for each in found)
    return "  ".join(text[:_SHORT] if re.fullmatch("[0-9a-f]{64}", text) else text for text in told if text)


def _counted(ledger: Ledger, head: str | None, wrong: bool) -> tuple[tuple[str, str], ...]:
    from hil.evidence.ledger.entries import Approved, Sealed, Signed  # noqa: PLC0415 - heavy

    sealed = ledger.of(Sealed)
    gone = sorted({each.run for each in sealed if not (ledger.reports / each.run).exists()})
    contained = f"contained, line {ledger.hashes.index(head) + 1}" if head in ledger.hashes else "NOT CONTAINED"
    return (
        ("ledger", f"{'DAMAGED' if wrong else 'intact'}, {len(ledger.hashes)} entries"),
        ("packages", f"{len(sealed)} sealed"),
        ("signatures", f"{len(ledger.of(Signed))}, and {len(ledger.of(Approved))} approvals"),
        ("not here", ", ".join(gone)),
        ("published head", contained if head else ""),
        ("first line", ledger.hashes[0] if ledger.hashes else ""),
        ("head", "on the next line"),
    )
