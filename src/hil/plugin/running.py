"""One run, from the request to its end."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NoReturn, Protocol, TextIO

from hil.evidence.folder import TRANSCRIPT
from hil.executive.ending.acknowledging import require_acknowledged
from hil.executive.people.notifying import Notifier
from hil.executive.people.on_call import OnCall, People, require_unattended
from hil.executive.people.questions import Declined
from hil.executive.people.witnesses import witnesses_of
from hil.executive.resuming.earlier import Earlier, find_earlier
from hil.executive.resuming.preconditions import changes, deviation_of, require_answers, require_frozen
from hil.executive.session import EXIT_INTERRUPTED, Session
from hil.executive.setup import auditing
from hil.executive.setup.configuration import Configuration, Request, configure
from hil.executive.setup.head import PlannedCase
from hil.executive.setup.workspace import Workspace
from hil.model.errors import Diverged, Refused
from hil.plugin import closing
from hil.plugin.closing import close, complain
from hil.plugin.launch import launch
from hil.plugin.opening import open_new, open_resumed
from hil.plugin.terminal.answering import answers_of
from hil.plugin.terminal.progress import Progress
from hil.wire.transcript import damaged_lines

__all__ = ["Word", "resume", "run"]

_WITHOUT = {
    2: "interrupted before the run began, nothing was driven",
    3: "nothing was run: pytest ended unexpectedly, see above",
    5: "no cases were found in these plans",
}
"""Why there is no package, by exit code."""

_FAILED, _INTERNAL, _REFUSED = 1, 3, 4
_COLLECTED = 20_000, 20, 50  # allocations, and collections of the younger generations, between collections


class Word(closing.Word, Protocol):
    """What is reported to a process that waits for the run's end."""

    def begun(self, folder: Path) -> None:
        """Report where the run writes."""
        ...

    def expect(self, seconds: float | None) -> None:
        """Start a timeout after which the process is to be ended; None cancels it."""
        ...

    def leave(self, code: int) -> NoReturn:
        """End the process at once."""
        ...


class _Unheard:
    """A `Word` to nobody: no process waits."""

    def begun(self, folder: Path) -> None:
        """Say nothing."""

    def sealed(self, code: int) -> None:
        """Say nothing."""

    def undisturbed(self) -> AbstractContextManager[None]:
        """Leave signals as they are."""
        return nullcontext()

    def expect(self, seconds: float | None) -> None:
        """Expect nothing."""

    def leave(self, code: int) -> NoReturn:
        """End the process at once."""
        os._exit(code)


def run(request: Request, out: TextIO, *, verbose: bool = False, word: Word | None = None) -> int:
    """Run the request's plans, seal the package, report how it ended, and return the exit code.

    The last line of `out` is the package's path. A failure of `out` changes neither the run nor its exit code.

    Args:
        request: what is run.
        out: where it is shown.
        verbose: whether everything is shown.
        word: reaches the process that waits.
    """
    return _run(lambda: configure(request), partial(open_new, alone=True), out, word or _Unheard(), verbose)


def resume(
    folder: Path,
    request: Callable[[Earlier], Request],
    out: TextIO,
    *,
    other_software: str = "",
    verbose: bool = False,
    word: Word | None = None,
) -> int:
    """Resume an interrupted run, seal its package, report how it ended, and return the exit code.

    Args:
        folder: the run's folder.
        request: returns the request that it began with.
        out: as in `run`.
        other_software: why it resumes although the software differs from the one that started it.
        verbose: whether everything is shown.
        word: reaches the process that waits for the run's end.

    Raises:
        Refused: if the run cannot be resumed, its inputs have changed, or it waits for `hil ack`.
    """
    auditing.begin()  # before drivers and the like of others are imported
    earlier = find_earlier(folder)
    require_acknowledged(folder)
    require_frozen(earlier)
    wanted = request(earlier)
    require_answers(earlier, wanted)
    configuration = configure(wanted)
    if changed := changes(earlier, configuration):
        raise Refused(
            f"{folder.name}: what the run is made of has changed since it began: {'; '.join(changed)}",
            "put it back as it was (the run's own copy is in its data/), or seal the run as it is with hil seal",
        )
    earlier = replace(earlier, deviation=deviation_of(earlier, configuration, other_software))
    opener = partial(open_resumed, earlier=earlier)
    return _run(lambda: configuration, opener, out, word or _Unheard(), verbose)


def _run(
    configured: Callable[[], Configuration], opener: Callable[..., Session], out: TextIO, word: Word, verbose: bool
) -> int:
    auditing.begin()  # before drivers and the like of others are imported
    process = _RunProcess(opener, out, word, verbose=verbose)
    with _rare_collections():
        try:
            configuration = configured()
            require_unattended(configuration)
            launched = launch(configuration, process.open)
        except KeyboardInterrupt:
            return _nothing(out, EXIT_INTERRUPTED)
        return process.close(launched.code)


@contextmanager
def _rare_collections() -> Iterator[None]:
    """Collect cyclic garbage less often: a run makes little, and each collection traverses all that was loaded."""
    before = gc.get_threshold()
    gc.set_threshold(*_COLLECTED)
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _collect_from_now_on() -> None:
    """Enable garbage collection in a process started for a run, except for what it has loaded."""
    if not gc.isenabled():
        gc.freeze()
        gc.enable()


class _RunProcess:
    """The process started for one run, which is ended if the run cannot continue.

    Args:
        opener: opens the session.
        out: where the run is shown.
        verbose: whether everything is shown.
        word: reaches the process that waits for the run's end.
    """

    def __init__(self, opener: Callable[..., Session], out: TextIO, word: Word, *, verbose: bool) -> None:
        self._opener = opener
        self._out = out
        self._word = word
        self._verbose = verbose
        self._session: Session | None = None
        self._notifier: Notifier | None = None

    def open(self, configuration: Configuration, planned: Sequence[PlannedCase]) -> Session:
        """Open the session, with all its spectators."""
        _collect_from_now_on()
        progress = Progress(self._out, verbose=self._verbose)
        notifier = Notifier(configuration.workspace.notify, configuration.workspace.root)
        session = self._opener(configuration, planned, spectators=[progress, notifier], caller=self)
        progress.follow(session.folder, session.bench.clock.now)
        notifier.attach(session.folder.name, session.keeper.journal)
        self._session, self._notifier = session, notifier
        complain(*(f"hil: {text}" for text in configuration.inputs.sleeps))
        _attend(session, notifier)
        self._word.begun(session.folder)
        return session

    def diverged(self, error: Diverged) -> None:
        """End the process of a resumed run that does not retrace its past; nothing has been driven."""
        if self._session is None:
            return
        if self._session.flags.reason:
            self.stopped_early()  # on the way to the safe state it leaves its record
        name, damaged = self._session.folder.name, next(damaged_lines(self._session.folder / TRANSCRIPT), None)
        if damaged is None:
            complain(f"hil: {name} cannot be resumed: {error.first}", "     it is unchanged; seal it with hil seal")
            self._word.leave(_INTERNAL)
        number, message = damaged
        complain(
            f"hil: {name} cannot be resumed: {TRANSCRIPT}:{number}:1: {message}",
            f"     put it back from a copy of the folder, and resume again; or seal the run as it is: hil seal {name}",
        )
        self._word.leave(_REFUSED)

    def stopped_early(self) -> None:
        """End the process of a resumed run that was told to stop before it had retraced its past."""
        if self._session is not None:
            problem = f"hil: {self._session.folder.name} was stopped before it resumed"
            complain(problem, f"     its record is unchanged; how to go on: hil status {self._session.folder.name}")
            self._word.leave(EXIT_INTERRUPTED)

    def expect(self, seconds: float | None) -> None:
        """Have the process ended if a case does not return from a call within this many seconds."""
        self._word.expect(seconds)

    def given_up(self) -> None:
        """Seal the run, and end the process in the middle of a case that nothing else ends."""
        self._word.leave(self.close(_FAILED))

    def close(self, pytest_code: int) -> int:
        """Seal, report, and return the exit code; what cannot be reported changes nothing."""
        if self._session is None:
            return _nothing(self._out, pytest_code)
        return close(self._session, self._notifier, pytest_code, self._out, self._word)


def _attend(session: Session, notifier: Notifier) -> None:
    """Have the bench armed only with the people that it needs; one in this process needs nobody.

    Args:
        session: the run, before its bench is armed.
        notifier: reaches the person on call.
    """
    configuration = session.configuration
    if session.machine is None:
        return
    _keep_registers(configuration.workspace, configuration.reports)

    def idle() -> bool:
        session.keeper.tick()
        return not session.flags.reason

    def pass_by() -> None:
        if not idle():
            raise Declined("the run is to end")

    answers = answers_of(configuration.request, configuration.workspace.shown, witnesses_of(configuration))(
        session.bench, pass_by, session.record.upkeep.elsewhere
    )
    people = People(_on_call(session, notifier), answers, session.keeper.journal, idle)
    session.record.events.listen(people)
    session.machine.attend(people)


def _keep_registers(its: Workspace, reports: Path) -> None:
    """Keep the present catalogue and registers in the ledger when a bench is driven; a failure is only reported."""
    from hil.audit.reading import keep_present  # noqa: PLC0415 - only where a bench is driven

    if problem := keep_present(its.root, its.testplans, its.fixtures, reports):
        complain(f"hil: the ledger does not have the present catalogue and registers: {problem}")


def _on_call(session: Session, notifier: Notifier) -> OnCall | None:
    request = session.configuration.request
    if not request.unattended:
        return None
    on_call = OnCall(
        request.on_call, session.folder.name, request.acknowledge_within_s, notifier.send, session.keeper.journal
    )
    session.record.upkeep.expect(on_call)
    return on_call


def _nothing(out: TextIO, code: int) -> int:
    with suppress(OSError, ValueError):
        print(_WITHOUT.get(code, "nothing was run"), file=out, flush=True)
    return code
