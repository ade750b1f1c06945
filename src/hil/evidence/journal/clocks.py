"""Clock checks of a journal: whether its times are complete, in order, and agree with the run's supervisor."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

from hil.clock import wall
from hil.evidence.events import Anomaly, ClockJump, Reboot, Recovered, Resumed, Run
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import JournalLine
from hil.model.errors import Finding

__all__ = ["DOUBT", "SUPERVISOR", "clock_doubts", "clock_findings"]

DOUBT = "CLOCK: "
"""Prefix of sentences about times that cannot be believed, such as in an anomaly of the run."""
SUPERVISOR = "supervisor"
"""The field in the wall half of a line with the latest stamp of the process that supervises the run."""

_APART_S = 2.0
"""Tolerance between two clocks of one machine read one after the other; smaller steps go unnoticed."""

_Timed = tuple[JournalLine, tuple[float, float]]

_ENTERS = (Reboot, Recovered, Resumed)
"""Events before which another process may have set the time of day."""


def clock_findings(lines: Sequence[JournalLine]) -> Iterator[Finding]:
    """Yield every line without a complete wall stamp, and every unexplained step back in time.

    UTC may go back where an event says that the time of day was set, or where another process took over.
    """
    timed = [(line, _read(line.wall)) for line in lines]
    for line, read in timed:
        if missing := [name for name, kind in _FIELDS.items() if not isinstance(line.wall.get(name), kind)]:
            yield Finding(JOURNAL, line.number, 1, f"its wall stamp has no {' and no '.join(missing)}")
        elif read is None:
            yield Finding(JOURNAL, line.number, 1, "the UTC of its wall stamp is no moment")
    jumps = _jumps(lines)
    for (before, was), (line, now) in _pairs(timed):
        if before.wall["boot_id"] == line.wall["boot_id"] and now[1] < was[1]:
            yield Finding(
                JOURNAL, line.number, 1, f"its time since boot is {was[1] - now[1]:g} s before the line before"
            )
        back, step = was[0] - now[0], (now[0] - now[1]) - (was[0] - was[1])
        if back > _APART_S and not isinstance(line.event, _ENTERS) and not _explained(step, jumps):
            yield Finding(
                JOURNAL, line.number, 1, f"its UTC is {back:g} s before the line before, and no event says why"
            )


def clock_doubts(lines: Sequence[JournalLine]) -> tuple[str, ...]:
    """Return why the times of a run cannot be believed, a sentence each; none means that its supervisor agrees.

    UTC is compared with the time since boot from line to line, and both with the supervisor's own stamps: code of a
    case can change the clocks of its own process, but not those of another one. An anomaly noted because the ledger
    has entries of a later time counts, too.
    """
    noted = (line.event.text for line in lines if isinstance(line.event, Anomaly))
    found = (*_steps(lines), *_other_clocks(lines), *(text for text in noted if text.startswith(DOUBT)))
    run = next((line.event for line in lines if isinstance(line.event, Run)), None)
    if run is not None and run.live is not None and not any(SUPERVISOR in line.wall for line in lines):
        return (*found, "no supervisor stamped the times of the run")
    return found


_FIELDS: Mapping[str, type | tuple[type, ...]] = {"utc": str, "boot": (int, float), "boot_id": str}


def _read(stamp: Mapping[str, object]) -> tuple[float, float] | None:
    """Return UTC and time since boot of a stamp in s, None if it is incomplete."""
    utc, boot = stamp.get("utc"), stamp.get("boot")
    if not isinstance(utc, str) or not isinstance(boot, int | float) or not isinstance(stamp.get("boot_id"), str):
        return None
    try:
        return wall.seconds_of(utc), float(boot)
    except ValueError:
        return None


def _pairs(
    timed: Iterable[tuple[JournalLine, tuple[float, float] | None]],
) -> Iterator[tuple[_Timed, _Timed]]:
    """Yield each line and the next one with their UTC and time since boot in s, where both are complete."""
    for (before, was), (line, now) in pairwise(timed):
        if was is not None and now is not None:
            yield (before, was), (line, now)


def _jumps(lines: Sequence[JournalLine]) -> list[float]:
    return [line.event.seconds for line in lines if isinstance(line.event, ClockJump)]


def _explained(step: float, jumps: Sequence[float]) -> bool:
    return any(abs(step - jump) <= _APART_S for jump in jumps)


def _steps(lines: Sequence[JournalLine]) -> Iterator[str]:
    """Yield where UTC and the time since boot diverge without an event that says so."""
    jumps = _jumps(lines)
    for (before, was), (line, now) in _pairs((line, _read(line.wall)) for line in lines):
        if before.wall["boot_id"] != line.wall["boot_id"]:
            continue
        step = (now[0] - now[1]) - (was[0] - was[1])
        if abs(step) > _APART_S and not isinstance(line.event, _ENTERS) and not _explained(step, jumps):
            yield (
                f"{DOUBT}from event {before.number} to {line.number} of the journal UTC and the time since boot part by"
                f" {step:+.0f} s, and no event says that the time of day was set"
            )
            return


def _other_clocks(lines: Sequence[JournalLine]) -> Iterator[str]:
    """Yield the first line whose clocks disagree with its supervisor's stamp."""
    before: JournalLine | None = None
    for line in lines:
        found = line.wall.get(SUPERVISOR)
        if isinstance(found, dict) and (text := _other_clock(found, line, before)):
            yield f"{DOUBT}event {line.number} of the journal {text}"
            return
        before = line


def _other_clock(found: Mapping[str, object], line: JournalLine, before: JournalLine | None) -> str:
    """Return how a line's clocks differ; the time of day may have been set between two lines."""
    said, now = _read(found), _read(line.wall)
    if said is None or now is None or found["boot_id"] != line.wall["boot_id"]:
        return "has no whole stamp of the supervisor of this machine"
    if said[1] - now[1] > _APART_S:
        return f"is {said[1] - now[1]:.0f} s before its supervisor by the time since boot"
    was = _read(before.wall) if before is not None and before.wall.get("boot_id") == found["boot_id"] else None
    apart = [(each[0] - each[1]) - (said[0] - said[1]) for each in (now, was) if each is not None]
    if all(abs(each) > _APART_S for each in apart):
        return f"has a UTC that is {apart[0]:+.0f} s from that of its supervisor"
    return ""
