"""Events of recordings: their beginning with their channels, their rows' hashes, their end."""

from typing import Literal

from hil.evidence.events.event import Event, Part
from hil.model.identity import Source

__all__ = ["Capture", "Channel", "Recording", "RecordingEnd", "Rows"]


class Channel(Part, frozen=True, kw_only=True):
    """One channel of a recording.

    Attributes:
        name: its name.
        unit: the unit of its values.
        instrument: what measured it.
        calibration: the instrument's certificate, empty without one.
        uncertainty: standard uncertainty in its unit, null if unknown.
        probe: of a capture, the attenuation: the channel's values divided by what the instrument sees.
        resolution: of a capture, the converter's step, in the channel's unit.
        low: of a capture, the converter's lowest value; a sample there may be lower.
        high: of a capture, the converter's highest value; a sample there may be higher.
    """

    name: str
    unit: str
    instrument: str
    calibration: str
    uncertainty: float | None
    probe: float | None = None
    resolution: float | None = None
    low: float | None = None
    high: float | None = None


class Capture(Part, frozen=True, kw_only=True):
    """Capture: an instrument took the rows of a recording by itself, around its trigger.

    Attributes:
        interval: the time between two rows in s.
        first: the time of the first row in s after the trigger, negative before it.
        channel: the channel that triggered.
        level: the level of the trigger, in the unit of its channel.
        slope: `rising` or `falling`.
    """

    interval: float
    first: float
    channel: str
    level: float
    slope: Literal["rising", "falling"]


class Recording(Event, frozen=True, kw_only=True):
    """A recording begins.

    Attributes:
        recording: its id, which names its file.
        name: its name in the case, or the id of the envelope's limit.
        case: its case, null for a recording outside all cases.
        step: the number of its step, null outside all cases.
        channels: the channels, in the order of its columns.
        rate: rows per second of bench time.
        duration: bench time in s that it is to last, null if it is open-ended.
        source: where its bytes come from.
        continues: whether a run that was stopped during it continues it, with a gap.
        capture: how an instrument captured it; the rows' times then count from the trigger, not from the beginning of
            the run. Null for any other recording.
    """

    recording: str
    name: str
    case: str | None
    step: str | None
    channels: tuple[Channel, ...]
    rate: float
    duration: float | None
    source: Source
    continues: bool = False
    capture: Capture | None = None


class Rows(Event, frozen=True, kw_only=True):
    """The running hash of a recording, every 65,536 rows.

    Attributes:
        recording: its id.
        rows: the number of rows.
        sha256: the hash over them.
    """

    recording: str
    rows: int
    sha256: str


class RecordingEnd(Event, frozen=True, kw_only=True):
    """A recording has ended.

    Attributes:
        recording: its id.
        rows: the number of rows.
        sha256: the hash over them.
        complete: whether it lasted as long as planned.
        gaps: the largest time between two rows in s.
    """

    recording: str
    rows: int
    sha256: str
    complete: bool
    gaps: float
