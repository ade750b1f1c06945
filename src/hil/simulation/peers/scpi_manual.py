"""A SCPI instrument's programming guide as a table of headers: what they read, set and refuse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from hil.simulation.faults import Fault
from hil.simulation.peers.manner import DeviceTruth, Manner
from hil.simulation.peers.scpi import no_channel, none
from hil.wire.checkpoint import Stateful
from hil.wire.peer import PeerClock

__all__ = [
    "Act",
    "By",
    "Channel",
    "Clear",
    "Manual",
    "Numbers",
    "Reading",
    "Row",
    "Setting",
    "Switch",
    "Whole",
    "Word",
    "alone",
]

By = Literal["parameter", "number", "selected", "instrument"]
"""How a header selects its channel: by parameter, by number in the header, or by selection; 0 is the instrument."""


class Channel(Stateful):
    """Target of headers: an output of a supply, the input of a load, the front end of a meter.

    Attributes:
        rating: bounds of its settings, as the rows of its manual read them.
    """

    rating: Any = None

    def reset(self, now_ns: int) -> None:
        """Return to the settings of power-on."""
        del now_ns

    def attach(self, clock: PeerClock) -> None:
        """Connect the clock for autonomous actions, before anything else."""
        del clock

    def apply(self) -> None:
        """Apply the settings to the terminals."""

    def switch(self, on: bool, now_ns: int) -> None:
        """Switch it, where it can be switched."""
        del on, now_ns

    def follow(self, now_ns: int) -> None:
        """Follow a switch of the instrument that was just set; by default every channel has its own."""
        del now_ns

    def protect(self, now_ns: int) -> None:
        """Trip any protection whose condition is met."""
        del now_ns

    def listen(self, callback: Callable[[], None]) -> None:
        """Call back when the connected circuit was changed by something else."""
        del callback

    def takes_ns(self, line: str, now_ns: int) -> int:
        """Return the additional execution time of a line, given in capitals."""
        del line, now_ns
        return 0

    @property
    def tripped(self) -> bool:
        """Whether a protection has tripped and was not cleared."""
        return False

    @property
    def watched(self) -> bool:
        """Whether a protection could trip without another command."""
        return False

    @property
    def lifted(self) -> bool:
        """Whether its terminals are above the level of a protection that is on."""
        return False


@dataclass(frozen=True, slots=True)
class Reading:
    """A query header.

    Attributes:
        header: as manuals print it: `MEASure[:VOLTage]`, `ISUMmary<n>`.
        read: reads a channel at an instant in ns.
        form: writes what was read.
        by: what names the channel: a parameter of the manual's form, the number in the header, or the selection.
    """

    header: str
    read: Callable[[Any, int], object]
    form: Callable[..., str] = str
    by: By = "parameter"


@dataclass(frozen=True, slots=True)
class Setting:
    """A header that sets a number, and returns it on query.

    Attributes:
        header, form, by: see `Reading`.
        name: the channel's attribute.
        most: the highest number.
        usual: the number after a reset; None if the word DEF is not known, and bounds cannot be asked for.
        write: sets it, where it is more than the attribute.
        units: factors of suffixes; none where a suffix is not known.
        least: the lowest number.
    """

    header: str
    name: str
    form: Callable[..., str]
    most: Callable[[Any], float]
    usual: Callable[[Any], float] | None = None
    write: Callable[[Any, float], None] | None = None
    units: Mapping[str, float] = field(default_factory=dict)
    by: By = "parameter"
    least: float = 0.0


@dataclass(frozen=True, slots=True)
class Switch:
    """A header that takes ON or OFF, and returns it in the manual's notation.

    Attributes:
        header: see `Reading`.
        name: the channel's attribute, or `on` for the channel itself.
        all: whether it concerns every channel, and no parameter names one.
        asked: whether it can be asked for.
        by: see `Reading`.
    """

    header: str
    name: str
    all: bool = False
    asked: bool = True
    by: By = "parameter"


@dataclass(frozen=True, slots=True)
class Whole:
    """A query header whose answer covers all channels."""

    header: str
    tell: Callable[[Mapping[int, Any], int], str]


@dataclass(frozen=True, slots=True)
class Clear:
    """A header that clears latches of a channel."""

    header: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Numbers:
    """A header that takes the numbers of several settings in a row, all of them or none."""

    header: str
    settings: tuple[Setting, ...]


@dataclass(frozen=True, slots=True)
class Word:
    """A header that takes one of several keywords, and returns it on query.

    Attributes:
        header: see `Reading`.
        name: the channel's attribute, which becomes what the word stands for.
        words: as manuals print them (`CURRent`), and what each stands for.
        told: how that is written in an answer; as it is, where nothing is said.
        by: see `Reading`.
    """

    header: str
    name: str
    words: Mapping[str, str]
    told: Mapping[str, str] = field(default_factory=dict)
    by: By = "parameter"


@dataclass(frozen=True, slots=True)
class Act:
    """A header of any other kind.

    Attributes:
        header: see `Reading`.
        do: takes the channel, the parameters and the instant in ns; returns the answer, None where there is none. It
            may raise `ScpiError`.
        asked: whether it ends with a question mark.
        by: see `Reading`.
    """

    header: str
    do: Callable[[Any, Sequence[str], int], str | bytes | None]
    asked: bool = False
    by: By = "parameter"


Row = Reading | Setting | Switch | Clear | Numbers | Whole | Word | Act
"""A header of a manual."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manual:
    """Content of a programming guide.

    Attributes:
        identity: what `*IDN?` answers, with `{serial}` and `{firmware}`.
        truth: what a bench file says of a device.
        rows: headers that concern channels.
        answers: headers that are asked and always give the same.
        ignored: headers that change nothing that could be seen.
        selects: headers that select a channel, and how the selection is written where it can be asked for.
        targets: splits what names channels off the parameters; None is the selected one.
        no_channel: the error of a channel that there is not.
        error_form: writes the number of an error, and its text.
        on_off: how switches are written.
        watches: whether it notices at once what else lifts its terminals.
        faults: the kinds that it knows.
        manner: what a bench file may say of its firmware, and how it writes usually.
    """

    identity: str
    truth: type[DeviceTruth]
    rows: tuple[Row, ...]
    answers: Mapping[str, str] = field(default_factory=dict)
    ignored: tuple[str, ...] = ()
    selects: Mapping[str, str] = field(default_factory=dict)
    targets: Callable[[Sequence[str]], tuple[list[str], list[int] | None]] = no_channel
    no_channel: int = -224
    error_form: str
    on_off: tuple[str, str] = ("0", "1")
    watches: bool = False
    faults: tuple[type[Fault], ...]
    manner: type[Manner] = Manner


def alone(act: Callable[[Any], str | bytes | None]) -> Callable[[Any, Sequence[str], int], str | bytes | None]:
    """Return what an `Act` does that takes no parameter, and does not look at the time."""

    def do(channel: Channel, given: Sequence[str], now_ns: int) -> str | bytes | None:
        del now_ns
        none(given)
        return act(channel)

    return do
