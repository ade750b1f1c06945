"""Following a run from another terminal until it ends, however it ends."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from hil.bench.lease import holds_a_lease
from hil.cli.run_names import latch_word
from hil.clock import wall
from hil.evidence.package.listing import shown
from hil.evidence.package.look import look
from hil.evidence.package.verification import in_short
from hil.evidence.runs import RunSummary, status
from hil.evidence.safed import guardian_lines, last_act
from hil.plugin.terminal.progress import Progress, drawn
from hil.report.live.following import Follower
from hil.report.live.lines import facts, one_line, reading_lines
from hil.report.numbers import duration
from hil.report.summary import closing_lines

__all__ = ["documents", "follow"]

_REFRESH_S = 1.0
_LINE_S = 60.0
_UP, _CLEAR = "\x1b[{}A\r", "\x1b[J"
_SIZE = (80, 24)

Pause = Callable[[float], None]


def follow(folder: Path, pause: Pause = wall.pause) -> int:
    """Show a run until it ends; in place on a terminal, else one line per event and the values every minute."""
    follower = Follower(folder)
    tell = _in_place if sys.stdout.isatty() and os.environ.get("TERM") != "dumb" else _in_lines
    tell(follower, pause)
    for line in _end(follower):
        click.echo(line)
    return 0


def documents(folder: Path, *, follow: bool, pause: Pause = wall.pause) -> Iterator[dict[str, Any]]:
    """Yield the status of a run, for machines: once, or every second until it ends."""
    follower = Follower(folder)
    while True:
        goes_on = follower.goes_on()
        follower.read()
        found = status(folder)
        yield _document(follower, found, goes_on=goes_on)
        if not follow or not goes_on:
            return
        pause(_REFRESH_S)


def _document(follower: Follower, found: RunSummary, *, goes_on: bool) -> dict[str, Any]:
    head = {
        "run": found.folder.name,
        "state": str(found.state),
        "problem": found.problem,
        "checked": found.checked,
        "plans": list(found.plans),
        "bench": found.bench,
        "source": found.source,
        "dut": found.dut,
        "purpose": found.purpose,
        "stopped": found.stopped,
        "verdict": found.verdict,
        "latched": bool(latch_word(found.folder)),
        "guardian": _guardian(found.folder),
        "age": found.age,
        "last_event": follower.last_utc,
    }
    return {**head, **facts(follower.outlook, follower.readings() if goes_on else [])}


def _guardian(folder: Path) -> dict[str, Any] | None:
    """Return the state of the guardian's last act, None without one; `unproven` is None before its first proof."""
    act = last_act(guardian_lines(folder))
    if act is None:
        return None
    return {
        "since": act.since,
        "safe": act.safe,
        "unproven": None if act.unproven is None else list(act.unproven),
        "at_work": not act.finished and holds_a_lease(folder.name),
    }


def _in_lines(follower: Follower, pause: Pause) -> None:
    """Show events as the run itself shows them; earlier ones are summed up in one line."""
    progress = Progress(sys.stdout)
    for line in follower.read():
        progress.pass_by(line.event)
    click.echo(one_line(follower.outlook, follower.readings()))
    told = wall.monotonic()
    while follower.goes_on():
        pause(_REFRESH_S)
        for line in follower.read():
            progress(line.event)
        if wall.monotonic() - told >= _LINE_S:
            told = wall.monotonic()
            click.echo(f"  {one_line(follower.outlook, follower.readings())}")
    for line in follower.read():
        progress(line.event)


def _in_place(follower: Follower, pause: Pause) -> None:
    height = 0
    while follower.goes_on():
        follower.read()
        lines = _screen(follower)
        click.echo((_UP.format(height) if height else "") + _CLEAR + "\n".join(lines), drawn(sys.stdout))
        height = len(lines)
        pause(_REFRESH_S)
    follower.read()


def _screen(follower: Follower) -> list[str]:
    """Return what fits on the terminal."""
    outlook, readings = follower.outlook, follower.readings()
    columns, rows = _size()
    age = follower.age
    lines = [
        follower.folder.name,
        one_line(outlook),
        *([outlook.case] if outlook.case else []),
        *reading_lines(readings, outlook.t),
        f"last event {duration(age)} ago" if age is not None else "",
    ]
    return [shown(line)[: columns - 1] for line in lines[: rows - 2]]


def _size() -> tuple[int, int]:
    try:
        size = os.get_terminal_size(sys.stdout.fileno())
    except (OSError, ValueError):
        return _SIZE
    return size.columns or _SIZE[0], size.lines or _SIZE[1]


def _end(follower: Follower) -> Iterator[str]:
    """Print how the run ended: with its verdict, or not at all."""
    name = follower.folder.name
    if follower.sealed():
        seen = look(follower.folder)
        if seen.outcome is not None:
            yield from closing_lines(seen.outcome)
        else:
            yield f"{name} is {seen.state}: {in_short(seen.findings)}"
            yield f"  hil verify {name} shows everything that is wrong"
        return
    since = follower.last_utc or "its beginning"
    yield f"{name} has not been running since {since}, and is not sealed"
    if latch := latch_word(follower.folder):
        yield f"  {latch}"
    yield f"  hil resume {name} continues it, hil seal {name} seals it as it is"
