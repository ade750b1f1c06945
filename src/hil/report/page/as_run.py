"""Where each event of a run belongs, and its checks and recordings written out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from hil.evidence.events import (
    Bounds,
    Case,
    Channel,
    Check,
    Event,
    Fed,
    Recording,
    RecordingEnd,
    Rows,
    Step,
    StepEnd,
)
from hil.model.verdict import Verdict
from hil.report.numbers import duration, limit_text, measured, number, quantity
from hil.report.page.view import CaseName, CheckRow, RecordingRow

__all__ = [
    "Placed",
    "attributed",
    "check_row",
    "checks_of",
    "derived_from",
    "fed_limits",
    "ids",
    "limit_of",
    "recording_rows",
    "watched_rows",
]


@dataclass(frozen=True, slots=True)
class Placed:
    """An event with the case and the step that it belongs to, empty where it belongs to none.

    Attributes:
        event: the event.
        case: its case.
        step: the number of its step; of a step itself its own.
        tried: which attempt it is of, None where the case was tried once.
        counted: whether it is of the last attempt.
    """

    event: Event
    case: str = ""
    step: str = ""
    tried: int | None = None
    counted: bool = True

    @property
    def attempt(self) -> str:
        """The attempt in words, empty where the case was tried once."""
        return "" if self.tried is None else str(self.tried)


def attributed(events: Iterable[Event]) -> list[Placed]:
    """Return the events with case, step and attempt; events about a recording are placed with the recording."""
    owners: dict[str, tuple[str, str]] = {}
    attempts: Counter[str] = Counter()
    placed: list[Placed] = []
    for event in events:
        case, step = _place(event, owners)
        if isinstance(event, Recording):
            owners[event.recording] = case, step
        attempts[case] += isinstance(event, Case)
        placed.append(Placed(event, case, step, attempts[case]))
    return [
        replace(each, tried=each.tried if attempts[each.case] > 1 else None, counted=each.tried == attempts[each.case])
        for each in placed
    ]


def _place(event: Event, owners: Mapping[str, tuple[str, str]]) -> tuple[str, str]:
    if isinstance(event, Rows | RecordingEnd):
        return owners.get(event.recording, ("", ""))
    step = event.number if isinstance(event, Step | StepEnd) else getattr(event, "step", None)
    return getattr(event, "case", None) or "", step or ""


def checks_of(events: Iterable[Placed], names: Mapping[str, CaseName]) -> tuple[CheckRow, ...]:
    """Return every check among the events, with the case that it belongs to by name."""
    return tuple(
        check_row(each.event, names.get(each.case), each.attempt) for each in events if isinstance(each.event, Check)
    )


def check_row(check: Check, named: CaseName | None = None, attempt: str = "") -> CheckRow:
    """Return the table row of one check."""
    expanded = check.expanded if check.limit_unit in {"", check.unit} else None
    limit = limit_of(check)
    return CheckRow(
        case=check.case,
        named=named,
        step=check.step,
        attempt=attempt,
        requirement=check.requirement,
        parameter=check.parameter,
        of=check.of or "",
        at=check.at or check.of or "",
        value=measured(check.value, expanded, check.unit),
        coverage=_coverage(check),
        limit=limit,
        margin=_signed(check.margin, check.limit_unit),
        tur=_ratio(check),
        decision=check.decision if limit else "",
        verdict=check.verdict,
        reason=check.reason,
        instruments=", ".join(check.instruments),
        derived_from=derived_from(check.provenance or ()),
        closes_nothing=check.closes_nothing,
    )


def derived_from(names: Iterable[str]) -> str:
    """Return what a value comes from; a recording once, with its channels in brackets."""
    channels: dict[str, list[str]] = {}
    for name in names:
        head, _, channel = name.partition(", ") if name.startswith("recording ") else (name, "", "")
        named = channels.setdefault(head, [])
        if channel and channel not in named:
            named.append(channel)
    return ", ".join(f"{name} ({', '.join(named)})" if named else name for name, named in channels.items())


def _ratio(check: Check) -> str:
    """Return the test uncertainty ratio; it is unknown for a value that is not a number, whatever was recorded."""
    if check.value is None:
        return "not known" if check.limit.min is not None and check.limit.max is not None else ""
    return "" if check.tur is None else number(check.tur, 2)


def limit_of(check: Check) -> str:
    """Return the limit of a check in words and signs, empty where it has none."""
    return limit_text(_bounds(check.limit), check.limit_unit)


def _bounds(limit: Bounds) -> Mapping[str, object]:
    return {"min": limit.min, "max": limit.max, "equals": limit.equals}


def recording_rows(events: Sequence[Placed]) -> tuple[RecordingRow, ...]:
    """Return the recordings among the events in the order in which they began; alike ones of one case share a row."""
    ends = {each.event.recording: each.event for each in events if isinstance(each.event, RecordingEnd)}
    begun = {each.event.recording: each.event for each in events if isinstance(each.event, Recording)}
    alike: dict[object, list[RecordingRow]] = {}
    for name, event in begun.items():
        row = _recording(event, ends.get(name))
        same = (event.case, row.name, row.channels, row.rate, row.duration, row.rows, row.whole, row.source)
        alike.setdefault(same, []).append(row)
    return tuple(_merged(rows, ends) for rows in alike.values())


def watched_rows(events: Sequence[Placed]) -> tuple[RecordingRow, ...]:
    """Return the recordings of the envelope's own readings; where a limit was judged on rows, they have no gap."""
    fed = {each.event.limit for each in events if isinstance(each.event, Fed)}
    rows = recording_rows([each for each in events if not each.case])
    return tuple(replace(row, gap="judged on rows") if row.name in fed else row for row in rows)


def fed_limits(events: Iterable[Placed]) -> tuple[str, ...]:
    """Return a sentence for limits of the envelope that recordings fed: they were judged on rows, not by readings."""
    fed: dict[str, list[str]] = {}
    for each in events:
        if isinstance(each.event, Fed):
            fed.setdefault(each.event.limit, []).append(each.event.recording)
    alike: dict[tuple[str, ...], list[str]] = {}
    for limit, names in fed.items():
        alike.setdefault(tuple(names), []).append(limit)
    return tuple(
        f"{', '.join(limits)} {'were' if len(limits) > 1 else 'was'} judged on every row of"
        f" recording{'s' * (len(names) > 1)} {ids(names)}; {'they were' if len(limits) > 1 else 'it was'} not"
        " read separately while rows arrived in time."
        for names, limits in alike.items()
    )


def _merged(rows: Sequence[RecordingRow], ends: Mapping[str, RecordingEnd]) -> RecordingRow:
    """Return one row for recordings that are alike but for their number and their largest gap."""
    if len(rows) == 1:
        return rows[0]
    gaps = [ends[row.id].gaps for row in rows if row.id in ends]
    low, high = (duration(end(gaps, default=None)) for end in (min, max))
    gap = low if low == high else f"{low} to {high}"
    names = tuple(row.id for row in rows)
    return replace(rows[0], id=ids(names), ids=names, count=len(rows), gap=gap)


def ids(ids: Sequence[str]) -> str:
    """Return ids that differ by their number as ranges of it: `003 to 007, 009-field`; any others one by one."""
    parts = [identifier.partition("-") for identifier in ids]
    if len({rest for _, _, rest in parts}) > 1 or not all(number_.isdecimal() for number_, _, _ in parts):
        return ", ".join(ids)
    ranges: list[list[str]] = []
    for number_, _, _ in parts:
        if ranges and int(number_) == int(ranges[-1][-1]) + 1:
            ranges[-1] = [ranges[-1][0], number_]
        else:
            ranges.append([number_])
    return f"{', '.join(' to '.join(ends) for ends in ranges)}-{parts[0][2]}"


def _coverage(check: Check) -> str:
    """Return a remark on the uncertainty: its size in the limit's unit, or that it is unknown."""
    if not isinstance(check.value, int | float):
        return ""
    if check.uncertainty is None and check.expanded is None:
        of_recording = check.verdict is Verdict.RECORDED and limit_of(check)
        return "" if of_recording else "uncertainty not recorded"  # a length or a rate is counted, not measured
    if check.expanded is not None and check.limit_unit not in {"", check.unit}:
        return f"U = {quantity(check.expanded, check.limit_unit, 2)}"
    return ""


def _signed(margin: float | None, unit: str) -> str:
    """Return a margin with its sign; that of a temperature is a difference, in K."""
    if margin is None:
        return ""
    shown = quantity(margin, "K" if unit in {"degC", "°C"} else unit, 3)
    return f"+{shown}" if margin > 0 else shown


def _recording(begin: Recording, end: RecordingEnd | None) -> RecordingRow:
    return RecordingRow(
        id=begin.recording,
        name=begin.name,
        count=1,
        channels=_channels(begin.channels),
        rate=quantity(begin.rate, "Hz"),
        duration=duration(begin.duration),
        rows=f"{end.rows:,}".replace(",", " ") if end else "",
        gap=duration(end.gaps) if end else "",
        whole="not ended" if end is None else "complete" if end.complete else "incomplete",
        source=begin.source,
        ids=(begin.recording,),
    )


def _channels(channels: Sequence[Channel]) -> str:
    """Return the channels by unit and instrument: `x, y, z [uT], temperature [degC] from mag1`."""
    by_instrument: dict[str | None, dict[str, list[str]]] = {}
    for channel in channels:
        by_instrument.setdefault(channel.instrument, {}).setdefault(channel.unit, []).append(channel.name)
    return "; ".join(
        ", ".join(f"{', '.join(names)}{f' [{unit}]' if unit not in {'', '1'} else ''}" for unit, names in units.items())
        + (f" from {instrument}" if instrument else "")
        for instrument, units in by_instrument.items()
    )
