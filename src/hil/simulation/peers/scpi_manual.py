"""The programming guide of a SCPI supply as a table: headers, and what they read, set and refuse."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from hil.simulation.faults import Fault
from hil.simulation.peers.manner import Manner
from hil.simulation.peers.supply_output import OutputTruth, Rating, SupplyOutput, SupplyTruth

__all__ = ["By", "Clear", "Manual", "Numbers", "Reading", "Row", "Setting", "Switch", "Whole"]

By = Literal["parameter", "number", "selected"]
"""What names the output of a header: a parameter, the number in the header, or the selection."""


@dataclass(frozen=True, slots=True)
class Reading:
    """A header that is asked.

    Attributes:
        header: as manuals print it: `MEASure[:VOLTage]`, `ISUMmary<n>`.
        read: reads an output at an instant in ns.
        form: writes what was read.
        by: what names the output: a parameter of the manual's form, the number in the header, or the selection.
    """

    header: str
    read: Callable[[SupplyOutput, int], object]
    form: Callable[..., str] = str
    by: By = "parameter"


@dataclass(frozen=True, slots=True)
class Setting:
    """A header that takes a number, and gives it when it is asked.

    Attributes:
        header, form, by: see `Reading`.
        name: the output's attribute.
        most: the highest number.
        usual: the number after a reset; None if the word DEF is not known, and bounds cannot be asked for.
        write: sets it, where it is more than the attribute.
        units: factors of suffixes; none where a suffix is not known.
    """

    header: str
    name: str
    form: Callable[..., str]
    most: Callable[[Rating], float]
    usual: Callable[[Rating], float] | None = None
    write: Callable[[SupplyOutput, float], None] | None = None
    units: Mapping[str, float] = field(default_factory=dict)
    by: By = "parameter"


@dataclass(frozen=True, slots=True)
class Switch:
    """A header that takes ON or OFF, and gives it in the manual's words.

    Attributes:
        header: see `Reading`.
        name: the output's attribute, or `on` for the output itself.
        all: whether it concerns every output, and no parameter names one.
        asked: whether it can be asked for.
    """

    header: str
    name: str
    all: bool = False
    asked: bool = True


@dataclass(frozen=True, slots=True)
class Whole:
    """A header that is asked, and whose answer is of all outputs."""

    header: str
    tell: Callable[[Mapping[int, SupplyOutput], int], str]


@dataclass(frozen=True, slots=True)
class Clear:
    """A header that clears latches of an output."""

    header: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Numbers:
    """A header that takes the numbers of several settings in a row, all of them or none."""

    header: str
    settings: tuple[Setting, ...]


Row = Reading | Setting | Switch | Clear | Numbers | Whole
"""A header of a manual."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Manual:
    """What a programming guide says.

    Attributes:
        identity: what `*IDN?` answers, with `{serial}` and `{firmware}`.
        truth: what a bench file says of a device.
        ratings: by number of the output.
        deviates: what it says of an output.
        rows: headers that concern outputs.
        answers: headers that are asked and always give the same.
        ignored: headers that change nothing that could be seen.
        selects: headers that select an output, and how the selection is written where it can be asked for.
        targets: splits what names outputs off the parameters; None is the selected one.
        no_channel: the error of an output that there is not.
        error_form: writes the number of an error, and its text.
        on_off: how switches are written.
        watches: whether it notices at once what else lifts its terminals.
        faults: the kinds that it knows.
        output: the class of its outputs.
        manner: what a bench file may say of its firmware, and how it writes usually.
        of_model: ratings of the models that a truth may name, where they differ.
    """

    identity: str
    truth: type[SupplyTruth]
    ratings: Mapping[int, Rating]
    deviates: type[OutputTruth]
    rows: tuple[Row, ...]
    answers: Mapping[str, str]
    ignored: tuple[str, ...]
    selects: Mapping[str, str]
    targets: Callable[[Sequence[str]], tuple[list[str], list[int] | None]]
    no_channel: int
    error_form: str
    on_off: tuple[str, str]
    watches: bool
    faults: tuple[type[Fault], ...]
    output: type[SupplyOutput] = SupplyOutput
    manner: type[Manner] = Manner
    of_model: Mapping[str, Mapping[int, Rating]] = field(default_factory=dict)
