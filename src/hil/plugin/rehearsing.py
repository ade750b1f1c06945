"""Runs whose package is discarded: the procedure of plans, and the replay of a package."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hil.bench.binding import bind_replayed
from hil.evidence.events import Effect
from hil.evidence.folder import TRANSCRIPT
from hil.evidence.package.contents import Package
from hil.evidence.results.outcome import CaseOutcome
from hil.executive.people.answers import Recorded
from hil.executive.resuming.beginnings import ReplayedRun
from hil.executive.resuming.replaying import STOPPED, as_packed, differences, replay_request, unpack
from hil.executive.session import Session
from hil.executive.setup.configuration import Configuration, Request, configure
from hil.executive.setup.head import PlannedCase
from hil.model.errors import ConfigurationError, Finding, Refused
from hil.model.verdict import Verdict
from hil.plugin.campaign import Opener
from hil.plugin.launch import launch
from hil.plugin.opening import open_new
from hil.report.material import Material, requirement_entries
from hil.report.procedure import procedure_lines
from hil.wire.transcript import damaged_lines

__all__ = ["Replayed", "procedure", "replay"]

_NO_CASES = 5


@dataclass(frozen=True, slots=True)
class Replayed:
    """Result of a replay.

    Attributes:
        cases: how many cases were compared.
        checks: how many checks they have.
        differences: every difference, in a sentence, up to the one where a case left the record.
        following: how many more differed after that.
        broken_off: how many cases of the record were cut short by a stop, which are not compared.
        never_ran: how many cases of the record never ran.
        of_numbers: how many of the differences are of a value or uncertainty only.
    """

    cases: int
    checks: int
    differences: tuple[str, ...]
    following: int = 0
    broken_off: int = 0
    never_ran: int = 0
    of_numbers: int = 0

    @property
    def same_verdicts(self) -> bool:
        """Whether nothing but numbers of checks differs, so that every verdict was reproduced."""
        return bool(self.cases) and not self.following and len(self.differences) == self.of_numbers


def procedure(request: Request) -> list[str]:
    """Return the procedure of plans: whole cases, run on the simulated bench."""
    with tempfile.TemporaryDirectory(prefix="hil-plan-") as folder:
        configuration = configure(replace(request, output=Path(folder)))
        material = Material(Package(_rehearsed(configuration, open_new).folder))
        return procedure_lines(material.events(), requirement_entries(material))


def replay(package: Package) -> Replayed:
    """Run the cases of a package again on its recorded bytes, and compare.

    Raises:
        ConfigurationError: for files of the package that prevent a replay, by their paths in it.
    """
    if damaged := tuple(damaged_lines(package.transcript_path)):
        raise ConfigurationError(tuple(Finding(TRANSCRIPT, line, 1, message) for line, message in damaged))
    with tempfile.TemporaryDirectory(prefix="hil-replay-") as folder:
        root, output = Path(folder) / "workspace", Path(folder) / "reports"
        root.mkdir()
        unpack(package, root.resolve())
        try:
            configuration = configure(replay_request(package, root.resolve(), output))
        except ConfigurationError as error:
            raise as_packed(package, error) from error
        again = _rehearsed(configuration, partial(_open_replayed, package=package))
        results = package.outcome()
        found, following, of_numbers = differences(package, Package(again.folder))
        if not following and again.bench.playback and not again.bench.playback.exhausted and not package.cut_short:
            found += ("the record holds more operations than the cases asked for",)
        compared = [case for case in results.cases if case.verdict not in STOPPED or _ended(case, package)]
        verdicts = Counter(case.verdict for case in results.cases if case not in compared)
        return Replayed(
            len(compared),
            sum(len(case.checks) for case in compared),
            found,
            following,
            broken_off=verdicts[Verdict.ABORTED],
            never_ran=verdicts[Verdict.NOT_RUN],
            of_numbers=of_numbers,
        )


def _ended(case: CaseOutcome, package: Package) -> bool:
    """Return whether a case is ABORTED only because of an earlier attempt, and its last one was completed."""
    return case.verdict is Verdict.ABORTED and not package.cut_short and any(each.read for each in case.attempts)


def _rehearsed(configuration: Configuration, opener: Opener) -> Session:
    launched = launch(configuration, opener)
    if launched.session is None:
        why = "no cases were found in these plans" if launched.code == _NO_CASES else "no case could be run"
        raise Refused(why, "cases are functions test_* in files test_*.py")
    launched.session.abandon()
    return launched.session


def _open_replayed(configuration: Configuration, planned: Sequence[PlannedCase], package: Package) -> Session:
    record, run = package.transcript_path, package.state.run
    live = run.live if run else None
    speed = live.speed if live else 1.0
    return Session(
        configuration,
        planned,
        binder=lambda transcript, where: bind_replayed(
            configuration.bench, transcript, record, where, outside=bool(live), speed=speed
        ),
        answers=lambda *_: Recorded(package.of(Effect)),
        beginning=ReplayedRun(package),
    )
