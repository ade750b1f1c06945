"""`hil ack`: acknowledge what the guardian did to a bench, or that the person on call was reached."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.options import name_option
from hil.cli.run_names import answer_of, find_run, find_running, reports_folder, shown
from hil.evidence.folder import GUARDIAN, JOURNAL
from hil.model.errors import EvidenceError, Refused

if TYPE_CHECKING:
    from hil.report.page.incidents import Sentence

__all__ = ["command", "moment", "what_happened", "written_down"]

_OF_BENCH = frozenset({"safe", "stop", "trip"})


@click.command(name="ack", epilog='Example: hil ack latest --by "A. Engineer" --text "fuse F2 blown, replaced"')
@click.argument("run", metavar="RUN")
@name_option("--by", help="Who acknowledges.")
@click.option("--text", default="", metavar="TEXT", help="What was seen and done.")
@click.option("--code", default="", metavar="CODE", help="The code sent to the person on call.")
def command(run: str, by: str, text: str, code: str) -> int:
    """Show what the guardian did to the bench of a run, and acknowledge it by name.

    Until then the bench stays latched: no run or check may drive it. With --code, confirm instead that the person on
    call received the code that an unattended run is waiting for. Exit codes: 0, or 1 if the code is wrong.
    """
    if code.strip():
        return _reached(run, by, code)
    from hil.evidence.ledger.book import ledger_file  # noqa: PLC0415 - heavy
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.executive.ending.acknowledging import acknowledge  # noqa: PLC0415 - heavy

    folder = _run_or_latched(run)
    _tell(folder)
    done = acknowledge(folder, reports_folder(), by=by, text=text)
    if done.entry is not None:
        click.echo(f"written to line {done.entry.seq + 1} of {shown(ledger_file(reports_folder()))}")
    else:
        click.echo("it goes into the journal when the run is resumed or sealed")
    for bench in done.benches:
        click.echo(f"bench {printable(bench)} is no longer latched")
    return 0


def what_happened(folder: Path) -> list[Sentence]:
    """Return what tripped, what was made safe or stayed unsafe, what the guardian did, and what is latched, by time."""
    from hil.bench.lease import latches_of  # noqa: PLC0415 - heavy
    from hil.evidence.safed import guardian_lines  # noqa: PLC0415 - heavy
    from hil.report.page.incidents import Sentence, sentences  # noqa: PLC0415 - heavy

    told = [*sentences(_of_run(folder)), *sentences(guardian_lines(folder))]
    for latch in latches_of(folder.name).values():
        unproven = f"; not proven safe: {', '.join(latch.outputs)}" if latch.outputs else ""
        told.append(Sentence(latch.since, f"bench {latch.bench} has been latched since then: {latch.why}{unproven}"))
    return sorted(dict.fromkeys(told), key=lambda each: each.at.rstrip("Z") or "~")


def moment(utc: str) -> str:
    """Return an instant in readable form, to the millisecond; any other text unchanged."""
    day, _, time = utc.partition("T")
    whole, _, part = time.rstrip("Z").partition(".")
    return f"{day} {whole}.{part[:3]:0<3} UTC" if time.endswith("Z") else utc


def written_down(folder: Path) -> list[Path]:
    """Return the existing files in which the guardian and the run recorded it."""
    return [path for path in (folder / GUARDIAN, folder / JOURNAL) if path.is_file()]


def _of_run(folder: Path) -> Iterator[dict[str, object]]:
    from hil.evidence.events.codec import plain  # noqa: PLC0415 - heavy
    from hil.evidence.journal.reader import read_journal  # noqa: PLC0415 - heavy

    with suppress(EvidenceError):
        for line in read_journal(folder / JOURNAL).lines:
            if (kind := line.event.kind()) in _OF_BENCH:
                yield {**plain(line.event), "event": kind, "utc": line.wall.get("utc", "")}


def _tell(folder: Path) -> None:
    """Print what happened in chronological order, and which files have the full record."""
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned  # noqa: PLC0415 - heavy

    for line in aligned([(printable(moment(each.at)), printable(each.text)) for each in what_happened(folder)]):
        click.echo(line)
    if files := [printable(shown(path)) for path in written_down(folder)]:
        click.echo(f"in full: {', '.join(files)}")


def _run_or_latched(asked: str) -> Path:
    """Return the folder of a run, even if only its latch is left."""
    from hil.bench.lease import latches_of  # noqa: PLC0415 - only where something is latched

    try:
        return find_run(asked)
    except Refused:
        if asked.strip() and (left := latches_of(asked)):
            folder = Path(next(iter(left.values())).run)
            return folder if _can_be_read(folder) else reports_folder() / folder.name
        raise


def _can_be_read(folder: Path) -> bool:
    """Return whether this user can read a run's folder; another user's may be closed."""
    try:
        return (folder / JOURNAL).is_file()
    except PermissionError:
        return False


def _reached(run: str, by: str, code: str) -> int:
    from hil.evidence.events import Reached  # noqa: PLC0415 - only when it is used
    from hil.evidence.inbox import post  # noqa: PLC0415 - only when it is used
    from hil.report.live.following import Follower  # noqa: PLC0415 - only when it is used

    if not by.strip():
        raise Refused("--code needs the name of the person who was reached", "add --by NAME")
    folder = find_running(run)
    follower = Follower(folder)
    follower.read()
    post(folder, "reached", by=by.strip(), text=code.strip())
    answer = answer_of(follower, Reached)
    if answer is None:
        click.echo("the run has not read the code yet; hil status shows whether it is still running")
        return 0
    if isinstance(answer, Reached) and not answer.ok:
        click.echo("refused: this is not the code that the run is waiting for", err=True)
        return 1
    click.echo("the code is right; the run now arms the bench")
    return 0
