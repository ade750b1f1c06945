"""Late freezing: files that code uses for the first time during a run, and detection of changes on disk since."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hil.evidence import events
from hil.evidence.durable import write_whole
from hil.executive.ending.stop import StopFlags
from hil.executive.journaling.events import Events
from hil.executive.setup.executed import Executed
from hil.executive.setup.inputs import Inputs
from hil.model.errors import HilError

__all__ = ["Freezing", "freezing"]


class Freezing:
    """Freezes every further file that code uses into the run's folder, with an event.

    Args:
        inputs: what was read.
        folder: the run's folder.
        journal: where events are written.
        flags: prevent stop requests between a file and its event.
    """

    def __init__(self, inputs: Inputs, folder: Path, journal: Events, flags: StopFlags) -> None:
        self._inputs = inputs
        self._folder = folder
        self._journal = journal
        self._flags = flags
        self._home = threading.get_ident()
        self._case = ""
        self._frozen: set[str] = set()
        self._waiting: list[Path] = []
        self._executed: Executed | None = None

    def compare_executed(self) -> None:
        """From now on, compare what the run executes with what was installed; evidence from hardware needs that."""
        self._executed = Executed(self._inputs)

    def heard(self, event: events.Event) -> None:
        """Take an event."""
        match event:
            case events.Frozen():
                self._frozen.update(event.files)
            case events.Case():
                self._case = event.case
            case events.CaseEnd():
                self._case = ""

    def used(self, path: Path) -> None:
        """Freeze a file that code used for the first time; one used by another thread, when the case has ended."""
        name = self._inputs.name_of(path)
        if name in self._frozen or self._flags.is_copy:
            return
        if threading.get_ident() != self._home:
            self._waiting.append(path)
            return
        with self._flags.undisturbed():  # no file without its event
            self._frozen.add(name)
            data = self._inputs.snapshot.take(path)
            (self._folder / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._folder / name, data)
            digest = hashlib.sha256(data).hexdigest()
            reaches = self._inputs.reaches_of(path)
            self._journal.write(events.FrozenLater(file=name, sha256=digest, case=self._case, reaches=reaches))

    def end_of_case(self) -> list[HilError]:
        """Freeze what is pending, and return what was refused to the case, even if the case ignored it."""
        while self._waiting:
            self.used(self._waiting.pop(0))
        if self._executed is not None and (problems := self._executed.new_problems()):
            self._journal.write(events.Executed(problems=problems))
        return self._inputs.take_refused()

    def tell_changes(self) -> None:
        """Record which files have changed on disk, and what else was executed."""
        if self._executed is not None:
            its = self._executed
            self._journal.write(events.Executed(packages=its.packages(), problems=its.last_problems(), last=True))
        for path in self._inputs.changed():
            shown = self._inputs.shown(path)
            text = f"{shown} changed on the disk while the run lasted; the run used the frozen bytes"
            self._journal.write(events.Anomaly(text=text))


@contextmanager
def freezing(inputs: Inputs, folder: Path, journal: Events, flags: StopFlags) -> Iterator[Freezing]:
    """Freeze what code uses for the first time, until the context is left."""
    found = Freezing(inputs, folder, journal, flags)
    journal.listen(found.heard, events.Frozen, events.Case, events.CaseEnd)
    inputs.listen(found.used)
    try:
        yield found
    finally:
        inputs.listen(None)
