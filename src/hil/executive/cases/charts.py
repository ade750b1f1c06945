"""`chart`: charts of a plan on the first page of its report, kept as data that anybody can redraw."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hil.documents.suggest import did_you_mean
from hil.documents.text import one_line
from hil.evidence import events
from hil.evidence.events import EventSink
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.cases.steps import Steps
from hil.model.errors import Misused
from hil.model.figure import Figure
from hil.requirements.requirement import Requirement
from hil.requirements.units import UnitError, check_unit, convert

__all__ = ["Charts", "Curve"]

Values = Sequence[float | Figure]
_MOST_POINTS = 5_000
"""Limit per chart: it goes into the journal, and a drawing can show no more."""

_K = 2.0
"""Coverage factor of the error bars, which are for the eye; judging is done by the checks."""


@dataclass(frozen=True, kw_only=True)
class Curve:
    """One curve of a chart, all lists in the same order; figures are converted to the axis' unit.

    Attributes:
        name: what it is of, such as `axis z` or `discharge`.
        x: the abscissa of each point: numbers in the axis' unit, or figures.
        y: the ordinate of each point, likewise; figures with an uncertainty are drawn with bars of twice that.
        model: a model's curve as two lists, abscissas and ordinates; two points make a straight line.
        residual: by how much each point lies above the model, for a separate panel below.
    """

    name: str
    x: Values
    y: Values
    model: tuple[Values, Values] | None = None
    residual: Values = ()


class Charts(OfThisProcess):
    """The `chart` fixture of one case.

    Args:
        requirements: the requirements of the case's marker, by id.
        steps: knows case and step.
        journal: where events are written.
    """

    said = "`chart`"

    def __init__(self, requirements: dict[str, Requirement], steps: Steps, journal: EventSink) -> None:
        self._requirements = requirements
        self._steps = steps
        self._journal = journal

    def __call__(
        self,
        title: str,
        *curves: Curve,
        x: tuple[str, str],
        y: tuple[str, str],
        log: bool = False,
        limit: tuple[str, str] | None = None,
        limit_power: float = 0.0,
        residual_limit: tuple[str, str] | None = None,
        lines: str = "",
    ) -> None:
        """Put a chart on the first page of the report.

        Charts with the same title and axes are drawn as one, so that every board, axis or temperature with a case of
        its own adds its curves.

        Args:
            title: the title.
            curves: the curves; a point that is not finite leaves a gap.
            x: name and unit of the lower axis.
            y: name and unit of the left axis.
            log: whether both axes are logarithmic; a point that is not above zero leaves a gap.
            limit: requirement and parameter whose limit is drawn, from the catalogue.
            limit_power: the power of the abscissa by which the limit is multiplied: -0.5 for a noise density over the
                averaging time.
            residual_limit: the same for the residuals.
            lines: what the models' lines show, for the caption, such as `the fade that fits best`.

        Raises:
            Misused: for lists of unequal length, an unknown limit, or a unit that does not convert.
        """
        across, upward = _axis(x, "x"), _axis(y, "y")
        written = tuple(_curve(each, across.unit, upward.unit) for each in curves)
        if not written or sum(len(each.x) + len(each.model_x) for each in written) > _MOST_POINTS:
            raise Misused(f"chart '{title}' has no curve, or more than {_MOST_POINTS} points", "give some, or fewer")
        asked = ((limit, limit_power, False), (residual_limit, 0.0, True))
        limits = [
            self._limit(of, across, upward, power, residual=below) for of, power, below in asked if of is not None
        ]
        self._journal.write(
            events.Chart(
                case=self._steps.case,
                step=self._steps.number,
                title=one_line(title),
                x=across,
                y=upward,
                curves=written,
                limits=tuple(limits),
                log=log,
                lines=one_line(lines),
            )
        )

    def _limit(
        self, of: tuple[str, str], across: events.ChartAxis, upward: events.ChartAxis, power: float, *, residual: bool
    ) -> events.ChartLimit:
        requirement, parameter = of
        unit = f"{upward.unit}*{across.unit}**{-power:g}" if power else upward.unit
        known = {
            f"{name} {limit.parameter}": limit
            for name, each in self._requirements.items()
            for limit in each.limits
        }  # fmt: skip
        limit = known.get(f"{requirement} {parameter}")
        if limit is None:
            raise Misused(
                f"this case has no limit '{requirement} {parameter}'{did_you_mean(f'{requirement} {parameter}', known)}"
            )
        low, high = (
            None if bound is None else _digits(_converted(float(bound), limit.unit, unit))
            for bound in (limit.minimum, limit.maximum)
        )
        return events.ChartLimit(
            requirement=requirement, parameter=parameter, min=low, max=high, residual=residual, power=float(power)
        )


def _axis(given: tuple[str, str], which: str) -> events.ChartAxis:
    try:
        name, unit = given
    except (TypeError, ValueError):
        raise Misused(f"{which} of a chart is a name and a unit, found {given!r}", "give ('rate', 'deg/s')") from None
    if problem := check_unit(unit):
        raise Misused(f"{which} of a chart: {problem}", "use units as in the catalogue, 1 for a plain number")
    return events.ChartAxis(name=one_line(name), unit=unit)


def _curve(curve: object, across: str, upward: str) -> events.ChartCurve:
    if not isinstance(curve, Curve):
        raise Misused(f"a chart is made of curves, found a {type(curve).__name__}", "use hil.plan.Curve")
    x, y, residual = _numbers(curve.x, across), _numbers(curve.y, upward), _numbers(curve.residual, upward)
    model_x, model_y = curve.model or ((), ())
    if len(x) != len(y) or len(residual) not in {0, len(y)} or len(model_x) != len(model_y):
        raise Misused(
            f"curve '{curve.name}': {len(x)} places across for {len(y)} values, {len(residual)} residuals,"
            f" {len(model_x)} places for {len(model_y)} values of the model",
            "give lists of the same length",
        )
    return events.ChartCurve(
        name=one_line(curve.name),
        x=x,
        y=y,
        expanded=_expanded(curve.y, upward),
        model_x=_numbers(model_x, across),
        model_y=_numbers(model_y, upward),
        residual=residual,
    )


def _numbers(values: Iterable[float | Figure], unit: str) -> tuple[float | None, ...]:
    return tuple(
        _digits(_converted(each.value, each.unit, unit) if isinstance(each, Figure) else float(each)) for each in values
    )


def _expanded(values: Iterable[float | Figure], unit: str) -> tuple[float | None, ...]:
    """Return the error bars of the figures among the values; none if no figure has an uncertainty."""
    bars = tuple(
        _digits(
            _K
            * abs(_converted(each.value + each.uncertainty, each.unit, unit) - _converted(each.value, each.unit, unit))
        )
        if isinstance(each, Figure) and each.uncertainty is not None and math.isfinite(each.value)
        else None
        for each in values
    )
    return bars if any(bar is not None for bar in bars) else ()


def _converted(value: float, unit: str, wanted: str) -> float:
    try:
        return value if unit == wanted else convert(value, unit, wanted)
    except UnitError as error:
        raise Misused(f"a chart's values in {unit} do not convert to {wanted}: {error}") from None


def _digits(number: float) -> float | None:
    """Return a number rounded to the digits that every machine agrees on, None if it is not finite."""
    return float(f"{number:.12g}") if math.isfinite(number) else None
