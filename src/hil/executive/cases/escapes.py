"""Escapes from a case: threads and forked processes that outlive it, exceptions raised in them, faked clocks."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from traceback import walk_tb
from typing import ClassVar, NoReturn, SupportsIndex

from hil.clock import wall
from hil.executive.ending.stop import Astray, StopFlags
from hil.executive.setup.workspace import Workspace
from hil.model.errors import HilError

__all__ = ["Escaped", "Escapes", "OfThisProcess"]

_GRACE_S = 0.2
"""Grace period for a thread or a forked process that is just ending."""

_MOST = 1 << 16
_HINT = "call roles, record, check and step where the case runs; compute elsewhere"
Tell = Callable[[BaseException, str], None]
"""Takes what escaped, and the place in the plan that it came from."""

_present: list[StopFlags] = []


class Escaped(HilError):
    """Something of a case outlived it, hid how its threads ended, or replaced a clock of the process."""


class OfThisProcess:
    """Base of what a case is given and must not pass to another process: it cannot be pickled."""

    said: ClassVar[str] = "what belongs to the case"

    def __reduce_ex__(self, _protocol: SupportsIndex) -> NoReturn:
        """Refuse, even if the result of the other process is ignored.

        Raises:
            Astray: always.
        """
        why = f"the case copies {self.said}, or hands it to another process"
        for flags in _present:
            flags.turn_away(why, _HINT)
        raise Astray(why, _HINT)


class Escapes:
    """Watches the threads and forked processes of one case, from before its set-up to after its teardown.

    Args:
        flags: refuse any access to bench or evidence from there.
        workspace: where the case's code is.
    """

    def __init__(self, flags: StopFlags, workspace: Workspace) -> None:
        self._flags = flags
        self._workspace = workspace
        self._raised: list[BaseException] = []
        self._reader = self._writer = -1

    def begin(self) -> None:
        """Begin to watch."""
        self._faked = dict.fromkeys(wall.replaced())
        self._before = frozenset(sys._current_frames())  # noqa: SLF001 - the only list of threads that has all of them
        self._hooks = threading.excepthook, sys.unraisablehook
        self._mine = self._of_thread, self._of_start
        threading.excepthook, sys.unraisablehook = self._mine
        if hasattr(os, "fork"):
            self._reader, self._writer = os.pipe()
            os.set_blocking(self._reader, False)
            os.set_blocking(self._writer, False)
            self._flags.word_home = self._writer
        _present.append(self._flags)

    def place_of(self, error: BaseException) -> str:
        """Return file and line of the innermost code of the plan or the fixtures that an error came through."""
        workspace, found = self._workspace, ""
        for frame, line in walk_tb(error.__traceback__):
            path = Path(frame.f_code.co_filename)
            if path.is_relative_to(workspace.testplans) or path.is_relative_to(workspace.fixtures):
                found = f"{workspace.shown(path)}:{line}"
        return found

    def hear(self, tell: Tell) -> None:
        """Report what has been raised in threads and attempted in forked processes since the last call."""
        self._faked.update(dict.fromkeys(wall.replaced()))
        if self._reader >= 0:
            self._all_gone()
        raised, self._raised = self._raised, []
        for error in raised:
            tell(error, self.place_of(error))

    def end(self, tell: Tell) -> None:
        """Report what has escaped, and stop watching; a second call reports nothing."""
        if self._flags not in _present:
            return
        _present.remove(self._flags)
        found = [*self._replaced(), *self._left_threads()]
        if self._reader >= 0:
            self._flags.word_home = -1
            os.close(self._writer)
            found += self._left_copies()
        self.hear(tell)
        for error in [*found, *self._other_clocks()]:
            tell(error, "")
        if self._reader >= 0:
            os.close(self._reader)
            self._reader = -1

    def _of_thread(self, args: threading.ExceptHookArgs) -> None:
        """Hook for what ends a thread; a refused access is noted where it was refused."""
        old = args.thread is not None and args.thread.ident in self._before
        if not old and args.exc_value is not None and not isinstance(args.exc_value, Astray | SystemExit):
            self._raised.append(args.exc_value)

    def _of_start(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Hook for what ends a thread that was started without a Thread object."""
        of_thread = "thread started by" in (unraisable.err_msg or "")
        if not of_thread:
            self._hooks[1](unraisable)
        elif unraisable.exc_value is not None and not isinstance(unraisable.exc_value, Astray):
            self._raised.append(unraisable.exc_value)

    def _replaced(self) -> list[Escaped]:
        """Restore the hooks, and return which of them the case had replaced."""
        names = ("threading.excepthook", "sys.unraisablehook")
        found = [
            Escaped(f"the case replaced {name}, so that nobody saw what ended its threads", f"leave {name} as it is")
            for name, mine, now in zip(names, self._mine, (threading.excepthook, sys.unraisablehook), strict=True)
            if now != mine
        ]
        threading.excepthook, sys.unraisablehook = self._hooks
        return found

    def _other_clocks(self) -> list[Escaped]:
        """Return which clocks of this process were replaced before, during or after the case."""
        if not self._faked:
            return []
        hint = "leave the clocks of the process as they are; what the case may know of time is its fixture clock"
        return [Escaped(f"the case ran with replaced clocks: {', '.join(self._faked)}", hint)]

    def _left_threads(self) -> list[Escaped]:
        """Return the threads that the case started and that are still alive."""
        until = wall.monotonic() + _GRACE_S
        wall.pause(0.0)  # a thread just started has no id before it runs
        while left := self._begun():
            if wall.monotonic() >= until:
                break
            wall.pause(_GRACE_S / 20)
        named = {thread.ident: f"thread '{thread.name}'" for thread in threading.enumerate()}
        hint = "join it before the case ends, in a teardown if need be"
        return [Escaped(f"{named.get(each, 'a thread')} outlives the case", hint) for each in left]

    def _begun(self) -> list[int]:
        return sorted({*sys._current_frames()} - self._before)  # noqa: SLF001 - as above

    def _left_copies(self) -> list[Escaped]:
        """Return whether a forked process is still alive: it has the other end of the pipe open."""
        until = wall.monotonic() + _GRACE_S
        while not self._all_gone():
            if wall.monotonic() >= until:
                return [Escaped("a process that the case forked outlives it", "wait for it before the case ends")]
            select.select([self._reader], [], [], max(0.0, until - wall.monotonic()))
        return []

    def _all_gone(self) -> bool:
        """Keep what forked processes reported, and return whether none is left."""
        try:
            report = os.read(self._reader, _MOST)
        except BlockingIOError:
            return False
        self._raised += [Astray(line, _HINT) for line in dict.fromkeys(report.decode().splitlines())]
        return not report
