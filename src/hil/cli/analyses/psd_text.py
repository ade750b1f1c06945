"""What `hil analyse psd` prints: tables for people, or one JSON document for machines."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass

from hil.analysis.gates import Gate
from hil.analysis.spectra.coefficients import Agreement, SpectralNoise
from hil.analysis.spectra.lines import Line
from hil.analysis.spectra.welch import interval
from hil.cli.analyses.allan_text import called, heading, stated
from hil.cli.analyses.log import INCONCLUSIVE, Log, log_as_json, status
from hil.documents.text import fitting
from hil.model.figure import Figure, FigureStatus, encoded
from hil.report.tables import aligned

__all__ = ["Axis", "Comparison", "Result", "as_json", "as_text", "squared"]

_TERMS = {
    "density": "white noise, one-sided density",
    "white": "white noise N, two-sided",
    "flicker": "flicker B",
    "random_walk": "random walk K",
    "quantisation": "quantisation Q",
}
_TAKEN_OFF = {"none": "nothing", "constant": "mean", "linear": "straight line"}
_WIDTH = 80
_SHOWN = 3  # of the bands every third is shown: three a decade


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """White noise beside that of the data sheet, both one-sided: the ratio, and the gate on it."""

    sheet: float
    ratio: Figure
    gate: Gate


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One column of a log, what it says, and the gates that make that inconclusive."""

    name: str
    noise: SpectralNoise
    agreement: Agreement
    doubts: tuple[Gate, ...] = ()
    comparison: Comparison | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """All results of one call."""

    log: Log
    axes: tuple[Axis, ...]


def squared(unit: str) -> str:
    """Return the unit of a power spectral density."""
    return f"{unit if unit.isalnum() else f'({unit})'}^2/Hz"


def as_json(result: Result, *, points: bool) -> str:
    """Return the result as one JSON document; what is not finite is null.

    Args:
        result: what was found.
        points: whether to give every point of the spectrum besides the bands.
    """
    doubted = any(axis.doubts for axis in result.axes)
    gates = tuple(axis.comparison.gate for axis in result.axes if axis.comparison)
    document = {
        **log_as_json(result.log, doubted=doubted, gates=gates),
        "axes": [_axis(axis, points=points) for axis in result.axes],
    }
    return json.dumps(encoded(document), allow_nan=False, indent=2)


def _axis(axis: Axis, *, points: bool) -> dict[str, object]:
    noise, whole = axis.noise, axis.noise.spectrum
    curve = {name: getattr(noise.bands, name).tolist() for name in noise.bands.__slots__}
    every = {name: getattr(whole, name).tolist() for name in ("frequency", "density", "edf", "low", "high")}
    compared = axis.comparison
    return {
        "name": axis.name,
        "unit": whole.unit,
        "density_unit": squared(whole.unit),
        "sided": "one-sided",
        "rate": whole.rate,
        "samples": whole.samples,
        "missing": whole.missing,
        "segment": whole.segment,
        "overlap": 1.0 - whole.step / whole.segment,
        "segments": whole.segments,
        "window": whole.window,
        "detrend": whole.detrend,
        "equivalent_noise_bandwidth": whole.bandwidth,
        "edf": float(whole.edf[1]),
        "confidence": whole.confidence,
        "status": INCONCLUSIVE if axis.doubts else "conclusive",
        "reasons": [str(gate) for gate in axis.doubts],
        **{term: _judged(getattr(noise, term), axis.doubts) for term in _TERMS},
        "chi": noise.chi,
        "lowest": noise.lowest,
        "highest": noise.highest,
        "model_error": noise.model_error,
        "remark": noise.remark,
        "agreement": {name: _judged(getattr(axis.agreement, name), axis.doubts) for name in axis.agreement.__slots__},
        "data_sheet": None if compared is None else _compared(compared, whole.confidence, axis.doubts),
        "false_alarm": noise.false_alarm,
        "lines": [{name: getattr(line, name) for name in line.__slots__} for line in noise.lines],
        "curve": _rows_of(curve),
        **({"points": _rows_of(every)} if points else {}),
    }


def _rows_of(columns: dict[str, list[float]]) -> list[dict[str, float]]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _judged(figure: Figure, doubts: tuple[Gate, ...]) -> dict[str, object]:
    return {
        "value": figure.value,
        "unit": figure.unit,
        "uncertainty": figure.uncertainty,
        "dof": figure.dof,
        "status": status(doubts, figure.status.value),
    }


def _compared(compared: Comparison, confidence: float, doubts: tuple[Gate, ...]) -> dict[str, object]:
    low, high = _interval(compared.ratio, confidence)
    return {
        "density": compared.sheet,
        "ratio": _judged(compared.ratio, doubts),
        "low": low,
        "high": high,
        "suspicious": compared.gate.ok is False,
        "reason": compared.gate.reason,
    }


def _interval(ratio: Figure, confidence: float) -> tuple[float, float]:
    """Return the ends of the interval of a density whose square has a chi-square distribution."""
    import numpy as np  # noqa: PLC0415 - start-up stays light

    if ratio.status is not FigureStatus.MEASURED or not math.isfinite(ratio.dof):
        return math.nan, math.nan
    low, high = interval(np.array([ratio.value**2]), np.array([ratio.dof]), confidence)
    return math.sqrt(low[0]), math.sqrt(high[0])


def as_text(result: Result) -> str:
    """Return the result as plain text: for each column its spectrum, its lines and its noise."""
    known = [gate for gate in result.log.gates if gate.ok is False]
    known += [axis.comparison.gate for axis in result.axes if axis.comparison and axis.comparison.gate.ok is False]
    doubts = {gate for axis in result.axes for gate in axis.doubts}
    told = [f"{'INCONCLUSIVE' if gate in doubts else 'note'}: {gate}" for gate in known]
    lines = [*heading(result.log), *told, *(f"note: {remark}" for remark in result.log.remarks)]
    for axis in result.axes:
        lines += ["", *_how(axis), *_table(axis), *_lines(axis.noise), *_summary(axis)]
    return "\n".join(fitting(lines, _WIDTH))


def _how(axis: Axis) -> Iterator[str]:
    whole = axis.noise.spectrum
    yield f"{called(axis.name)}: one-sided power spectral density in {squared(whole.unit)}; two-sided: half"
    yield (
        f"Welch: {whole.segments} segments of {whole.segment} samples ({whole.segment / whole.rate:.4g} s), "
        f"overlap {1.0 - whole.step / whole.segment:.0%}, window {whole.window}, "
        f"{_TAKEN_OFF[whole.detrend]} taken off each; equivalent noise bandwidth {whole.bandwidth:.4g} Hz, "
        f"{whole.edf[1]:.1f} degrees of freedom a point; intervals at {whole.confidence:.4g}"
    )


def _table(axis: Axis) -> list[str]:
    bands = axis.noise.bands
    columns = (bands.frequency, bands.density, bands.low, bands.high, bands.edf)
    rows = list(zip(*(column[::_SHOWN].tolist() for column in columns), strict=True))
    cells = [
        (f"{at:.5g}", f"{density:.4e}", f"{low:.4e}", f"{high:.4e}", f"{edf:.0f}", f"{math.sqrt(density):.4e}")
        for at, density, low, high, edf in rows
    ]
    return aligned(cells, head=("band [Hz]", "density", "low", "high", "edf", "root of density"), right=range(6))


def _lines(noise: SpectralNoise) -> Iterator[str]:
    sure = f"noise alone gives one with probability {noise.false_alarm:g}"
    if not noise.lines:
        yield f"lines: none ({sure})"
        return
    yield f"lines, left out of bands and coefficients ({sure}):"
    for line in noise.lines:
        yield f"  {_line(line)}"


def _line(line: Line) -> str:
    parts = [stated(line.frequency), f"amplitude {stated(line.amplitude)}", f"{line.height:.3g} times the noise"]
    parts.append(f"false alarm {line.false_alarm:.1e}" if line.false_alarm > 1e-99 else "false alarm below 1e-99")
    parts += [] if line.narrow else ["wider than a sine"]
    return ", ".join([*parts, line.origin] if line.origin else parts)


def _summary(axis: Axis) -> Iterator[str]:
    noise = axis.noise
    figures = [(label, getattr(noise, term)) for term, label in _TERMS.items()]
    yield from aligned(
        (label, "-" if axis.doubts else stated(figure), status(axis.doubts, figure.status.value))
        for label, figure in figures
    )
    if axis.comparison is not None:
        yield from _beside(axis.comparison, noise)
    if axis.doubts:
        yield f"inconclusive: {'; '.join(gate.name for gate in axis.doubts)}; see above"
    else:
        yield from _agreement(axis)
    if math.isfinite(noise.chi):
        error = f", model error {noise.model_error:.0%} allowed for" if noise.model_error else ""
        yield f"fit: chi {noise.chi:.2f} from {noise.lowest:.4g} to {noise.highest:.4g} Hz{error}"
    if noise.remark:
        yield f"note: {noise.remark}"


def _beside(compared: Comparison, noise: SpectralNoise) -> Iterator[str]:
    low, high = _interval(compared.ratio, noise.spectrum.confidence)
    sheet = Figure(value=compared.sheet, unit=noise.density.unit)
    verdict = "suspicious" if compared.gate.ok is False else "as expected"
    shown = f"ratio {compared.ratio.value:.4g}, from {low:.4g} to {high:.4g}: {verdict}"
    if not math.isfinite(low):
        shown = compared.gate.reason
    yield f"data sheet: {stated(sheet)}, one-sided; {shown}"


def _agreement(axis: Axis) -> Iterator[str]:
    found = {name.replace("_", " "): getattr(axis.agreement, name) for name in axis.agreement.__slots__}
    known = [
        f"{label} {stated(ratio).removesuffix(' 1')}"
        for label, ratio in found.items()
        if ratio.status is FigureStatus.MEASURED
    ]
    yield f"over those of the Allan deviation: {', '.join(known) or 'no coefficient is measured by both'}"
