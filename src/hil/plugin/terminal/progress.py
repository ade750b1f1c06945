"""Live progress: one line per event of interest to a person at the bench, and a status line on a terminal."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, TextIO, cast

from rich.console import Console
from rich.text import Text

from hil.clock import wall
from hil.documents.text import fitting, visible
from hil.evidence import events
from hil.evidence.events.codec import plain
from hil.report.live.lines import one_line
from hil.report.live.outlook import Outlook, method_of
from hil.report.live.readings import Readings
from hil.report.numbers import bench_time, duration, limit_text, measured
from hil.report.page.incidents import answered, attached, noted
from hil.report.sentences import in_short

__all__ = ["Progress", "StatusLine", "drawn", "folded"]

_CLEAR = "\r\x1b[2K"
_REFRESH_S = 1.0
_MILESTONE_S = 3600.0
_WIDTH = 80


class StatusLine:
    """Keeps a status line below everything else on a terminal; elsewhere it is a line of its own every hour.

    Args:
        stream: where the line goes.
        text: returns the line's text.
        now: seconds on a monotonic clock.
    """

    def __init__(self, stream: TextIO, text: Callable[[], str], now: Callable[[], float] = wall.monotonic) -> None:
        self._stream = drawn(stream)
        self._text = text
        self._now = now
        self._terminal = _is_terminal(stream)
        self._written = now()
        self._shown = False
        self.quiet = False

    def tick(self) -> None:
        """Write the line, if it is due; failures are ignored."""
        due = self._written + (_REFRESH_S if self._terminal else _MILESTONE_S)
        if self.quiet or self._now() < due:
            return
        self._written = self._now()
        with suppress(OSError, ValueError):
            if self._terminal:
                self._stream.write(f"{_CLEAR}{visible(self._text())[: self._width() - 1]}")
                self._shown = True
            else:
                self._stream.write(f"  still running: {visible(self._text())}\n")
            self._stream.flush()

    def clear(self) -> None:
        """Erase the line, because something else is about to be written there."""
        if self._shown:
            self._shown = False
            with suppress(OSError, ValueError):
                self._stream.write(_CLEAR)

    def _width(self) -> int:
        try:
            return os.get_terminal_size(self._stream.fileno()).columns or _WIDTH
        except (OSError, ValueError):
            return _WIDTH


def _is_terminal(stream: TextIO) -> bool:
    try:
        return stream.isatty() and os.environ.get("TERM") != "dumb"
    except (OSError, ValueError):
        return False


_STYLES = {
    "PASS": "green",
    "RECORDED": "green",
    "FAIL": "bold red",
    "ERROR": "bold red",
    "ABORTED": "bold magenta",
    "INCONCLUSIVE": "yellow",
    "NOT_EVALUATED": "yellow",
    "NOT_RUN": "yellow",
}


class _Console(Console):
    """A console that goes quiet when its reader goes away; a run does not end because a pager did."""

    def on_broken_pipe(self) -> None:
        """Write nothing more."""
        self.quiet = True


class Progress:
    """Writes events as lines; without a terminal they are the same lines without colour.

    On a terminal, a status line shows how far the run is, how long it will take, and what it reads now.

    Args:
        stream: where the lines go.
        verbose: whether steps, effects and gates that hold are shown, too.

    Attributes:
        effects: the kinds of effects that it needs to see: what a case reads gets no line.
    """

    effects: ClassVar[frozenset[str]] = frozenset({"asks", "drives"})

    def __init__(self, stream: TextIO, *, verbose: bool = False) -> None:
        self._console = _Console(file=drawn(stream), highlight=False, soft_wrap=True, emoji=False, markup=False)
        self._verbose = verbose
        self._cases: dict[str, events.PlannedCase] = {}
        self._begun = False
        self._shown_reasons: list[str] = []
        self._tripped = False
        self._left_out: Counter[str] = Counter()
        self._outlook = Outlook()
        self._readings: Readings | None = None
        self._now: Callable[[], float] | None = None
        self._status = StatusLine(stream, self._where)

    def follow(self, folder: Path, now: Callable[[], float]) -> None:
        """Show what the run in this folder reads from now on, and its bench time `now` in s."""
        self._readings, self._now = Readings(folder), now

    def pass_by(self, event: events.Event) -> None:
        """Take an event without showing it, for a run that is joined in progress."""
        self._outlook.take(event)
        if isinstance(event, events.Planned):
            self._planned(event)
        self._begun = self._begun or type(event) is events.Gate

    def tick(self) -> None:
        """Refresh the status line, if it is due."""
        self._status.tick()

    def __call__(self, event: events.Event) -> None:
        """Show one event."""
        self._outlook.take(event)
        show = getattr(self, method_of(type(event)), None)
        if show is not None:
            show(event)

    def _where(self) -> str:
        if self._now is not None:
            self._outlook.at(self._now())
        readings = self._readings.newest(self._outlook) if self._readings else []
        return one_line(self._outlook, readings)

    def _run(self, event: events.Run) -> None:
        dut = event.dut
        self._line(f"plan {', '.join(event.plans)} on bench {event.bench} ({event.source})", "bold")
        self._line(f"DUT {dut.serial}, {dut.title or dut.part}, {dut.model}; purpose {event.purpose}")
        for deviation in event.deviations:
            self._line(f"deviation: {deviation}", "yellow")

    def _planned(self, event: events.Planned) -> None:
        self._cases = {case.case: case for case in event.cases}

    def _orphan(self, event: events.Orphan) -> None:
        for case in event.cases:
            self._line(f"{_short(case)} carries no requirement", "yellow")

    def _gate(self, event: events.Gate) -> None:
        self._begun = True
        if self._verbose or not event.ok:
            self._line(f"  {'ok  ' if event.ok else 'NOT OK'} {event.name}: {event.detail}", _good(event.ok))

    def _host_gate(self, event: events.HostGate) -> None:
        if event.name == event.GUARDIANS_PROOF and not event.ok:  # `safe-end` has just reported every line as proven
            self._not_safe(event.detail)
        else:
            self._gate(event)

    def _called(self, event: events.Called) -> None:
        self._line(f"  {event.text}", "bold")

    def _reached(self, event: events.Reached) -> None:
        self._line(f"  {event.by} gave {'the code' if event.ok else 'a wrong code'} back", _good(event.ok))

    def _armed(self, _: events.Event) -> None:
        self._line("armed: every readiness gate passed", "green")

    def _case(self, event: events.Case) -> None:
        self._shown_reasons = []
        title = planned.title if (planned := self._cases.get(event.case)) else ""
        self._line("")
        self._line(f"[{self._outlook.ended + 1}/{len(self._cases)}] {_short(event.case)}  {title}", "bold")

    def _step(self, event: events.Step) -> None:
        depth = len(event.path) - 1
        if self._verbose or depth == 0:
            self._line(f"  {bench_time(event.t)}  {'  ' * depth}{event.number} {event.path[-1]}", "dim")

    def _effect(self, event: events.Effect) -> None:
        self._status.quiet = False
        if self._verbose and event.effect == "drives":
            arguments = ", ".join(f"{key}={value}" for key, value in event.arguments.items())
            self._line(f"                {event.name}({arguments})", "dim")

    def _question(self, _: events.Event) -> None:
        """Leave the terminal to the person who answers."""
        self._status.clear()
        self._status.quiet = True

    _asked_again = _question

    def _confirmed(self, event: events.Confirmed) -> None:
        self._status.quiet = False
        self._line(f"  confirmed again {event.name}: {answered(event.value)} ({event.by})")

    def _answer(self, event: events.Answer) -> None:
        seen = f", witnessed by {event.witness}" if event.witness else ""
        self._line(f"  answered {event.name}: {answered(event.value)} ({event.by}{seen})")

    def _check(self, event: events.Check) -> None:
        of = f" of {event.of}" if event.of else ""
        value = measured(event.value, event.expanded, event.unit)
        limit = limit_text(plain(event.limit), event.limit_unit)
        reason = f"  {event.reason}" if event.reason else ""
        self._shown_reasons.append(f"{event.requirement} {event.parameter}{of} is {event.verdict}: ")
        asked = f"({limit})  " if limit else ""
        text = Text(visible(f"  {event.requirement} {event.parameter}{of} = {value}  {asked}"))
        text.append(event.verdict, _STYLES[event.verdict])
        text.append(visible(reason))
        self._print(text)

    def _fault(self, event: events.Fault) -> None:
        whose = "undecided" if event.undecided else f"{'DUT' if event.dut else 'bench'} fault"
        self._line(f"  {whose}, {event.message}", "bold red")
        if event.hint:
            self._line(f"    {event.hint}")

    def _trip(self, event: events.Trip) -> None:
        self._tripped = True
        self._shown_reasons.append(event.text)
        self._line(f"  TRIP {event.limit}: {event.text}", "bold red")

    def _lost(self, event: events.Lost) -> None:
        self._line(f"  LOST: {event.text}; the bench is made safe, and the run can be resumed", "bold red")

    def _case_end(self, event: events.CaseEnd) -> None:
        self._tripped = False
        text = Text("  ")
        text.append(event.verdict, _STYLES[event.verdict])
        text.append(f"  {duration(event.duration)} of bench time")
        self._print(text)
        for reason in in_short(event.verdict, event.reasons):
            if not reason.startswith(tuple(self._shown_reasons)):  # already shown with its check
                self._line(f"    {reason}")

    def _not_run(self, event: events.NotRun) -> None:
        """Show the first case of each reason; the closing block names them all."""
        self._left_out[event.reason] += 1
        if self._left_out[event.reason] == 1:
            self._line(f"{_short(event.case)} NOT_RUN: {event.reason}", "yellow")
        elif self._left_out[event.reason] == 2:
            self._line("further cases are NOT_RUN for the same reason", "yellow")

    def _stop(self, event: events.Stop) -> None:
        self._line(f"stopped by {event.reason}", "bold magenta")

    def _hold(self, event: events.Hold) -> None:
        self._line(f"  HELD: {noted(event.text, event.by)}", "bold yellow")

    def _hold_end(self, event: events.HoldEnd) -> None:
        self._line(
            f"  hold {event.how}: {noted(event.text, event.by)}" if event.how == "released" else "  hold ended",
            "yellow",
        )

    def _hold_refused(self, event: events.HoldRefused) -> None:
        self._line(f"  hold refused: {noted(event.text, event.by)}", "yellow")

    def _note(self, event: events.Note) -> None:
        self._line(f"  note: {noted(event.text, event.by)}")

    def _attachment(self, event: events.Attachment) -> None:
        self._line(f"  attachment: {attached(event.file, event.text, event.by)}")

    def _anomaly(self, event: events.Anomaly) -> None:
        if self._verbose or self._begun:  # before the first gate they concern the catalogue's sources
            self._line(f"  anomaly: {event.text}", "yellow")

    def _safe(self, event: events.Safe) -> None:
        if self._verbose or not event.ok:
            word = "safe" if event.ok else "NOT SAFE"
            self._line(f"  {word}: {event.output} {event.state}, {event.detail}", _good(event.ok))

    def _safe_end(self, event: events.SafeEnd) -> None:
        tripped, self._tripped = self._tripped, False
        if tripped and event.ok:  # the end of the run reports it again, for every output
            self._line("  made safe, and kept safe for the rest of the run", "green")
            return
        self._line("")
        if event.ok:
            self._line("bench safe: every output proven", "green")
        else:
            self._not_safe("see NOT SAFE above")

    def _not_safe(self, which: str) -> None:
        self._line(f"THE BENCH COULD NOT BE PROVEN SAFE: {which}", "bold red")
        self._line("go to the bench, and switch off by hand what is on", "bold")

    def _line(self, text: str, style: str = "") -> None:
        self._print(Text(visible(text), style))

    def _print(self, text: Text) -> None:
        self._status.clear()
        for line in folded(text, self._console.width if self._console.is_terminal else 0):
            self._console.print(line)


def folded(text: Text, width: int) -> list[Text]:
    """Return a line wrapped to the terminal's width as `fitting` breaks it, with its colours."""
    lines, at = [], 0
    for piece in fitting([text.plain], width):
        words = piece.lstrip()
        begin = text.plain.index(words, at)
        at = begin + len(words)
        lines.append(Text(piece[: len(piece) - len(words)]) + text[begin:at])
    return lines


def drawn(stream: TextIO) -> TextIO:
    """Return the stream to draw on: one that escapes control characters keeps another one for that."""
    return cast("TextIO", getattr(stream, "drawn", stream))


def _short(case: str) -> str:
    return case.rpartition("::")[2]


def _good(ok: bool) -> str:
    return "green" if ok else "bold red"
