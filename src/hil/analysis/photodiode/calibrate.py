"""Calibration of a photodiode from readings over temperature, load and light, with gates on its validity."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hil.analysis.gates import Gate
from hil.analysis.photodiode.diode import Array, Diode
from hil.analysis.photodiode.fitting import CORE, Fit, moved, settled, started
from hil.analysis.photodiode.readings import Known, Readings, asked, checked
from hil.analysis.statistics import not_observable
from hil.analysis.tracing import traced
from hil.model.figure import Figure, FigureStatus

__all__ = ["PhotodiodeReport", "calibrate_photodiode"]

_UNITS = {"photocurrent": "A", "coefficient": "1/K", "saturation": "A", "ideality": "1", "gap": "eV"}
_ABOUT_MODEL = {"steady", "scatter", "hysteresis"}
_CERTAIN = {"photocurrent": 0.05, "coefficient": 2e-3, "saturation": 0.5, "ideality": 0.05, "gap": math.inf}
"""Largest acceptable standard uncertainty of each result: relative; for the coefficient in 1/K."""
_IDEALITY = (0.9, 2.5)
_SCATTER, _LOOP = 0.005, 0.01  # of the reading: rms residuals, and hysteresis
_SIGNIFICANT = 4.0
_BOUND = 1.96
_WEIGHINGS, _SAME = 12, 0.98
_NUDGES = (1e-4, 1e-6, 1e-4, 1e-4, 1e-4, 1e-9)  # of ln P, a, ln I_s0, n, E_g and G, for derivatives


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotodiodeReport:
    """A calibration, with the quality of its fit.

    Attributes:
        diode: the calibration.
        covariance: (5, 5), of ln P, a, ln I_s0, n and E_g; (6, 6) with G where a shunt was fitted.
        dof: degrees of freedom of the scatter.
        figures: by name: photocurrent [A], coefficient [1/K], saturation [A], ideality, gap [eV], shunt [S] and series
            [ohm].
        noise: scatter of the readings about the model [V].
        hysteresis: heating minus cooling at equal temperature, relative to the reading.
        coldest, hottest: temperature range of the fitted readings [degC].
        residual: (n,), reading minus model, for all readings [V].
        gates: gates on the readings and the result.
        identifiability: which parameters these readings can separate, and which not.
    """

    diode: Diode
    covariance: Array
    dof: float
    figures: Mapping[str, Figure]
    noise: Figure
    hysteresis: float
    coldest: float
    hottest: float
    residual: Array
    gates: tuple[Gate, ...]
    identifiability: str

    @property
    def conclusive(self) -> bool:
        """Whether no gate trips."""
        return all(gate.ok is not False for gate in self.gates)

    @property
    def doubts(self) -> list[str]:
        """The gates that trip, one sentence each."""
        return [str(gate) for gate in self.gates if gate.ok is False]

    @traced
    def sensitivity(self, temperature: float, load: float) -> Figure:
        """Return the temperature sensitivity of the reading in constant light in V/K: equation 6 at the mean light.

        The covariance is propagated (GUM 5.2), with derivatives by central differences.

        Args:
            temperature: temperature [degC].
            load: load resistance [ohm].
        """
        status = self.figures["coefficient"].status
        if not np.isfinite(self.covariance).all():
            return not_observable("V/K")
        size = len(self.covariance)
        steps = [(width * row) for width, row in zip(_NUDGES, np.eye(len(_NUDGES))[:, :size], strict=True)][:size]
        slopes = np.array(
            [
                float(moved(self.diode, step).sensitivity(1.0, temperature, load))
                - float(moved(self.diode, -step).sensitivity(1.0, temperature, load))
                for step in steps
            ]
        ) / (2.0 * np.array(_NUDGES[:size]))
        uncertainty = math.sqrt(float(slopes @ self.covariance @ slopes))
        return _figure(float(self.diode.sensitivity(1.0, temperature, load)), "V/K", uncertainty, self.dof, status)


@traced
def calibrate_photodiode(
    voltage: ArrayLike,
    temperature: ArrayLike,
    load: ArrayLike,
    *,
    light: ArrayLike = 1.0,
    fitted: ArrayLike | None = None,
    known: Known | None = None,
) -> PhotodiodeReport:
    """Fit photocurrent, its temperature coefficient, saturation current, ideality factor and gap; equations in `diode`.

    Least squares of the voltages by Gauss-Newton steps with halving and the analytic Jacobian J; the prior gap is one
    more reading, with its own uncertainty. Covariance s^2 tau (J'J)^-1 + sum (K d_j)(K d_j)' u_j^2 with K = (J'J)^-1
    J', tau the correlation time of the residuals in samples, d_j the effect of an error of `known` on the readings, and
    u_j its standard uncertainty (GUM, 5.1 and H.3). Shunt and series resistance are estimated by one step of a fit that
    includes them: a shunt four standard uncertainties above zero is fitted; otherwise both are reported as bounds at 95
    %, and `series` keeps its value.

    One load in constant light determines neither I_s0 nor n: with I_d constant, equation 4 makes dV/dT =
    (V - E_g - 3 k T/q)/T for any n. A second and a third load, or different light, are needed. Loads at one temperature
    do not separate a from E_g: 0.01 eV equal 0.07 %/K. A small load at two temperatures does.

    Gates: `finite`, `stuck`, `celsius`, `saturated`, `forward`, `lit`, `span`, `converged`, `plausible` and
    `identified` make the figures NOT_OBSERVABLE; `steady`, `scatter` and `hysteresis` make them MODEL_REJECTED.

    Args:
        voltage: voltage across the load in V, shape (n,).
        temperature: junction temperature in degC, shape (n,), in order of time.
        load: load resistance in ohm, shape (n,) or a number.
        light: reading of a light monitor in any unit, shape (n,) or a number; the photocurrent refers to its mean.
        fitted: mask of the readings to fit, shape (n,); all if None. Others only get residuals.
        known: prior knowledge; silicon at 25 degC without any uncertainty if None.

    Raises:
        Refused: array shapes do not match, or there are fewer than 50 readings to fit.
    """
    given, known = checked(voltage, temperature, load, light, fitted), known or Known()
    gates = given.gates(known.full_scale, known.gap)
    start = Diode(photocurrent=1.0, coefficient=0.0, saturation=1.0, ideality=1.0, nominal=known.nominal, gap=known.gap)
    if any(gate.ok is False for gate in gates):
        return _nothing(given, start, gates)
    kept = given.kept
    diode, _ = settled(kept, replace(started(kept, start), series=known.series), (CORE - 1, 0.0, known.gap))
    weight, converged = Fit(kept, diode, known).weight, False
    for _ in range(_WEIGHINGS):  # a wrong gap looks like noise, which gives the prior gap more weight
        diode, converged = settled(kept, diode, (CORE, weight, known.gap))
        fit = Fit(kept, diode, known)
        if fit.weight > _SAME * weight:
            break
        weight = fit.weight
    if fit.shunt[0] > _SIGNIFICANT * fit.shunt[1]:
        diode, converged = settled(kept, diode, (CORE + 1, weight, known.gap))
        fit = Fit(kept, diode, known, shunted=True)
    told = "the fit converged" if converged else "the fit did not converge"
    return _report(
        given,
        fit,
        (
            *gates,
            asked("converged", converged, told, "these are not readings of a photodiode"),
        ),
    )


def _report(given: Readings, fit: Fit, gates: tuple[Gate, ...]) -> PhotodiodeReport:
    diode = fit.diode
    residual = given.voltage - diode.voltage_of(given.light, given.temperature, given.load)
    loop = given.hysteresis(residual)
    values = {name: float(getattr(diode, name)) for name in _UNITS}
    spreads = dict(zip(values, np.sqrt(np.diag(fit.covariance)[:CORE]).tolist(), strict=True))
    vague = [name for name, spread in spreads.items() if not spread <= _CERTAIN[name]]  # NaN is not certain
    gates = (*gates, *_answers(given, diode, residual / given.voltage, vague), _looped(loop))
    spreads["photocurrent"] *= diode.photocurrent
    spreads["saturation"] *= diode.saturation
    status = _status(gates)
    figures = {name: _figure(values[name], unit, spreads[name], fit.dof, status) for name, unit in _UNITS.items()}
    figures["shunt"] = _bound(fit.shunt, "S", fit.dof, status, measured=fit.shunted)
    figures["series"] = _bound((diode.series + fit.series[0], fit.series[1]), "ohm", fit.dof, status, measured=False)
    return PhotodiodeReport(
        diode=diode,
        covariance=fit.covariance,
        dof=fit.dof,
        figures=figures,
        noise=Figure(value=fit.noise, unit="V", uncertainty=fit.noise / math.sqrt(2.0 * fit.dof), dof=fit.dof),
        hysteresis=loop,
        coldest=float(fit.given.temperature.min()),
        hottest=float(fit.given.temperature.max()),
        residual=residual,
        gates=gates,
        identifiability=_said(figures, vague),
    )


def _answers(given: Readings, diode: Diode, share: Array, vague: list[str]) -> tuple[Gate, ...]:
    """Return the gates on the result; `share` is residuals over readings, `vague` lists results too uncertain."""
    low, high = _IDEALITY
    rms = math.sqrt(float(np.square(share).mean()))
    shown = ", ".join(name for name in _UNITS if name not in vague) or "nothing"
    return (
        asked(
            "plausible",
            low <= diode.ideality <= high,
            f"the ideality factor is {diode.ideality:.3g}",
            f"that of a junction is {low:g} to {high:g}: look at loads, reference and temperature",
        ),
        asked(
            "identified",
            not vague,
            f"the readings show {shown}",
            f"they do not show {', '.join(vague)}: read at several loads, or in other light",
        ),
        given.steady(),
        asked(
            "scatter",
            rms <= _SCATTER,
            f"readings differ from the model by {rms:.2%}, rms",
            f"more than {_SCATTER:.1%} is no noise: the model is not that of these readings",
        ),
    )


def _looped(loop: float) -> Gate:
    if math.isnan(loop):
        told = "no temperature was read while heating and while cooling: drift over time looks like temperature"
        return Gate(name="hysteresis", channel="", ok=None, reason=told)
    wrong = f"at most {_LOOP:.0%} is accepted: change the temperature more slowly, and look at lamp and thermometer"
    return asked("hysteresis", abs(loop) <= _LOOP, f"heating minus cooling is {loop:.2%} of the reading", wrong)


def _status(gates: tuple[Gate, ...]) -> FigureStatus:
    tripped = {gate.name for gate in gates if gate.ok is False}
    if tripped - _ABOUT_MODEL:
        return FigureStatus.NOT_OBSERVABLE
    return FigureStatus.MODEL_REJECTED if tripped else FigureStatus.MEASURED


def _figure(value: float, unit: str, uncertainty: float, dof: float, status: FigureStatus) -> Figure:
    known = uncertainty if math.isfinite(uncertainty) else None
    return Figure(value=value, unit=unit, uncertainty=known, dof=dof, status=status)


def _bound(found: tuple[float, float], unit: str, dof: float, status: FigureStatus, *, measured: bool) -> Figure:
    """Return a measured figure, or its bound at 95 %."""
    value, uncertainty = found
    if status is FigureStatus.MEASURED and not measured:
        value, status = max(0.0, value) + _BOUND * uncertainty, FigureStatus.UPPER_LIMIT
    return _figure(value, unit, uncertainty, dof, status)


def _said(figures: Mapping[str, Figure], apart: list[str]) -> str:
    shunt, series = figures["shunt"], figures["series"]
    if apart:
        return f"the readings do not separate {', '.join(apart)}: one load in constant light shows none of n and I_s0"
    bounds = [(shunt, "a shunt", "S"), (series, "a series resistance", "ohm")]
    unseen = [f"{name} below {each.value:.2g} {unit}" for each, name, unit in bounds if _is_bound(each)]
    told = ["the readings separate photocurrent, its coefficient, saturation current and ideality factor"]
    return "; ".join((*told, *([f"they do not show {' or '.join(unseen)}"] if unseen else ())))


def _is_bound(figure: Figure) -> bool:
    return figure.status is not FigureStatus.MEASURED


def _nothing(given: Readings, diode: Diode, gates: tuple[Gate, ...]) -> PhotodiodeReport:
    """Return the report for readings that give no calibration."""
    unknown = replace(diode, photocurrent=math.nan, coefficient=math.nan, saturation=math.nan, ideality=math.nan)
    return PhotodiodeReport(
        diode=unknown,
        covariance=np.full((CORE, CORE), math.nan),
        dof=1.0,
        figures={name: not_observable(unit) for name, unit in {**_UNITS, "shunt": "S", "series": "ohm"}.items()},
        noise=not_observable("V"),
        hysteresis=math.nan,
        coldest=math.nan,
        hottest=math.nan,
        residual=np.full(len(given.voltage), math.nan),
        gates=gates,
        identifiability="the readings show no photodiode",
    )
