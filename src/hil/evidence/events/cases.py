"""Events of a case: its attempts and steps, what it did and checked."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from hil.evidence.events.event import Event, Part
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.requirements.requirement import Decision

__all__ = [
    "Bounds",
    "Case",
    "CaseEnd",
    "Chart",
    "ChartAxis",
    "ChartCurve",
    "ChartLimit",
    "Check",
    "Effect",
    "Fault",
    "NotRun",
    "Step",
    "StepEnd",
]


class Case(Event, frozen=True, kw_only=True):
    """An attempt of a case begins.

    Attributes:
        case: its id.
        attempt: the number of the attempt, from 1.
    """

    case: str
    attempt: int

    synced: ClassVar[bool] = True


class CaseEnd(Event, frozen=True, kw_only=True):
    """An attempt of a case has ended.

    Attributes:
        case: its id.
        attempt: the number of the attempt, from 1.
        verdict: the case's verdict.
        reasons: the reasons, a sentence each.
        requirements: the verdict on each requirement of the case.
        duration: bench time in s that it took.
        used: the instruments that it used, with their sources.
    """

    case: str
    attempt: int
    verdict: Verdict
    reasons: tuple[str, ...]
    requirements: Mapping[str, Verdict]
    duration: float
    used: Mapping[str, Source]

    synced: ClassVar[bool] = True


class NotRun(Event, frozen=True, kw_only=True):
    """A planned case was not run.

    Attributes:
        case: its id.
        reason: why.
    """

    case: str
    reason: str


class Step(Event, frozen=True, kw_only=True):
    """A step begins.

    Attributes:
        case: its case.
        path: the titles of its enclosing steps, the outermost first, and its own last.
        number: its number, such as `1.2`.
        turn: which turn of a loop it is, from 1, if it is in one.
    """

    case: str
    path: tuple[str, ...]
    number: str
    turn: int | None = None

    synced: ClassVar[bool] = True


class StepEnd(Event, frozen=True, kw_only=True):
    """A step has ended.

    Attributes:
        case: its case.
        path: as in its `step`.
        number: as in its `step`.
        outcome: `done`, or `raised` if an exception left it.
        duration: bench time in s that it took.
    """

    case: str
    path: tuple[str, ...]
    number: str
    outcome: Literal["done", "raised"]
    duration: float

    synced: ClassVar[bool] = True


class Effect(Event, frozen=True, kw_only=True):
    """A call of a case that reaches the bench or a person, keyed so that it can be repeated.

    Attributes:
        case: its case.
        step: the number of its step, empty outside steps.
        name: the name of the call, such as `supply.coil.configure`.
        ordinal: the number of the call of that name in that step, from 1.
        effect: what the call does: `drives`, `reads`, `waits`, `records` or `asks`.
        arguments: the arguments as JSON.
        result: the result as JSON, null if there is none.
        raised: the exception's name if it raised one.
        why: its message if a person was asked: the person is not asked again, but the message is repeated.
        hint: its hint what to do next, likewise.
    """

    case: str
    step: str
    name: str
    ordinal: int
    effect: Literal["drives", "reads", "waits", "records", "asks"]
    arguments: Mapping[str, Any]
    result: Any
    raised: str = ""
    why: str = ""
    hint: str = ""


class Bounds(Part, frozen=True, kw_only=True):
    """The limit of a check as the catalogue writes it, in `limit_unit`.

    Attributes:
        min: the lowest value, null without one.
        max: the highest value, null without one.
        equals: the expected word, null for numbers.
    """

    min: str | None
    max: str | None
    equals: str | None


class Check(Event, frozen=True, kw_only=True):
    """One evaluated criterion.

    Attributes:
        case: its case.
        step: the number of its step, empty outside steps.
        requirement: the requirement.
        parameter: the parameter of its limit.
        of: the axis or channel of the limit, null without one.
        value: a number in `unit`, a word, or null for a number that is not finite.
        unit: the unit of value and uncertainty.
        uncertainty: combined standard uncertainty, null if unknown.
        dof: degrees of freedom of the uncertainty, null if infinite.
        limit: the limit.
        limit_unit: the unit of limit, expanded uncertainty and margin.
        decision: the decision rule.
        expanded: expanded uncertainty, null if unknown.
        margin: distance to the nearer limit, negative where guarded acceptance is missed; null without a limit.
        tur: test uncertainty ratio, null if it has none.
        verdict: the verdict.
        reason: why, empty if it is obvious.
        instruments: the instruments behind the value; in packages without `provenance` those that the case had used.
        status: the status that the analysis gives the number, empty for a word; not in the oldest packages.
        doubts: why the data cannot be trusted, a sentence each.
        provenance: what the value came from, an entry each: readings, recordings, answers, parameters, analysis; null
            in packages that do not record it.
        unproven: why the value itself proves nothing, a sentence each: it has no source, or was changed by hand.
        uncovered: what no certificate covers, a sentence each; with one of them a guarded check is INCONCLUSIVE.
        at: the conditions in words, such as `axis z, 25.0 degC`; empty if the case does not state them.
        headline: what the first page of the report calls the value; empty if it is not shown there.
    """

    case: str
    step: str
    requirement: str
    parameter: str
    of: str | None
    value: float | str | None
    unit: str
    uncertainty: float | None
    dof: float | None
    limit: Bounds
    limit_unit: str
    decision: Decision
    expanded: float | None
    margin: float | None
    tur: float | None
    verdict: Verdict
    reason: str
    instruments: tuple[str, ...]
    status: str | None = None
    doubts: tuple[str, ...] = ()
    provenance: tuple[str, ...] | None = None
    unproven: tuple[str, ...] = ()
    uncovered: tuple[str, ...] = ()
    at: str = ""
    headline: str = ""

    synced: ClassVar[bool] = True

    @property
    def closes_nothing(self) -> tuple[str, ...]:
        """Why this value can close no requirement, a sentence each, empty if it can."""
        return self.unproven + self.uncovered


class ChartAxis(Part, frozen=True, kw_only=True):
    """An axis of a chart.

    Attributes:
        name: the quantity.
        unit: its unit, `1` for a plain number.
    """

    name: str
    unit: str


class ChartCurve(Part, frozen=True, kw_only=True):
    """One curve of a chart; null is a number that is not finite.

    Attributes:
        name: what it is of, such as `axis z`.
        x: the abscissa of each point, in the unit of that axis.
        y: the ordinate of each point, in the unit of the other axis.
        expanded: the expanded uncertainty of each point; empty if it is not drawn.
        model_x: the abscissas of the model's curve; empty if there is none.
        model_y: the ordinates of the model's curve.
        residual: by how much each point lies above the model; empty if it is not drawn.
    """

    name: str
    x: tuple[float | None, ...]
    y: tuple[float | None, ...]
    expanded: tuple[float | None, ...] = ()
    model_x: tuple[float | None, ...] = ()
    model_y: tuple[float | None, ...] = ()
    residual: tuple[float | None, ...] = ()


class ChartLimit(Part, frozen=True, kw_only=True):
    """A limit of the catalogue drawn in a chart.

    Attributes:
        requirement: the requirement.
        parameter: the parameter of its limit.
        min: the lowest value in the chart's unit, null without one.
        max: the highest value, null without one.
        residual: whether it is a limit on the residuals.
        power: the limit is multiplied by this power of the abscissa: -0.5 for white noise over the averaging time.
    """

    requirement: str
    parameter: str
    min: float | None
    max: float | None
    residual: bool = False
    power: float = 0.0


class Chart(Event, frozen=True, kw_only=True):
    """A chart of a case on the first page of the report; charts with the same title and axes are drawn as one.

    Attributes:
        case: its case.
        step: the number of its step, empty outside steps.
        title: the title.
        x: the lower axis.
        y: the left axis.
        curves: the points.
        limits: the limits drawn with them.
        log: whether both axes are logarithmic.
        lines: what the lines of the curves show; empty for the model.
    """

    case: str
    step: str
    title: str
    x: ChartAxis
    y: ChartAxis
    curves: tuple[ChartCurve, ...]
    limits: tuple[ChartLimit, ...] = ()
    log: bool = False
    lines: str = ""


class Fault(Event, frozen=True, kw_only=True):
    """Silence or nonsense of a device.

    Attributes:
        case: the case in which it occurred.
        device: the device.
        dut: whether it belongs to the device under test.
        error: the kind of fault.
        message: what was expected and what came.
        hint: what to do next.
        undecided: whether it is unknown if bench or DUT is to blame: what depends on it is INCONCLUSIVE.
    """

    case: str
    device: str
    dut: bool
    error: str
    message: str
    hint: str
    undecided: bool = False

    synced: ClassVar[bool] = True
