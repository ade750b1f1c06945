"""Events of a run as a whole: its request, its interruptions, its end."""

from collections.abc import Mapping
from typing import ClassVar, Literal

from hil.evidence.events.event import Event, Origin, Part
from hil.model.identity import Model, Purpose, Source
from hil.model.verdict import Verdict

__all__ = [
    "Anomaly",
    "ClockJump",
    "DutFacts",
    "End",
    "Entry",
    "Failed",
    "Live",
    "Notified",
    "NotifyFailed",
    "Orphan",
    "Planned",
    "PlannedCase",
    "Reboot",
    "Recovered",
    "Results",
    "Resumed",
    "Run",
    "Stop",
    "Suspended",
    "Voided",
]


class DutFacts(Part, frozen=True, kw_only=True):
    """The device under test, from the register.

    Attributes:
        serial: its serial number.
        part: its part number.
        model: EM, QM or FM.
        hardware: hardware revision.
        firmware: firmware revision, empty if it has none.
        title: what it is, in words.
    """

    serial: str
    part: str
    model: Model
    hardware: str
    firmware: str
    title: str


class Live(Part, frozen=True, kw_only=True):
    """A bench outside the process of the run.

    Attributes:
        speed: seconds of bench time per second of boot time.
        served: whether it is a simulated bench that another process serves.
    """

    speed: float
    served: bool


class Run(Event, frozen=True, kw_only=True):
    """The request for the run; the first event.

    Attributes:
        format: the number of the package's format.
        bench: the bench's name.
        source: where its bytes come from.
        purpose: the purpose of the run.
        dut: the device under test.
        operator: the person who runs it.
        plans: the plans, in order.
        seed: the seed of the simulated bench, empty without one.
        catalogue: SHA-256 of the frozen requirements.
        parameters: SHA-256 of the parameters used.
        sources: SHA-256 over the sources of plans and fixtures.
        version: the version of hil.
        deviations: the deviations of the run from its plan, a sentence each.
        calibration: SHA-256 of the frozen calibration records; not in the oldest packages.
        bench_files: SHA-256 over the files of the bench; not in the oldest packages.
        epoch: bench time 0 as UTC; not in the oldest packages.
        overrides: parameters changed on the command line; not in the oldest packages.
        skips: cases left out on the command line, with the reason; not in the oldest packages.
        only: the only cases to run, as the command line names them; all if there is none.
        live: the bench, if it is outside the process of the run.
        unattended: whether the run is unattended.
        on_call: who is on call for an unattended run.
        recorded_elsewhere: what was imported as a package, if hil did not make the run: there was no bench file, and
            there need not be a register.
    """

    format: int
    bench: str
    source: Source
    purpose: Purpose
    dut: DutFacts
    operator: str
    plans: tuple[str, ...]
    seed: str
    catalogue: str
    parameters: str
    sources: str
    version: str
    deviations: tuple[str, ...]
    calibration: str | None = None
    bench_files: str | None = None
    epoch: str | None = None
    overrides: Mapping[str, str] | None = None
    skips: Mapping[str, str] | None = None
    only: tuple[str, ...] = ()
    live: Live | None = None
    unattended: bool = False
    on_call: str | None = None
    recorded_elsewhere: str = ""

    synced: ClassVar[bool] = True


class PlannedCase(Part, frozen=True, kw_only=True):
    """One case as collected.

    Attributes:
        case: its id: the pytest node id, relative to the workspace.
        title: the first line of its docstring.
        plan: its plan.
        requirements: the ids of its marker.
        max_duration: the longest bench time in s that it may take.
        repeatable: why an attempt that ended without a verdict may be repeated, empty if it counts.
    """

    case: str
    title: str
    plan: str
    requirements: tuple[str, ...]
    max_duration: float
    repeatable: str = ""


class Planned(Event, frozen=True, kw_only=True):
    """The planned cases, before any is deselected.

    Attributes:
        cases: the cases, in order.
    """

    cases: tuple[PlannedCase, ...]

    synced: ClassVar[bool] = True


class Orphan(Event, frozen=True, kw_only=True):
    """Cases that carry no requirement.

    Attributes:
        cases: their ids.
    """

    cases: tuple[str, ...]


class Anomaly(Event, frozen=True, kw_only=True):
    """Something that should not have happened, or something suspicious about a requirement's source.

    Attributes:
        text: a description.
    """

    text: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Stop(Event, frozen=True, kw_only=True):
    """The run was ended early.

    Attributes:
        reason: who or what asked for it, `disk full` for a full disk.
        urgent: whether it was requested a second time.
        resumable: whether the package stays open, so that the run can be resumed.
    """

    reason: str
    urgent: bool
    resumable: bool = False

    synced: ClassVar[bool] = True


class Voided(Part, frozen=True, kw_only=True):
    """The rows of a recording that are void: those from `first` to before `end`.

    Attributes:
        recording: its id.
        first: the first void row.
        end: the row after the last void row.
    """

    recording: str
    first: int
    end: int


class Failed(Part, frozen=True, kw_only=True):
    """A check that failed before the run was interrupted; it counts, although its part of the run is void.

    Attributes:
        case: its case.
        requirement: the requirement.
        parameter: the parameter of its limit.
        of: which member of the limit's denominator, null without one.
        reason: why, empty if it is obvious.
    """

    case: str
    requirement: str
    parameter: str
    of: str | None
    reason: str


class Entry(Part, frozen=True, kw_only=True):
    """The point at which a stopped run was resumed.

    Attributes:
        place: how many events of the run's own course stand, up to the one after which it was resumed.
        boundary: the sequence number of that event.
        void_to: the sequence number of the last void event; the first is the one after the boundary.
        operations: the number of operations in the transcript; those since the boundary are void, too.
        number: the number of the next recording.
        rows: the void rows of every recording that continued.
        kept: the recording at whose beginning the run was resumed and whose rows stand; empty if there is none.
        over: whether every case had ended, so that only the safe-off was left.
        failed: the void checks that had failed.
    """

    place: int
    boundary: int
    void_to: int
    operations: int
    number: int
    rows: tuple[Voided, ...]
    kept: str
    over: bool | None = None
    failed: tuple[Failed, ...] = ()


class Resumed(Event, frozen=True, kw_only=True):
    """The run had been interrupted, and was resumed.

    Attributes:
        number: how many times it has been resumed so far.
        checkpoint: the bench time in s of the checkpoint of the simulated bench, 0 without one.
        torn_bytes: the length in bytes of the incomplete line at the end of the journal.
        deviation: how this resumption deviates from the plan, empty if it does not.
        seconds: how long the run was interrupted.
        text: a description in words.
        entry: where a stopped run was resumed; left out for a killed run, which continues where it was.
        guardian: the SHA-256 of the guardian's journal as it was then; left out if the guardian had not acted.
    """

    number: int
    checkpoint: float
    torn_bytes: int
    deviation: str
    seconds: float
    text: str
    entry: Entry | None = None
    guardian: str = ""

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Reboot(Event, frozen=True, kw_only=True):
    """The machine was restarted while the run was interrupted.

    Attributes:
        text: a description in words.
        seconds: how long the run was interrupted.
    """

    text: str
    seconds: float

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Suspended(Event, frozen=True, kw_only=True):
    """The machine was suspended.

    Attributes:
        text: a description in words.
        seconds: for how long.
    """

    text: str
    seconds: float

    origin: ClassVar[Origin] = Origin.OUTSIDE


class ClockJump(Event, frozen=True, kw_only=True):
    """The machine's time of day was set.

    Attributes:
        text: a description in words.
        seconds: by how much.
    """

    text: str
    seconds: float

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Notified(Event, frozen=True, kw_only=True):
    """The workspace's `notify` command was run.

    Attributes:
        event: the event passed to it.
    """

    event: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class NotifyFailed(Event, frozen=True, kw_only=True):
    """The workspace's `notify` command failed.

    Attributes:
        event: the event that it should have been given.
        reason: what went wrong.
    """

    event: str
    reason: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Recovered(Event, frozen=True, kw_only=True):
    """An interrupted run was sealed as it is.

    Attributes:
        torn_bytes: the length in bytes of the incomplete line at the end of the journal.
        text: a description in words.
    """

    torn_bytes: int
    text: str

    origin: ClassVar[Origin] = Origin.OUTSIDE
    synced: ClassVar[bool] = True


class Results(Event, frozen=True, kw_only=True):
    """The results were derived; the last event but one.

    Attributes:
        sha256: the hash of `data/results.json`.
        verdict: the run's verdict.
        guardian: the hash of the guardian's journal; empty if the guardian did nothing, and in older journals.
    """

    sha256: str
    verdict: Verdict
    guardian: str = ""

    synced: ClassVar[bool] = True


class End(Event, frozen=True, kw_only=True):
    """The run has ended; the last event.

    Attributes:
        state: its outcome.
        exit_code: the run's exit code.
    """

    state: Literal["SEALED"]
    exit_code: int

    synced: ClassVar[bool] = True
