"""A finished recording: as a case sees it, and the criteria it must meet if a requirement asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

from hil.clock.port import NANOSECONDS
from hil.evidence import events
from hil.evidence.recordings.hdf5 import Recorded
from hil.evidence.results.outcome import CHANNELS
from hil.executive.watching.sharing import Course
from hil.instruments.sampled import StreamReport
from hil.model.figure import Figure, FigureStatus
from hil.model.provenance import Number, Provenance, merged, stamped
from hil.requirements.requirement import Decision, Limit, Records

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "UNDISTURBED",
    "Criterion",
    "Disturbance",
    "Recording",
    "clipped",
    "data_checks",
    "delayed_before",
    "provenance_of",
    "recorded_as",
]


class Recording:
    """A finished recording, as a case sees it.

    Attributes:
        id: its id in the run.
        rate: nominal samples per second.
        stream: the stream's statistics, None if the samples were taken one by one.
        capture: how an instrument captured it, around its trigger; None for any other recording.
        provenance: of all channels together; each channel has its own.
    """

    def __init__(
        self,
        recorded: Recorded,
        uncertainties: Mapping[str, float | None],
        provenances: Mapping[str, Provenance],
        stream: StreamReport | None = None,
        voids: Sequence[events.Voided] = (),
        facts: events.Recording | None = None,
    ) -> None:
        self._recorded = recorded
        self._voids = voids
        self._uncertainties = uncertainties
        self.id = recorded.id
        self.rate = recorded.rate
        self._provenances = provenances
        self.provenance = merged(*provenances.values()) or Provenance()
        self._times = Provenance(instruments=self.provenance.instruments, sources=(f"recording {recorded.name}",))
        self.capture = facts and facts.capture
        self._steps = {each.name: each.resolution for each in facts.channels} if facts else {}
        self.stream = stream and cast("StreamReport", stamped(stream, self._times))

    @property
    def time(self) -> NDArray[np.float64]:
        """Bench time of every sample in s, for a capture the time after its trigger, shape (samples,); read-only."""
        return _known(_read_only(self._recorded.time), self._times)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Which samples stand, shape (samples,): not those of a part that was repeated after the run was stopped."""
        import numpy as np  # noqa: PLC0415 - slow to import

        stands = np.ones(len(self), dtype=bool)
        for part in self._voids:
            stands[part.first : part.end] = False
        return stands

    def __getitem__(self, channel: str) -> NDArray[np.float64]:
        """Return one channel, shape (samples,), read-only; copy it to modify it."""
        return _known(_read_only(self._recorded[channel]), self._provenances[channel])

    def __len__(self) -> int:
        return len(self._recorded)

    def part(self, first: int, end: int) -> dict[str, NDArray[np.float64]]:
        """Return `time` and every channel for the samples from `first` to before `end`, without loading the others."""
        part = self._recorded.part(first, end)
        return {name: _known(part[name], self._provenances.get(name, self._times)) for name in part}

    def unit(self, channel: str) -> str:
        """Return the unit of one channel."""
        return self._recorded.unit(channel)

    def uncertainty(self, channel: str) -> float | None:
        """Return the standard uncertainty of this channel by its certificate, None if unknown."""
        found = self._uncertainties[channel]
        return None if found is None else Number(found, self._provenances[channel].of_difference())

    def resolution(self, channel: str) -> float | None:
        """Return the step of the converter behind one channel of a capture, None for any other recording."""
        found = self._steps.get(channel)
        return None if found is None else Number(found, self._provenances[channel].of_difference())


def _known(array: NDArray[np.float64], provenance: Provenance) -> NDArray[np.float64]:
    from hil.analysis.tracing import samples  # noqa: PLC0415 - slow to import

    return samples(array, provenance)


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the array read-only: a requirement's criteria evaluate the same numbers at the case's end."""
    view = array.view()
    view.flags.writeable = False
    return view


def clipped(facts: events.Recording, recorded: Recorded) -> dict[str, str]:
    """Return a sentence for every channel of a capture whose samples reach an end of its instrument's range."""
    found: dict[str, str] = {}
    for channel in facts.channels:
        if channel.low is None or channel.high is None or channel.name not in recorded.channels:
            continue
        half = (channel.resolution or 0.0) / 2
        below = int((recorded[channel.name] <= channel.low + half).sum())
        above = int((recorded[channel.name] >= channel.high - half).sum())
        if below or above:
            found[channel.name] = (
                f"{channel.name} of {channel.instrument} is clipped: {below + above} of {len(recorded)} samples are at"
                f" the ends of {channel.low:.6g} to {channel.high:.6g} {channel.unit}"
            )
    return found


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Disturbance of a recording's times by the executive, the bench or the computer.

    Attributes:
        course: how its samples were taken, None for a stream.
        dut: whether the device under test was sampled, so that the time it takes is its own.
        told: for a stream, why rows may have been lost on the way, a sentence; empty if none can have been. For
            samples, what is reported instead of the course.
    """

    course: Course | None = None
    dut: bool = False
    told: str = ""

    @property
    def without_s(self) -> float | None:
        """Sampling interval in s without the disturbance, 0 if unknown; None if there was none."""
        if self.course is None:
            return 0.0 if self.told else None
        return self.course.undisturbed_ns(own=self.dut) / NANOSECONDS

    @property
    def why(self) -> str:
        """The disturbance, as a sentence without a full stop."""
        return self.told or (self.course.cause if self.course else "")


UNDISTURBED = Disturbance()


def delayed_before(recorded: Recorded, voids: Sequence[events.Voided]) -> str:
    """Return a sentence about the largest gap of a continued recording, if it is from before its run was stopped.

    The process that took those samples is gone, and with it the record of their course.
    """
    stops = [part.first for part in voids if 0 < part.first < len(recorded)]
    if not stops:
        return ""
    gaps = recorded.time[1:] - recorded.time[:-1]
    gaps[[row - 1 for row in stops]] = 0.0
    row, last = int(gaps.argmax()) + 1, max(stops)
    late_s = float(gaps[row - 1]) - 1 / recorded.rate
    if row > last or late_s <= 0:
        return ""
    return (
        f"the run was stopped after sample {last} and resumed; what delayed sample {row + 1} by {late_s * 1e3:.4g} ms"
        " before that is not known"
    )


Criterion = tuple[Limit, Figure | str, str]
"""A limit, the value found, and a reason if that says more than the two; otherwise empty."""


def recorded_as(records: Records, taken: Sequence[Mapping[str, object]]) -> list[Mapping[str, object]]:
    """Return the recordings with the name that a requirement asks for."""
    return [item for item in taken if cast("events.Recording", item["facts"]).name == records.recording]


def provenance_of(records: Records, named: Sequence[Mapping[str, object]]) -> Provenance | None:
    """Return the provenance of the channels that a requirement asks for, over all recordings of that name."""
    of_each = [cast("Mapping[str, Provenance]", item["provenances"]) for item in named]
    return merged(*(each[channel] for each in of_each for channel in records.channels if channel in each))


def data_checks(records: Records, taken: Sequence[Mapping[str, object]]) -> Iterator[Criterion]:
    """Yield every criterion of a recording with the value found; the worst recording of that name counts.

    Samples that are not finite are counted over all recordings, and leave the requirement INCONCLUSIVE.

    A recording that was never taken yields nothing, so that its requirement stays NOT_EVALUATED.
    """
    named = recorded_as(records, taken)
    if not named:
        return
    found = [cast("Recorded", item["recorded"]) for item in named]
    missing = sorted({channel for item in found for channel in records.channels if channel not in item.channels})
    has = ", ".join(dict.fromkeys(channel for item in found for channel in item.channels))
    yield _word(CHANNELS, "complete"), f"without {', '.join(missing)}; it has {has}" if missing else "complete", ""
    if not all(item.complete for item in found):
        yield _word("end", "complete"), "incomplete", ""
    yield from _not_finite(records, found)
    yield from _clipped(records, named)
    ends = [_ends_of_voids(item) for item in named]
    spans = [_span(item, without) for item, without in zip(found, ends, strict=True)]
    if records.duration_s is not None:
        lasts = [_lasts(item, span) for item, span in zip(found, spans, strict=True)]
        yield _at_least("duration", records.duration_s, "s"), _exact(min(lasts), "s"), ""
    if records.rate_hz is not None:
        limit = _at_least("rate", records.rate_hz * (1 - _RATE_TOLERANCE), "Hz")
        rates = [_rate(item, span) for item, span in zip(found, spans, strict=True)]
        yield _poorest(limit, "Hz", rates, named)
    if records.max_gap_s is not None:
        limit = _at_most("max_gap", records.max_gap_s, "s")
        gaps = [_gap(item, without) for item, without in zip(found, ends, strict=True)]
        yield _poorest(limit, "s", gaps, named)
        yield from _stopped(records.max_gap_s, found, ends)


def _poorest(limit: Limit, unit: str, values: Sequence[float], named: Sequence[Mapping[str, object]]) -> Criterion:
    """Return the criterion for the recording that meets it worst; an excused one does not hide one that is not."""
    judged = [_excused(limit, _exact(value, unit), taken) for value, taken in zip(values, named, strict=True)]
    figure, reason = max(judged, key=lambda each: (_fails(limit, each[0]), _beyond(limit, each[0].value)))
    return limit, figure, reason


def _fails(limit: Limit, figure: Figure) -> bool:
    return _beyond(limit, figure.value) > 0 and figure.status is FigureStatus.MEASURED


def _rate(item: Recorded, span: float) -> float:
    return (len(item) - 1) / span if span else 0.0


def _excused(limit: Limit, figure: Figure, taken: Mapping[str, object]) -> tuple[Figure, str]:
    """Return a rate or gap that misses its limit as not observable, with the reason, if the article is not to blame.

    It is not if the criterion would be met without the disturbance of the recording. Rates and gaps have no uncertainty
    of their own: every sample is stamped on arrival, so that the usual latency cancels out in differences, and an
    unusual one is a disturbance.
    """
    disturbance = cast("Disturbance", taken.get("disturbance", UNDISTURBED))
    if _beyond(limit, figure.value) <= 0:
        return figure, ""
    apart_s = disturbance.without_s
    if apart_s is None or (apart_s and _beyond(limit, apart_s if figure.unit == "s" else 1 / apart_s) > 0):
        return figure, ""
    return replace(figure, status=FigureStatus.NOT_OBSERVABLE), disturbance.why


def _beyond(limit: Limit, value: float) -> float:
    """Return by how much a value is beyond a one-sided limit; not above zero if it meets it."""
    return float(limit.minimum) - value if limit.minimum is not None else value - float(limit.maximum or 0)


def _stopped(longest_s: float, found: Sequence[Recorded], ends: Sequence[Sequence[int]]) -> Iterator[Criterion]:
    """Yield the time for which the run was stopped during a recording, if it is longer than the allowed gap.

    What the device did in that time is unknown, and it is not to blame.
    """
    gaps = [float(item.time[end] - item.time[end - 1]) for item, at in zip(found, ends, strict=True) for end in at]
    if gaps and max(gaps) > longest_s:
        figure = Figure(value=round(max(gaps), 9), unit="s", status=FigureStatus.NOT_OBSERVABLE)
        yield (
            _at_most("stopped", longest_s, "s"),
            figure,
            f"the run was stopped during the recording for {max(gaps):g} s",
        )


def _ends_of_voids(taken: Mapping[str, object]) -> list[int]:
    """Return the rows at which a recording continued after its run had been stopped."""
    voids, recorded = cast("Sequence[events.Voided]", taken["voids"]), cast("Recorded", taken["recorded"])
    return [part.end for part in voids if 0 < part.end < len(recorded)]


_RATE_TOLERANCE = 1e-3
"""Tolerance for a slow sampling clock: of its quartz, and for the last sample's latency."""


def _not_finite(records: Records, found: Sequence[Recorded]) -> Iterator[Criterion]:
    """Yield the number of samples that are not numbers, if there are any: their values are unknown."""
    counts = {
        channel: int(sum(_invalid(item[channel]) for item in found if channel in item.channels))
        for channel in records.channels
    }
    counts["time"] = sum(_invalid(item.time) for item in found)
    count = sum(counts.values())
    if count:
        samples = sum(len(item) for item in found for channel in records.channels if channel in item.channels)
        named = ", ".join(f"{channel} {number}" for channel, number in counts.items() if number)
        figure = Figure(value=float(count), unit="1", status=FigureStatus.NOT_OBSERVABLE)
        yield _at_most("not_finite", 0, "1"), figure, f"{count} of {samples} samples are not finite: {named}"


def _clipped(records: Records, named: Sequence[Mapping[str, object]]) -> Iterator[Criterion]:
    """Yield the number of channels that were clipped, if there are any: their values are unknown."""
    clippings = [clipped(cast("events.Recording", item["facts"]), cast("Recorded", item["recorded"])) for item in named]
    sentences = [each[channel] for each in clippings for channel in records.channels if channel in each]
    if sentences:
        figure = Figure(value=float(len(sentences)), unit="1", status=FigureStatus.NOT_OBSERVABLE)
        yield _at_most("clipped", 0, "1"), figure, "; ".join(sentences)


def _invalid(samples: NDArray[np.float64]) -> int:
    import numpy as np  # noqa: PLC0415 - only recordings pay for it

    return int(np.count_nonzero(~np.isfinite(samples)))


def _lasts(item: Recorded, span: float) -> float:
    """Return a recording's duration in s: the last sample counts for one period, too, a single one for none."""
    return span + 1 / item.rate if len(item) > 1 else 0.0


def _span(item: Recorded, without: Sequence[int]) -> float:
    """Return the time from the first sample to the last, without the gaps before the rows `without`."""
    if not len(item):
        return 0.0
    stopped = sum(item.time[row] - item.time[row - 1] - 1 / item.rate for row in without)
    return float(item.time[-1] - item.time[0] - stopped)


def _gap(item: Recorded, without: Sequence[int]) -> float:
    """Return the largest gap, except those before the rows `without`."""
    gaps = item.time[1:] - item.time[:-1]
    gaps[[row - 1 for row in without]] = 0.0
    return float(gaps.max()) if len(gaps) else 0.0


def _exact(value: float, unit: str) -> Figure:
    return Figure(value=round(value, 9), unit=unit)


def _at_least(parameter: str, minimum: float, unit: str) -> Limit:
    return Limit(parameter=parameter, unit=unit, minimum=f"{minimum:.9g}", decision=Decision.SIMPLE)


def _at_most(parameter: str, maximum: float, unit: str) -> Limit:
    return Limit(parameter=parameter, unit=unit, maximum=f"{maximum:.9g}", decision=Decision.SIMPLE)


def _word(parameter: str, word: str) -> Limit:
    return Limit(parameter=parameter, equals=word, decision=Decision.SIMPLE)
