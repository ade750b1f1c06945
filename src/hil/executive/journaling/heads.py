"""Heads of the running journal in the ledger, outside the package: what is entered there cannot be cut off later."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from hil.clock import wall
from hil.evidence import events
from hil.evidence.journal.clocks import DOUBT
from hil.evidence.journal.writer import Journal
from hil.evidence.ledger.book import append, read
from hil.evidence.ledger.entries import Head, set_back
from hil.model.errors import EvidenceError
from hil.model.verdict import Verdict

__all__ = ["Heads"]

_APART_S = 1.0
"""Interval between heads for good checks; the next event enters what is pending."""

_LEARNS = frozenset({"asks", "reads", "records"})
_OTHERS = (
    events.Case,
    events.CaseEnd,
    events.Check,
    events.Effect,
    events.Lost,
    events.Recording,
    events.Step,
)
"""Irrevocable kinds of events besides plan and stop, and kinds that begin something."""


class Heads:
    """Enters the head of a run's journal in the ledger at every irrevocable event.

    These are the plan, the first reading of an attempt, every check, the end of a case, a loss, a stop. The journal up
    to there is on disk first: after a power cut it holds all that the ledger has seen. For a bench in the process of
    the run, which closes nothing, only plan and stop are entered.

    Args:
        folder: the run's folder; the ledger is beside it.
        journal: its journal.
        tell: called once if the ledger cannot be written; the run continues.
        source: where the run's bytes come from.
        all_of_them: whether more than plan and stop are entered.

    Attributes:
        hears: the kinds of events that it needs.
    """

    def __init__(
        self, folder: Path, journal: Journal, tell: Callable[[str], None], *, source: str, all_of_them: bool
    ) -> None:
        self._folder = folder
        self._journal = journal
        self._tell = tell
        self._source = source
        self._all = all_of_them
        self.hears: tuple[type[events.Event], ...] = (events.Planned, events.Stop, *(_OTHERS if all_of_them else ()))
        self._learnt = self._reported = self._waits = False
        self._entered = journal.count
        self._last = -_APART_S

    def __call__(self, event: events.Event) -> None:
        """Enter the head, if this event is new and irrevocable; retraced events are known already."""
        if self._journal.count <= self._entered:
            return
        if isinstance(event, events.Planned | events.Stop):
            self._enter(event)
            if isinstance(event, events.Planned) and self._all:
                self._report_clock()
        elif self._all and self._counts(event):
            patient = isinstance(event, events.Check) and event.verdict in {Verdict.PASS, Verdict.RECORDED}
            if patient and wall.monotonic() - self._last < _APART_S:
                self._waits = True
            else:
                self._enter(event)
        elif self._waits and wall.monotonic() - self._last >= _APART_S:
            self._enter(event)

    def _counts(self, event: events.Event) -> bool:
        """Return whether an event is irrevocable; of a case's readings, the first of an attempt is enough."""
        match event:
            case events.Case() | events.Step():
                if isinstance(event, events.Case) or event.turn is not None:
                    self._learnt = False
                return False
            case events.Effect() | events.Recording():
                learns = isinstance(event, events.Recording) or (event.effect in _LEARNS and not event.raised)
                first, self._learnt = learns and not self._learnt, self._learnt or learns
                return first
        return True

    def _report_clock(self) -> None:
        """Report if the ledger already has an entry of a later time: the run then closes nothing."""
        with suppress(EvidenceError):  # already reported by the entry before
            ledger = read(self._folder.parent)
            if ledger.entries and (why := set_back(ledger.entries).get(ledger.entries[-1].seq)):
                self._tell(f"{DOUBT}the times of this run cannot be believed: {why}")

    def _enter(self, event: events.Event) -> None:
        state = "INTERRUPTED" if isinstance(event, events.Stop) else "RUNNING"
        self._waits, self._last, self._entered = False, wall.monotonic(), self._journal.count
        try:
            self._journal.sync()
            seen = Head(
                run=self._folder.name,
                events=self._journal.count,
                sha256=self._journal.head,
                state=state,
                source=self._source,
            )
            append(self._folder.parent, seen)
        except (OSError, EvidenceError) as error:
            if not self._reported:
                self._reported = True
                self._tell(f"the ledger does not know how far this run came: {error}")
