"""What `hil analyse allan` prints: a table for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from hil.analysis.allan.results import AllanCurve, NoiseModel
from hil.analysis.gates import Gate
from hil.cli.analyses.log import INCONCLUSIVE, Log, log_as_json, status
from hil.documents.text import counted, fitting
from hil.model.figure import Figure, FigureStatus
from hil.report.tables import aligned

__all__ = ["NAMES", "Axis", "Result", "as_json", "as_text", "called", "heading", "stated"]

_TERMS = ("quantisation", "white", "flicker", "random_walk", "ramp", "averaging_window")
_LABELS = ("quantisation", "white noise", "flicker", "random walk", "ramp", "best averaging")
NAMES = {
    "overlapping": "overlapping Allan",
    "nonoverlapping": "nonoverlapping Allan",
    "modified": "modified Allan",
    "time": "time",
    "hadamard": "overlapping Hadamard",
    "total": "total",
}
"""Names of the estimators' deviations."""

_NOISE = {
    2: "white angle",
    1: "flicker angle",
    0: "white",
    -1: "flicker",
    -2: "random walk",
    -3: "flicker walk",
    -4: "random run",
}
_WIDTH = 80  # width of sentences; tables are as wide as they need to be
_LEAST_JITTER = 1e-9  # s; below it are the rounding errors of the timestamps
_SHORT = ((1e6, "us"), (1e3, "ms"), (1.0, "s"))
_HEAD = ("tau [s]", "deviation", "low", "high", "edf", "noise")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One column of a log, what it says, and the gates that make that inconclusive.

    `legacy` holds what nearest slopes read, by term, where that was asked for.
    """

    name: str
    model: NoiseModel
    curve: AllanCurve
    legacy: Mapping[str, Figure] = field(default_factory=dict)
    doubts: tuple[Gate, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """All results of one call."""

    log: Log
    axes: tuple[Axis, ...]


def as_json(result: Result) -> str:
    """Return the result as one JSON document; what is not finite is null."""
    doubted = any(axis.doubts for axis in result.axes)
    document = {**log_as_json(result.log, doubted=doubted), "axes": [_axis(axis) for axis in result.axes]}
    return json.dumps(document, allow_nan=False, indent=2)


def _axis(axis: Axis) -> dict[str, object]:
    model, curve = axis.model, axis.curve
    rows = zip(
        curve.tau.tolist(), curve.deviation.tolist(), curve.low.tolist(), curve.high.tolist(), curve.edf.tolist(),
        curve.alpha.tolist(), curve.m.tolist(), curve.terms.tolist(), strict=True,
    )  # fmt: skip
    keys = ("tau", "deviation", "low", "high", "edf", "alpha", "m", "terms")
    return {
        "name": axis.name,
        "unit": curve.unit,
        "estimator": curve.estimator,
        "starts": curve.starts,
        "rate": curve.rate,
        "samples": curve.samples,
        "missing": curve.missing,
        "confidence": curve.confidence,
        "status": INCONCLUSIVE if axis.doubts else "conclusive",
        "reasons": [str(gate) for gate in axis.doubts],
        **{term: _figure(getattr(model, term), axis.doubts) for term in _TERMS},
        **({"legacy_nearest_slope": _legacy(axis)} if axis.legacy else {}),
        "chi": _finite(model.chi),
        "tau_min": model.tau_min,
        "remark": model.remark,
        "curve": [dict(zip(keys, row, strict=True)) for row in rows],
    }


def _legacy(axis: Axis) -> dict[str, object]:
    return {name: {"value": _finite(each.value), "unit": each.unit} for name, each in axis.legacy.items()}


def _figure(figure: Figure, doubts: tuple[Gate, ...]) -> Mapping[str, object]:
    return {
        "value": _finite(figure.value),
        "unit": figure.unit,
        "uncertainty": figure.uncertainty,
        "dof": _finite(figure.dof),
        "status": status(doubts, figure.status.value),
    }


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def as_text(result: Result) -> str:
    """Return the result as plain text: a part for each column, with its deviations and its noise."""
    known = [gate for gate in result.log.gates if gate.ok is False]
    doubts = {gate for axis in result.axes for gate in axis.doubts}
    told = [f"{'INCONCLUSIVE' if gate in doubts else 'note'}: {gate}" for gate in known]
    lines = fitting([*heading(result.log), *told, *(f"note: {remark}" for remark in result.log.remarks)], _WIDTH)
    for axis in result.axes:
        lines += [
            "",
            _title(axis),
            *aligned(_rows(axis), head=_HEAD, right=range(len(_HEAD) - 1)),
            *_summary(axis),
        ]
    return "\n".join(lines)


def heading(log: Log) -> Iterator[str]:
    """Yield what the times of a log say, a line each."""
    sampling = log.sampling
    if sampling is None:
        samples = next(iter(log.channels.values())).size
        yield f"{log.file}: {samples} samples at {log.rate:g} Hz, the rate that was given"
        return
    gaps = "no gaps"
    if sampling.gaps:
        count = counted(sampling.gaps, "gap")
        gaps = f"{count} (longest {sampling.longest_gap:.4g} s, about {sampling.missing} samples missing)"
    rate = stated(Figure(value=sampling.rate, unit="Hz", uncertainty=sampling.rate_uncertainty))
    jitter = f"{_short(sampling.jitter_rms)} rms, {_short(sampling.jitter_max)} peak"
    yield f"{log.file}: {sampling.samples} samples in {sampling.duration:.6g} s"
    yield f"sampling: {rate}, jitter {jitter}"
    yield f"times: {gaps}, {sampling.duplicates} repeated and {sampling.reversals} reversed timestamps"


def _short(seconds: float) -> str:
    if seconds < _LEAST_JITTER:
        return "0 us"
    factor, unit = next((each for each in _SHORT if seconds * each[0] < 999.5), _SHORT[-1])
    return f"{seconds * factor:.3g} {unit}"


def called(name: str) -> str:
    """Return the name of a column, or `column 2` if it has only a number."""
    return f"column {name}" if name.isdecimal() else name


def _title(axis: Axis) -> str:
    curve = axis.curve
    starts = f", from {curve.starts} starts in each tau" if curve.starts else ""
    return (
        f"{called(axis.name)}: {NAMES[curve.estimator]} deviation in {curve.unit}, "
        f"intervals at {curve.confidence:.4g}{starts}"
    )


def _rows(axis: Axis) -> list[tuple[str, ...]]:
    curve = axis.curve
    columns = (curve.tau, curve.deviation, curve.low, curve.high, curve.edf, curve.alpha)
    return [
        (f"{tau:.5g}", f"{deviation:.4e}", f"{low:.4e}", f"{high:.4e}", f"{edf:.1f}", _NOISE[alpha])
        for tau, deviation, low, high, edf, alpha in zip(*(column.tolist() for column in columns), strict=True)
    ]


def _summary(axis: Axis) -> Iterator[str]:
    model = axis.model
    figures = zip(_LABELS, (getattr(model, term) for term in _TERMS), strict=True)
    rows = [
        (label, "-" if axis.doubts else stated(figure), status(axis.doubts, figure.status.value))
        for label, figure in figures
    ]
    yield from aligned(rows)
    if axis.legacy:
        yield "legacy method nearest-slope, for comparison with old tables; no measurement:"
        yield from aligned([(_LABELS[_TERMS.index(name)], stated(each)) for name, each in axis.legacy.items()])
    if axis.doubts:
        yield from fitting([f"inconclusive: {'; '.join(gate.name for gate in axis.doubts)}; see above"], _WIDTH)
    if math.isfinite(model.chi):
        yield f"fit: chi {model.chi:.2f} from {model.tau_min:.4g} s on"
    if model.remark:
        yield from fitting([f"note: {model.remark}"], _WIDTH)


def stated(figure: Figure) -> str:
    """Return a figure as text: the uncertainty with two digits, the value down to the same place.

    What the record cannot give is a bound where it gives one, and no number else. A plain number has no unit.
    """
    return _with_unit(figure).removesuffix(" 1")


def _with_unit(figure: Figure) -> str:
    if not math.isfinite(figure.value) or figure.status is FigureStatus.MODEL_REJECTED:
        return "-"
    if figure.status is FigureStatus.NOT_OBSERVABLE:
        return f"> {figure.value:.3g} {figure.unit}"
    if figure.status is FigureStatus.UPPER_LIMIT:
        return f"< {figure.value:.3g} {figure.unit}"
    if not figure.uncertainty:
        return f"{figure.value:.4g} {figure.unit}"
    places = 1 - math.floor(math.log10(figure.uncertainty))
    power = math.floor(math.log10(max(abs(figure.value), figure.uncertainty)))
    if not 0 <= places <= 6 and power != 0:
        digits = max(0, places + power)
        scale = 10.0**power
        return f"({figure.value / scale:.{digits}f} ± {figure.uncertainty / scale:.{digits}f})e{power:+d} {figure.unit}"
    return f"{figure.value:.{places}f} ± {figure.uncertainty:.{places}f} {figure.unit}"
