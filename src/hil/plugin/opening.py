"""Opens sessions: on a bench, on its simulated twin, or on the record of an earlier run."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial

import pytest

from hil.bench.binding import bind_resumed, bind_simulated
from hil.bench.bound import BoundBench
from hil.bench.live import Opened, bind_live, bind_live_again, require_boards
from hil.evidence.folder import TRANSCRIPT
from hil.executive.journaling.events import Caller
from hil.executive.people.answers import Answered
from hil.executive.people.at_hand import at_hand
from hil.executive.people.witnesses import Witnesses, witnesses_of
from hil.executive.resuming.beginnings import NewRun, ResumedRun
from hil.executive.resuming.earlier import Earlier
from hil.executive.resuming.preconditions import require_same_cases
from hil.executive.session import Session, Spectator
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.head import PlannedCase
from hil.model.identity import Source
from hil.plugin.plans.collection import skipped_cases
from hil.plugin.plans.prompts import Attended, foreseen, require_answers, require_pictures, require_witness_points
from hil.plugin.terminal.answering import acted_out, answers_of
from hil.wire.transcript import Transcript

__all__ = ["open_new", "open_resumed"]


def open_new(
    configuration: Configuration,
    planned: Sequence[PlannedCase],
    spectators: Sequence[Spectator] = (),
    caller: Caller | None = None,
    *,
    alone: bool = False,
) -> Session:
    """Open a session on the bench, or on its simulated twin.

    Args:
        configuration: what the run is made of.
        planned: its cases.
        spectators: are shown every event.
        caller: is notified of what the run cannot recover from.
        alone: whether the run needs the bench to itself; a rehearsal does not.

    Raises:
        WrongPort: if a board is not where the bench file says; no run folder is created.
        NoReply: if a port cannot be opened; no run folder is created.
    """
    if (reach := configuration.reach()) is not None:
        require_boards(configuration.bench, reach)
    witnesses = witnesses_of(configuration)
    answers = answers_of(configuration.request, configuration.workspace.shown, witnesses)
    if alone:
        _require_answers(configuration, planned, witnesses)
    ports = _Ports(configuration)
    try:
        return Session(
            configuration,
            planned,
            binder=ports.bind,
            answers=acted_out(answers),
            leases=_leases(configuration) if alone else [],
            spectators=spectators,
            caller=caller,
            beginning=NewRun(ports.open),
        )
    finally:
        ports.close()


def _require_answers(configuration: Configuration, planned: Sequence[PlannedCase], witnesses: Witnesses) -> None:
    """Require that the cases' questions will be answered, before anything is opened and the run has a folder."""
    request, workspace = configuration.request, configuration.workspace
    outside = configuration.outside
    twin = configuration.bench.simulated
    alone = request.source is Source.SIMULATED and not outside and not request.person
    attended = Attended(
        terminal=(sys.stdin is not None and sys.stdin.isatty()) or request.unattended,  # None if it was closed
        simulated=frozenset(twin.person) if alone and twin is not None else None,
        safety=outside,
    )
    left_out = skipped_cases({case.id: case for case in planned}, request)
    by_case = [(case, foreseen(case.item, workspace.root)) for case in planned if isinstance(case.item, pytest.Item)]
    asked = [each for _, found in by_case for each in found]
    run = [(case, found) for case, found in by_case if case.id not in left_out]
    require_answers(asked, [each for _, found in run for each in found], request, attended, witnesses, workspace.shown)
    require_pictures(run, lambda plan, name: at_hand(configuration, plan).picture(name))
    if request.purpose.closes:
        require_witness_points(configuration.catalogue, run)


def open_resumed(
    configuration: Configuration,
    planned: Sequence[PlannedCase],
    spectators: Sequence[Spectator],
    caller: Caller,
    *,
    earlier: Earlier,
) -> Session:
    """Reopen the session of an interrupted run, first on its record, and after its checkpoint on its bench.

    Raises:
        Refused: if other cases were collected than before.
    """
    require_same_cases(earlier, planned)
    fresh = answers_of(configuration.request, configuration.workspace.shown, witnesses_of(configuration))
    return Session(
        configuration,
        planned,
        binder=partial(_bind_again, configuration, earlier),
        answers=acted_out(
            lambda bench, idle, elsewhere: Answered(
                earlier.come_again, fresh(bench, idle, elsewhere), lambda: bench.world is not None
            )
        ),
        leases=_leases(configuration),
        spectators=spectators,
        caller=caller,
        beginning=ResumedRun(earlier),
    )


class _Ports:
    """The ports of a new run's bench: opened before the run has a folder, and bound once it has one."""

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._opened: Opened | None = None

    def open(self) -> None:
        """Open the ports, if the bench is outside this process; see `Opened`."""
        if (reach := self._configuration.reach()) is not None:
            self._opened = Opened(self._configuration.bench, reach)

    def bind(self, transcript: Transcript, _where: Callable[[], str]) -> BoundBench:
        """Build the bench."""
        configuration = self._configuration
        if (reach := configuration.reach()) is not None:
            return bind_live(configuration.bench, reach, configuration.epoch, transcript, self._opened)
        return bind_simulated(configuration.bench, transcript)

    def close(self) -> None:
        """Close the ports that were not bound."""
        if self._opened is not None:
            self._opened.close()


def _bind_again(
    configuration: Configuration, earlier: Earlier, transcript: Transcript, where: Callable[[], str]
) -> BoundBench:
    record = earlier.folder / TRANSCRIPT
    if (reach := configuration.reach()) is not None:
        return bind_live_again(configuration.bench, reach, configuration.epoch, transcript, record, where)
    if earlier.checkpoint is None:
        return bind_simulated(configuration.bench, transcript)
    # A run killed on its way to the safe state may have its last checkpoint before its point of entry.
    asked = earlier.boundary is not None and earlier.boundary.at_ns <= earlier.checkpoint.at_ns
    return bind_resumed(configuration.bench, transcript, record, earlier.checkpoint, where, asked=asked)


def _leases(configuration: Configuration) -> list[str]:
    if (reach := configuration.reach()) is not None:
        return reach.leases
    return [f"simulated bench {configuration.workspace.benches / configuration.bench.name}"]
