"""`record`: named channels over time, on disk while they grow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec

from hil.clock.port import FOREVER_NS, NANOSECONDS
from hil.documents.text import name_problem
from hil.evidence import events
from hil.evidence.recordings.hdf5 import Recorded, read_recording
from hil.executive.cases.capturing import Capturing
from hil.executive.cases.certificate import standard_uncertainty, uncovered
from hil.executive.cases.demanded import Demanded
from hil.executive.cases.during import During
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.cases.facade import Facade, RoleSet
from hil.executive.cases.recording import UNDISTURBED, Disturbance, Recording, clipped, delayed_before
from hil.executive.cases.steps import Steps, file_part
from hil.executive.cases.streaming import SampledTurns, StreamTurns
from hil.executive.cases.taking import Taking, fed_by
from hil.executive.journaling.row_store import RowStore
from hil.executive.watching.feeding import Fed
from hil.executive.watching.scheduler import Scheduler
from hil.executive.watching.sharing import Course, Pace, Share, refusal
from hil.instruments.sampled import Frame, Streamed, StreamReport
from hil.model.errors import Misused
from hil.model.identity import Source
from hil.model.provenance import Provenance, RecordedUnit
from hil.requirements.requirement import Requirement
from hil.requirements.units import same

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Recorder"]


class Recorder(OfThisProcess):
    """The `record` fixture of one case.

    Args:
        steps: knows case and step.
        scheduler: lets bench time pass between samples.
        effects: where a recording is recorded as an effect.
        store: opens row files.
        source: where the bench's bytes come from.
        asked: the case's requirements, which may ask for recordings.
    """

    said = "`record`"

    def __init__(
        self,
        steps: Steps,
        scheduler: Scheduler,
        effects: Effects,
        store: RowStore,
        source: Source,
        asked: Sequence[Requirement] = (),
    ) -> None:
        self._steps = steps
        self._scheduler = scheduler
        self._effects = effects
        self._store = store
        self._source = source
        self._demanded = Demanded(asked)
        self._taken: list[Mapping[str, object]] = []
        self._beside: list[Taking] = []

    @property
    def taken(self) -> tuple[Mapping[str, object], ...]:
        """Every finished recording of the case."""
        return tuple(self._taken)

    def __call__(self, name: str, *sources: Facade, duration: float, rate: float, continues: bool = False) -> Recording:
        """Sample roles at `rate` [Hz] for `duration` [s] of bench time.

        Sample k is taken at k / rate after the first, however long earlier samples took. Channels have their names in
        the role, with several roles `role.channel`. A role that samples by itself is streamed, timed by its own clock.

        A run that was stopped during this recording repeats it from its beginning. If it `continues`, the run continues
        it instead, after a gap, until the samples before and after together cover the duration.

        Raises:
            ValueError: for no role, or a duration or rate that is not above zero.
            Misused: for something that is not a role of this case, or a streamed role together with another.
            DeviceFault: if a device falls silent; what was recorded is kept as incomplete.
        """
        self._require(name, sources, duration > 0 and math.isfinite(duration * rate), rate)
        facts = msgspec.structs.replace(self._facts(name, sources, rate, duration), continues=continues)
        arguments: dict[str, object] = {"duration": duration, "rate": rate}
        arguments["channels"] = [channel.name for channel in facts.channels]
        if continues:
            arguments["continues"] = True
        if not (role := _streamed(sources)):
            bus, period_ns = self._scheduler.monitoring.bus, round(NANOSECONDS / rate)
            course = Course(bus, _named(sources), period_ns, "the computer")
            self._effects.perform(f"record.{name}", "records", arguments, lambda: self._sample(facts, sources, course))
            return self._finished(facts, sources, None, Disturbance(course, dut=_of_dut(sources)))
        turns = StreamTurns(sources[0], role, self._scheduler.clock, rate, duration + 0.5 / rate)
        taking = Taking(facts, sources, turns, self._scheduler, self._store)
        self._effects.perform(f"record.{name}", "records", arguments, lambda: self._stream(taking, turns))
        return self.keep(taking)

    def during(self, name: str, *sources: Facade, rate: float) -> During:
        """Record roles at `rate` [Hz] beside what the case does in a `with` block.

        A role that can sample by itself is streamed; others are sampled k / rate after the beginning whenever the case
        lets time pass, and a sample missed because it did not is a gap.

        Raises:
            ValueError: for no role, or a rate that is not above zero.
            Misused: as above, and for a role that is being recorded already; on entering, if rate, gap and maximum ages
                of limits cannot all be met.
        """
        self._require(name, sources, True, rate)
        facts = self._facts(name, sources, rate, None)
        role = _streamed(sources)
        clock = self._scheduler.clock
        turns: StreamTurns | SampledTurns
        if role:
            turns = StreamTurns(sources[0], role, clock, rate)
        else:
            bus, period_ns = self._scheduler.monitoring.bus, round(NANOSECONDS / rate)
            course = Course(bus, _named(sources), period_ns, "the case, which let no turn be taken,", skips=True)
            turns = SampledTurns(sources, clock, rate, course, lambda fed: self._share(facts, sources, None, fed))
        taking = Taking(facts, sources, turns, self._scheduler, self._store)
        self._beside.append(taking)
        return During(taking, self._effects, self._scheduler, self)

    def capture(self, name: str, source: Facade, *, within: float) -> Recording:
        """Wait for the trigger of an armed oscilloscope, and record what it captured.

        The times of the rows count from the trigger, in s. A channel whose samples reach an edge of the screen is
        clipped, and a check of it is INCONCLUSIVE.

        Args:
            name: of the recording.
            source: the role, already armed.
            within: how long to wait for the trigger, and for the samples after it [s].

        Raises:
            NotTriggered: it did not come in time; if a case suppresses that, what it did not check is
                INCONCLUSIVE.
            Misused: for something that is not a role of this case, or cannot capture.
            DeviceFault: the instrument falls silent; what was read is kept as incomplete.
        """
        self._require(name, (source,), within > 0, 1.0)
        if (role := source.captured) is None:
            raise Misused(
                f"record '{name}': {source.wire.name} captures nothing by itself", "use record or its `during`"
            )
        arguments = {"within": within, "channels": [channel.name for channel in role.channels()]}
        capturing = Capturing(name, source, role, self._scheduler, self._store)
        self._effects.perform(
            f"record.{name}", "records", arguments, lambda: capturing.take(within, self._captured_facts)
        )
        return self._finished(capturing.facts, (source,), None)

    def keep(self, taking: Taking) -> Recording:
        """Keep a complete recording for the requirements that ask for it, and return it."""
        turns = taking.turns
        if isinstance(turns, SampledTurns):
            disturbance = Disturbance(turns.course, dut=_of_dut(taking.sources))
        else:
            disturbance = Disturbance(None, told=turns.late)
        return self._finished(taking.facts, taking.sources, taking.report, disturbance)

    def close(self) -> None:
        """End recordings that a case left running, as incomplete."""
        for taking in self._beside:
            taking.end(complete=False)
        self._beside.clear()

    def _require(self, name: str, sources: tuple[Facade, ...], lasts: bool, rate: float) -> None:
        if problem := name_problem(name):
            raise Misused(f"record {name!r}: {problem}", "give it another name")
        if not sources or not (lasts and rate > 0 and math.isfinite(rate)):
            raise ValueError(f"record '{name}': needs a role, and a duration and rate above zero")
        for source in sources:
            self._require_own(name, source)
        if len({source.wire.name for source in sources}) < len(sources):
            raise ValueError(f"record '{name}': one role is given twice")
        if len(sources) > 1 and any(source.alone for source in sources):
            raise Misused(
                f"record '{name}': a role that samples by itself is recorded alone",
                "record the others separately, before, after or in parallel",
            )

    def _facts(self, name: str, sources: tuple[Facade, ...], rate: float, duration: float | None) -> events.Recording:
        channels = _channels(sources)
        for channel in channels:
            if problem := name_problem(channel.name):
                clash = f"record '{name}': channel {channel.name!r} of {channel.instrument}: {problem}"
                raise Misused(clash, "its driver has to give it another name")
        return events.Recording(
            recording=f"{self._store.next_number():03d}-{file_part(self._steps.case)}-{file_part(name)}",
            name=name,
            case=self._steps.case,
            step=self._steps.number,
            channels=channels,
            rate=rate,
            duration=duration,
            source=self._source,
        )

    def _captured_facts(self, name: str, source: Facade, frame: Frame) -> events.Recording:
        """Return the facts of a capture before its first row."""
        facts = self._facts(name, (source,), 1 / frame.interval, frame.rows * frame.interval)
        screens = [{key: getattr(each, key) for key in _OF_SCREEN} for each in frame.screens]
        channels = [
            msgspec.structs.replace(each, **screen) for each, screen in zip(facts.channels, screens, strict=True)
        ]
        capture = events.Capture(
            interval=frame.interval, first=frame.first, channel=frame.channel, level=frame.level, slope=frame.slope
        )
        return msgspec.structs.replace(facts, channels=tuple(channels), capture=capture)

    def _require_own(self, name: str, source: object) -> None:
        """Refuse what is not a role of this case, or is being recorded already: its numbers would have no source."""
        if isinstance(source, RoleSet):
            raise Misused(f"record '{name}': {source!r} is a set of roles", "name one, as in supply.coil")
        if not isinstance(source, Facade) or not source.serves(self._effects):
            what = "belongs to another case" if isinstance(source, Facade) else f"is a {type(source).__name__}"
            raise Misused(f"record '{name}': only roles of this case can be recorded, this {what}", "give its fixture")
        if source.streamed and any(taking.running and source in taking.sources for taking in self._beside):
            raise Misused(
                f"record '{name}': {source.wire.name} is already being recorded", "take its rows from that recording"
            )

    def _stream(self, taking: Taking, turns: StreamTurns) -> str | Mapping[str, object]:
        """Stream from a role until its rows cover the duration; return their hash, and the stream's statistics."""
        taking.begin()
        turns.have(taking.covers_s)
        try:
            self._scheduler.wait_until(FOREVER_NS, lambda: turns.full)
        except BaseException:
            taking.end(complete=False)
            raise
        return taking.end(complete=True)

    def _sample(self, facts: events.Recording, sources: tuple[Facade, ...], course: Course) -> str:
        """Take one sample after the other; return the hash of the rows."""
        scheduler, bus = self._scheduler, self._scheduler.monitoring.bus
        count = max(1, round((facts.duration or 0) * facts.rate))
        fed = fed_by(facts, sources, scheduler)
        share = self._share(facts, sources, count, fed)
        recording = self._store.begin(facts)
        complete, feed, done = False, None, recording.rows.rows
        try:
            if done:  # the run was stopped during it, and the bench rearmed
                share = scheduler.share(replace(share.pace, count=max(1, count - done)), fed)
            feed = scheduler.feed(fed, 1 / facts.rate, facts.recording) if fed else None
            bus.shares.append(share)
            start_ns = scheduler.now_ns() - round(done * NANOSECONDS / facts.rate)
            index = done
            while index < count or (index == count and self._demanded.is_short(facts, recording.rows.covers_s())):
                due_ns = start_ns + round(index * NANOSECONDS / facts.rate)
                scheduler.wait_for_sample(due_ns)
                began_ns = scheduler.now_ns()
                row = [number for source in sources for number in source.sample()]
                now_ns = scheduler.now_ns()
                recording.append((now_ns / NANOSECONDS, *row))
                course.sampled(index, due_ns, began_ns, now_ns)
                share.sampled(index - done, began_ns, now_ns)
                if feed:
                    scheduler.judge(feed, [[now_ns / NANOSECONDS, *row]])
                index += 1
            complete = True
        finally:
            bus.leave(share)
            if feed:
                scheduler.unfeed(feed)
            digest = recording.finish(complete=complete)
        return digest

    def _share(self, facts: events.Recording, sources: tuple[Facade, ...], count: int | None, fed: Fed) -> Share:
        """Return what a recording leaves of the bus for the limits that it does not feed.

        One that was never taken is assumed to need half of its period for a sample.

        Raises:
            Misused: a requirement asks for it, and rate, gap and maximum ages cannot all be met.
        """
        scheduler, source, period_ns = self._scheduler, _named(sources), round(NANOSECONDS / facts.rate)
        sample_ns = scheduler.monitoring.bus.sample_ns(source)
        pace = Pace(
            name=facts.name,
            period_ns=period_ns,
            sample_ns=sample_ns or period_ns // 2,
            count=count,
            gap_ns=self._demanded.gaps_ns.get(facts.name),
            required=facts.name in self._demanded.gaps_ns,
            skips=count is None,
        )
        share = scheduler.share(pace, fed)
        share.known = sample_ns > 0
        self._require_room(sources, pace, fed)
        return share

    def _require_room(self, sources: tuple[Facade, ...], pace: Pace, fed: Fed) -> None:
        """Refuse a recording required by a requirement if rate, gap and maximum ages cannot all be met.

        A device under test that takes too long for its samples is not refused, but judged. A record of a run that
        did not refuse one is replayed as it was.
        """
        timeline, of_own = self._scheduler.timeline, pace.pause_ns <= 0 and _of_dut(sources)
        if not pace.required or of_own or not (timeline.all_share if pace.skips else timeline.shared):
            return
        known_ns = self._scheduler.monitoring.bus.proven_ns(_named(sources))
        monitors = self._scheduler.monitoring.beside(fed) if self._scheduler.watching else ()
        if problem := refusal(replace(pace, sample_ns=known_ns), monitors):
            raise Misused(f"record '{pace.name}': {problem}")

    def _finished(
        self,
        facts: events.Recording,
        sources: tuple[Facade, ...],
        report: StreamReport | None,
        disturbance: Disturbance = UNDISTURBED,
    ) -> Recording:
        recorded = replace(read_recording(self._store.recordings, facts, None), complete=True)
        voids = self._store.voids(facts.recording)
        if facts.continues and disturbance.course:
            disturbance = replace(disturbance, told=delayed_before(recorded, voids))
        uncertainties, provenances = _known(facts, recorded, sources)
        recording = Recording(recorded, uncertainties, provenances, report, voids, facts)
        taken = {
            "facts": facts,
            "recorded": recorded,
            "voids": voids,
            "provenances": provenances,
            "disturbance": disturbance if self._scheduler.timeline.shared else UNDISTURBED,
        }
        self._taken.append(taken)
        return recording


def _channels(sources: tuple[Facade, ...]) -> tuple[events.Channel, ...]:
    return tuple(
        events.Channel(
            name=channel.name if len(sources) == 1 else f"{source.wire.name}.{channel.name}",
            unit=channel.unit,
            instrument=source.instrument.name,
            calibration=source.instrument.calibration.certificate if source.instrument.calibration else "",
            uncertainty=standard_uncertainty(source.instrument.calibration, channel.unit, 0.0),
        )
        for source in sources
        for channel in (source.captured or source.sampled).channels()
    )


def _streamed(sources: Sequence[Facade]) -> Streamed | None:
    """Return the role that streams, None if roles are sampled."""
    return sources[0].streamed if len(sources) == 1 else None


def _named(sources: Sequence[Facade]) -> str:
    return " and ".join(source.wire.name for source in sources)


def _of_dut(sources: Sequence[Facade]) -> bool:
    return any(source.instrument.dut for source in sources)


_OF_SCREEN = ("probe", "resolution", "low", "high")


def _known(
    facts: events.Recording, recorded: Recorded, sources: tuple[Facade, ...]
) -> tuple[dict[str, float | None], dict[str, Provenance]]:
    """Return, by channel, the certified uncertainty of its largest, least certain reading, and its provenance."""
    instruments = {source.instrument.name: source.instrument for source in sources}
    uncertainties, provenances, doubted = {}, {}, clipped(facts, recorded)
    for channel in facts.channels:
        instrument, ends = instruments[channel.instrument], _ends(recorded[channel.name])
        largest = max(ends, key=abs)
        uncertainties[channel.name] = standard_uncertainty(instrument.calibration, channel.unit, largest)
        provenances[channel.name] = Provenance(
            instruments=(instrument.name,),
            sources=(f"recording {facts.name}, {channel.name}",),
            uncovered=uncovered(instrument, channel.unit, *ends),
            doubts=(doubted[channel.name],) if channel.name in doubted else (),
            recorded=RecordedUnit(channel.unit, same),
        )
    return uncertainties, provenances


def _ends(numbers: NDArray[np.float64]) -> tuple[float, float]:
    """Return the lowest and the highest value, 0 if there is none."""
    known = numbers == numbers  # noqa: PLR0124 - only NaN differs from itself
    finite = numbers if known.all() else numbers[known]
    return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
