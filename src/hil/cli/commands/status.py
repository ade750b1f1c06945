"""`hil status`: show the status of a run, once or until it ends."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hil.cli.run_names import find_run, latch_word

if TYPE_CHECKING:
    from hil.evidence.events import Anomaly, Attachment, Note
    from hil.evidence.runs import RunSummary

__all__ = ["command"]


@click.command(name="status", epilog="Example: hil status latest --follow")
@click.argument("run", metavar="RUN")
@click.option("--follow", is_flag=True, help="Keep showing it until the run ends.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document; with --follow, one per line.")
def command(run: str, follow: bool, as_json: bool) -> int:
    """Show what a run is doing, its latest readings and the bench time left, or how it ended.

    A sealed package is verified, unless it is large; what was checked is printed below the verdict. A damaged package
    has no verdict, and the exit code is 1.
    """
    folder = find_run(run)
    from hil.evidence.package.verification import State  # noqa: PLC0415 - heavy
    from hil.evidence.runs import status  # noqa: PLC0415 - heavy

    if as_json:
        return _machine(folder, follow=follow)
    if follow:
        from hil.cli.following import follow as go_along  # noqa: PLC0415 - heavy

        return go_along(folder)
    found = status(folder)
    from hil.documents.text import fitting  # noqa: PLC0415 - heavy

    for line in fitting(status_lines(found), shutil.get_terminal_size().columns if sys.stdout.isatty() else 0):
        click.echo(line)
    return 1 if found.state is State.DAMAGED else 0


def status_lines(found: RunSummary) -> list[str]:
    """Return the status of a run, in lines."""
    from hil.evidence.package.listing import shown as printable  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State  # noqa: PLC0415 - heavy
    from hil.report.live.following import Follower  # noqa: PLC0415 - heavy
    from hil.report.live.lines import reading_lines  # noqa: PLC0415 - heavy
    from hil.report.numbers import bench_time, duration  # noqa: PLC0415 - heavy
    from hil.report.tables import aligned, labelled  # noqa: PLC0415 - heavy

    folder = found.folder
    follower = Follower(folder)
    if follower.goes_on():
        follower.read()
    readings = follower.readings()
    outlook = follower.outlook
    damaged = found.state in {State.DAMAGED, State.UNKNOWN}
    facts = (
        ("run", found.folder.name),
        ("state", str(found.state)),
        ("plans", ", ".join(found.plans)),
        ("bench", f"{found.bench} ({found.source})" if found.bench else ""),
        ("DUT", found.dut),
        ("purpose", found.purpose),
        ("cases", "" if damaged else f"{found.ended} of {found.planned} ended"),
        ("case", found.case),
        ("step", found.step),
        ("loop", ", ".join(str(turns) for turns in outlook.turns)),
        ("bench time", "" if damaged else bench_time(max(found.t, outlook.t))),
        ("estimate", str(outlook.left() or "")),
        ("question", "" if outlook.asked is None else f"{outlook.asked.text} hil answer {folder.name}"),
        ("held", "" if outlook.held is None else outlook.held or "yes"),
        ("stopped by", found.stopped),
        ("last event", "" if found.age is None else f"{duration(found.age)} ago"),
        ("verdict", "-" if damaged else found.verdict),
        *(("EXCEPTION", each) for each in found.exceptions),
        ("checked", found.checked),
        ("guardian", _guardian(folder)),
        ("latch", latch_word(folder)),
        ("next", _next(found)),
        ("problem", found.problem),
    )
    return [
        *labelled((label, printable(value)) for label, value in facts),
        *(["readings", *map(printable, reading_lines(readings, outlook.t))] if readings else []),
        *aligned((event.kind(), bench_time(event.t), printable(_added(event))) for event in found.added),
    ]


def _next(found: RunSummary) -> str:
    """Return the next command for an interrupted run; empty for any other."""
    from hil.bench.lease import ack_line  # noqa: PLC0415 - heavy
    from hil.cli.died import why_not_resumed  # noqa: PLC0415 - heavy
    from hil.evidence.folder import JOURNAL  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State  # noqa: PLC0415 - heavy

    name = found.folder.name
    if found.state not in {State.INTERRUPTED, State.SAFED}:
        return ""
    if why_not_resumed(found.folder / JOURNAL):
        return f"hil seal {name}"
    return f"{ack_line(name)}, then hil resume {name}" if latch_word(found.folder) else f"hil resume {name}"


def _guardian(folder: Path) -> str:
    """Return what the guardian is still doing, or could not prove; empty if it did not act or all is safe."""
    from hil.bench.lease import holds_a_lease  # noqa: PLC0415 - heavy
    from hil.cli.commands.ack import moment  # noqa: PLC0415 - only where it is used
    from hil.evidence.safed import guardian_lines, last_act  # noqa: PLC0415 - heavy

    act = last_act(guardian_lines(folder))
    if act is None or act.safe:
        return ""
    if not act.proves:
        return "it guarded no output, so nothing was proven safe"
    so_far = f"proven safe: {', '.join(act.proven)}" if act.proven else ""
    known = f"it ended before it was done; {so_far}" if so_far else "no proof is on record"
    what = known if act.unproven is None else f"NOT PROVEN SAFE: {', '.join(act.unproven)}"
    if act.finished or not holds_a_lease(folder.name):
        return what
    if act.unproven is None:
        return f"making the bench safe since {moment(act.since)}; {so_far or 'nothing is proven yet'}"
    process = f" (process {act.pid})" if act.pid else ""
    return f"trying since {moment(act.since)}{process}; {what}"


def _added(event: Note | Attachment | Anomaly) -> str:
    from hil.evidence.events import Anomaly, Attachment  # noqa: PLC0415 - heavy
    from hil.report.page.incidents import attached, noted  # noqa: PLC0415 - heavy

    if isinstance(event, Attachment):
        return attached(event.file, event.text, event.by)
    return event.text if isinstance(event, Anomaly) else noted(event.text, event.by)


def _machine(folder: Path, *, follow: bool) -> int:
    from hil.cli.following import documents  # noqa: PLC0415 - heavy
    from hil.documents.canonical import canonical  # noqa: PLC0415 - heavy
    from hil.evidence.package.verification import State  # noqa: PLC0415 - heavy

    state = ""
    for document in documents(folder, follow=follow):
        state = document["state"]
        click.echo(canonical(document).decode())
    return 1 if state == State.DAMAGED else 0
