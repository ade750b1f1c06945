"""Events of the bench: readiness, envelope, hold, rest and safe state."""

from typing import ClassVar, Literal

from hil.evidence.events.event import Event, Origin, Part
from hil.model.identity import Source

__all__ = [
    "Armed",
    "Brought",
    "Fed",
    "Gate",
    "Hold",
    "HoldEnd",
    "HoldRefused",
    "HostGate",
    "Lost",
    "MonitorLate",
    "Rest",
    "Safe",
    "SafeEnd",
    "Trip",
]


class Gate(Event, frozen=True, kw_only=True):
    """A readiness condition.

    Attributes:
        name: its name.
        ok: whether it holds.
        detail: what was seen.
        instrument: the instrument whose identity or port it is about, empty for any other gate.
        unproven: what it leaves unproven although it holds, empty if nothing.
        source: what the instrument counts as from now on, null if this gate does not say.
        exception: why its port counts as hardware although it is on this computer, as the bench file says.
    """

    name: str
    ok: bool
    detail: str
    instrument: str = ""
    unproven: str = ""
    source: Source | None = None
    exception: str = ""


class HostGate(Gate, frozen=True, kw_only=True):
    """A condition of readiness that people, the machine or the guardian must meet.

    Attributes:
        name: as in `gate`.
        ok: as in `gate`.
        detail: as in `gate`.
        instrument: as in `gate`.
        unproven: as in `gate`.
        source: as in `gate`.
        exception: as in `gate`.
    """

    origin: ClassVar[Origin] = Origin.OUTSIDE
    GUARDIANS_PROOF: ClassVar[str] = "guardian's proof at the end"
    """The name of what tells that the guardian, asked after the safe-off, did not find every output safe."""


class Armed(Event, frozen=True, kw_only=True):
    """The bench may be driven from now on."""

    synced: ClassVar[bool] = True


class Fed(Event, frozen=True, kw_only=True):
    """A limit of the envelope is judged on every row of a recording from now on.

    Attributes:
        limit: the limit's id.
        recording: the recording's id.
    """

    limit: str
    recording: str


class MonitorLate(Event, frozen=True, kw_only=True):
    """A monitor read its limit late.

    Attributes:
        limit: the limit's id.
        late: the delay in s.
        text: a description in words.
    """

    limit: str
    late: float
    text: str


class Trip(Event, frozen=True, kw_only=True):
    """A limit of the envelope was exceeded.

    Attributes:
        limit: the limit's id.
        value: what was read, null if nothing was.
        unit: its unit.
        text: a description in words.
    """

    limit: str
    value: float | None
    unit: str
    text: str

    synced: ClassVar[bool] = True


class Lost(Event, frozen=True, kw_only=True):
    """What the run needs to drive its bench was lost; the bench was made safe, and the run can be resumed.

    Attributes:
        what: `port` for one that is gone, `reply` for an instrument that falls silent, `guardian`, `machine` if its
            sleep is no longer inhibited, or `arming` if a resumed run could not arm the bench.
        device: the instrument concerned, empty if none is.
        text: the same in words.
    """

    what: Literal["arming", "guardian", "machine", "port", "reply"]
    device: str
    text: str

    origin: ClassVar[Origin] = Origin.OUTSIDE
    synced: ClassVar[bool] = True


class Rest(Event, frozen=True, kw_only=True):
    """An output was brought to its rest state between cases.

    Attributes:
        output: the output.
        state: the required state.
        ok: whether it is proven.
        detail: what was seen.
        duration: bench time in s that it took.
    """

    output: str
    state: str
    ok: bool
    detail: str
    duration: float


class Safe(Rest, frozen=True, kw_only=True):
    """An output was brought to its safe state.

    Attributes:
        output: the output.
        state: the required state.
        ok: whether it is proven.
        detail: what was seen.
        duration: bench time in s that it took.
    """

    synced: ClassVar[bool] = True


class SafeEnd(Event, frozen=True, kw_only=True):
    """The safe-off has ended.

    Attributes:
        ok: whether every output is proven safe.
    """

    ok: bool

    synced: ClassVar[bool] = True


class HoldRefused(Event, frozen=True, kw_only=True):
    """A hold or a release was refused.

    Attributes:
        by: who requested it.
        text: why.
    """

    by: str
    text: str

    origin: ClassVar[Origin] = Origin.OUTSIDE


class Brought(Part, frozen=True, kw_only=True):
    """The outcome of one line of the hold state.

    Attributes:
        output: the output.
        state: the required state.
        ok: whether it is proven.
        detail: what was seen.
        seconds: bench time that it took.
    """

    output: str
    state: str
    ok: bool
    detail: str
    seconds: float


class Hold(Event, frozen=True, kw_only=True):
    """Every output was brought to its hold state.

    Attributes:
        by: who requested it.
        text: why.
        outputs: the outcome for each output.
    """

    by: str
    text: str
    outputs: tuple[Brought, ...]

    origin: ClassVar[Origin] = Origin.OUTSIDE


class HoldEnd(Event, frozen=True, kw_only=True):
    """A hold has ended.

    Attributes:
        how: `released`, or `ended` if the run ended during it.
        by: who released it.
        text: the remark that came with the release.
        duration: bench time in s that it lasted.
    """

    how: Literal["released", "ended"]
    by: str
    text: str
    duration: float

    origin: ClassVar[Origin] = Origin.OUTSIDE
