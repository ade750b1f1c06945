"""After the process of a run died: what a person can do next, and who is notified in its place."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hil.clock import wall
from hil.evidence.folder import JOURNAL, is_sealed
from hil.model.errors import HilError

__all__ = ["death_of", "not_proven", "tell_of_death", "ways_on", "why_not_resumed"]

_UNSEALED = "before the run was sealed"
_GUARDIAN_S = 10.0
_COMMAND_S = 10.0
_LOOK_S = 0.1
_LOOKS = 2  # the guardian may be writing a latch at the moment of one
_TAIL = 1 << 20
"""Bytes at a journal's end in which its last events stand, if it has come to them."""


def death_of(folder: Path, how: str) -> str:
    """Return a sentence on the death of a run's process, and whether the package was sealed by then.

    Args:
        folder: the run's folder.
        how: how its process ended, as "was ended by SIGKILL".
    """
    when = "after the run was sealed and before its package was verified" if is_sealed(folder) else _UNSEALED
    return f"the process of the run {how} {when}"


def tell_of_death(
    folder: Path, how: str, ways: list[str], *, guardian_s: float = _GUARDIAN_S, command_s: float = _COMMAND_S
) -> None:
    """Run the notification `died` of the workspace around the present folder, if it has one; what keeps it is said.

    Args:
        folder: the run's folder.
        how: how its process ended, as "was ended by SIGKILL".
        ways: what a person does next, a sentence each.
        guardian_s: how long a guardian at work is waited for, so that what it did can be told [s].
        command_s: after so long the command is killed [s].
    """
    try:
        _tell(folder, how, ways, guardian_s, command_s)
    except (HilError, OSError, ValueError) as error:
        with suppress(OSError, ValueError, AttributeError):
            sys.stderr.write(f"hil: nobody was notified of 'died': {error}\n")


def not_proven(folder: Path, *, guardian_s: float = _GUARDIAN_S) -> tuple[str, ...]:
    """Return the outputs that have not been proven safe since the process of a run died; none if all are.

    A bench is latched with all of its outputs while it is armed, and with those that are not proven safe by its
    guardian, which is waited for while it is at work.

    Args:
        folder: the run's folder.
        guardian_s: how long a guardian at work is waited for [s].
    """
    from hil.bench.lease import holds_a_lease, latches_of  # noqa: PLC0415 - only after a run that died

    began, clean = wall.monotonic(), 0
    while clean < _LOOKS:
        at_work = holds_a_lease(folder.name)
        left = dict.fromkeys(output for latch in latches_of(folder.name).values() for output in latch.outputs)
        if left and not (at_work and wall.monotonic() - began < guardian_s):
            return tuple(left)
        clean = 0 if left else clean + 1
        wall.pause(_LOOK_S / _LOOKS)
    return ()


def _tell(folder: Path, how: str, ways: list[str], guardian_s: float, command_s: float) -> None:
    from hil.executive.setup.workspace import find_workspace  # noqa: PLC0415 - only after a run that died

    workspace = find_workspace(Path.cwd())
    if not workspace.notify:
        return
    from hil.executive.people.notifying import Notifier  # noqa: PLC0415 - as above

    with _undisturbed():
        told = "; ".join((death_of(folder, how), *_bench(folder, guardian_s), *ways))
        notifier = Notifier(workspace.notify, workspace.root, command_s)
        notifier.attach(folder.name, None)
        became = notifier.send("died", told)
        while became() is None:
            notifier.tick()
            wall.pause(_LOOK_S)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """Block requests to end, because it ends anyway; the command does not inherit the blocked signals."""
    asks = {number for name in ("SIGINT", "SIGTERM", "SIGHUP") if (number := getattr(signal, name, None)) is not None}
    heard = {number: found for number in asks if (found := signal.getsignal(number)) is not signal.SIG_IGN}
    for number in heard:
        signal.signal(number, lambda *_: None)
    before = signal.pthread_sigmask(signal.SIG_UNBLOCK, {*asks, signal.SIGCHLD})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number, handler in heard.items():
            signal.signal(number, handler)


def _bench(folder: Path, limit_s: float) -> Iterator[str]:
    """Yield what the guardian wrote down of the bench, once it is done or the time is over; nothing without one."""
    from hil.bench.lease import holds_a_lease  # noqa: PLC0415 - only after a run that died
    from hil.evidence.folder import is_held  # noqa: PLC0415 - as above
    from hil.evidence.safed import guardian_lines, last_act  # noqa: PLC0415 - as above
    from hil.executive.ending.acknowledging import waits_for_ack  # noqa: PLC0415 - as above
    from hil.report.page.incidents import sentences  # noqa: PLC0415 - as above

    began = wall.monotonic()
    while at_work := is_held(folder) or holds_a_lease(folder.name):
        act = last_act(guardian_lines(folder))
        if wall.monotonic() - began > limit_s or (act is not None and act.trying):
            break
        wall.pause(_LOOK_S)
    lines = guardian_lines(folder)
    done = [line for line in lines if line.get("event") in {"done", "trying"}]
    if done:
        yield from (sentence.text for sentence in sentences(done[-1:]))
    elif lines or at_work:
        yield "the guardian has not finished yet"
    if waits_for_ack(folder):
        yield f"the bench is latched and waits for hil ack {folder.name}"


def ways_on(folder: Path) -> Iterator[str]:
    """Yield what a person can do next, a line each, as far as the run's journal allows.

    The whole journal is not read, because that of weeks is long: nothing is verified here.

    Args:
        folder: the run's folder, whose process has ended.
    """
    from hil.bench.lease import ack_line, latches_of  # noqa: PLC0415 - only after a run that died

    if is_sealed(folder):
        yield f"verify the package, and enter its seal in the ledger: hil seal {folder.name}"
        return
    yield f"check the bench first; then see how far the run got: hil status {folder.name}"
    seal = f"seal it as it is: hil seal {folder}"
    try:
        why_not = why_not_resumed(folder / JOURNAL)
    except OSError:
        why_not = "because its journal cannot be read"
    if why_not:
        yield f"it cannot be resumed, {why_not}; {seal}"
    else:
        if latches_of(folder.name):
            yield f"acknowledge what you found, the bench is latched until then: {ack_line(folder.name)}"
        yield f"resume it: hil resume {folder}"
        yield f"or {seal}"


def why_not_resumed(journal: Path) -> str:
    """Return why a run cannot be resumed, nothing where it can.

    One on a bench of its own process is made again from its first step; any other bench needs a case to enter it at.
    """
    live = planned = began = False
    with journal.open("rb") as lines:
        for line in lines:
            live = live or (b'"kind":"run"' in line and b'"live":{' in line)
            planned = planned or b'"kind":"planned"' in line
            if began := b'"kind":"case"' in line:
                break
        lines.seek(0, os.SEEK_END)
        lines.seek(max(0, lines.tell() - _TAIL))
        last = lines.readlines()
    if any(b'"kind":"results"' in line for line in last):
        return "because it has ended and only its seal is missing"
    if any(b'"kind":"recovered"' in line for line in last):
        return "because it is sealed in part"
    if any(b'"kind":"stop"' in line and b'"resumable":true' not in line for line in last):
        return "because it was stopped for good"
    return "" if planned and (began or not live) else "because no case had begun"
