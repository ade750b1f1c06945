"""Least-squares fit of a photodiode's readings: initial estimate, steps, and covariance of the result."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hil.analysis.photodiode.diode import ELECTRONVOLTS, KELVIN, Array, Diode
from hil.analysis.photodiode.readings import Known, Readings
from hil.analysis.statistics import correlation_time

__all__ = ["CORE", "Fit", "moved", "settled", "started"]

CORE = 5
"""Number of parameters always fitted: ln P, a, ln I_s0, n and E_g. G and Rs are estimated afterwards."""

_ROUNDS, _SETTLED, _STRIDE = 60, 1e-10, 1.5
_GAP, _LEAST_IDEALITY, _LEAST_EV = 4, 0.1, 1e-6  # its index; lower bound of steps; uncertainty of an exactly known gap


def started(given: Readings, blank: Diode) -> Diode:
    """Return the initial estimate: no diode current at the smallest load; n and I_s0 from high and middle voltages."""
    current = given.voltage / given.load / given.light
    photocurrent = float(current.max()) * 1.001
    best, least = blank, math.inf
    for ideality in np.linspace(1.0, 2.2, 13).tolist():
        trial = replace(blank, photocurrent=photocurrent, ideality=ideality)
        missing = np.maximum(photocurrent * given.light - given.voltage / given.load, 1e-4 * photocurrent)
        exponent = given.voltage / (ideality * ELECTRONVOLTS * (given.temperature + KELVIN))
        shape = trial.saturation_at(given.temperature) * np.expm1(exponent)
        trial = replace(trial, saturation=float(np.exp(np.median(np.log(missing / shape)))))
        off = np.square(given.voltage - trial.voltage_of(given.light, given.temperature, given.load)).sum()
        if off < least:
            best, least = trial, float(off)
    return best


def settled(given: Readings, start: Diode, asked_for: tuple[int, float, float]) -> tuple[Diode, bool]:
    """Return the least-squares diode, and whether the steps converged.

    Args:
        given: the readings.
        start: initial estimate.
        asked_for: number of fitted parameters, weight of the prior gap as a reading in V/eV, and that gap in eV.
    """
    diode, (count, weight, gap) = start, asked_for
    place = (given.light, given.temperature, given.load)

    def off(which: Diode) -> Array:
        return np.append(given.voltage - which.voltage_of(*place), weight * (gap - which.gap))

    for _ in range(_ROUNDS):
        about = diode.linearised(*place)
        residual = np.append(given.voltage - about.voltage, weight * (gap - diode.gap))
        least = float(residual @ residual)
        design = _with_gap(about.jacobian, weight)[:count]
        scale = np.sqrt(np.square(design).sum(axis=1))
        if not (np.isfinite(design).all() and (scale > 0.0).all()):
            return diode, False
        step = np.linalg.lstsq((design / scale[:, None]).T, residual, rcond=1e-12)[0] / scale
        if float((step @ design) @ residual) <= _SETTLED * least:  # expected reduction of the sum of squares
            return diode, True
        step = step * min(1.0, _STRIDE / max(abs(step[0]), abs(step[2]), abs(step[3]) * 4.0))
        for _ in range(_ROUNDS):
            nearer = moved(diode, step)
            if nearer.ideality > _LEAST_IDEALITY and float(np.square(off(nearer)).sum()) <= least:
                break
            step = step / 2.0
        else:
            return diode, True  # no further improvement: rounding
        diode = nearer
    return diode, False


def _with_gap(jacobian: Array, weight: float) -> Array:
    """Return the Jacobian with a row for the prior gap as a reading."""
    last = np.zeros((len(jacobian), 1))
    last[_GAP] = weight
    return np.hstack([jacobian, last])


def moved(diode: Diode, step: Array) -> Diode:
    """Return the diode after a step in ln P, a, ln I_s0, n, and in E_g and G where the step has them."""
    return replace(
        diode,
        photocurrent=diode.photocurrent * math.exp(step[0]),
        coefficient=diode.coefficient + float(step[1]),
        saturation=diode.saturation * math.exp(step[2]),
        ideality=diode.ideality + float(step[3]),
        gap=diode.gap + (float(step[_GAP]) if len(step) > _GAP else 0.0),
        shunt=diode.shunt + (float(step[CORE]) if len(step) > CORE else 0.0),
    )


class Fit:
    """A converged fit: its covariance, and estimates of shunt and series resistance by one more step."""

    def __init__(self, given: Readings, diode: Diode, known: Known, *, shunted: bool = False) -> None:
        self.given, self.diode, self.shunted = given, diode, shunted
        count = CORE + shunted
        about = diode.linearised(given.light, given.temperature, given.load)
        self.residual = given.voltage - about.voltage
        self.dof = float(len(self.residual) - count)
        self.noise = math.sqrt(float(self.residual @ self.residual) / self.dof)
        tau = correlation_time(self.residual) if self.noise > 0.0 else 1.0
        self.dof = max(1.0, self.dof / tau)
        errors = [given.voltage * known.reference, np.full(len(given.voltage), known.offset)]
        errors += [np.where(given.load == ohms, about.by_load * known.load, 0.0) for ohms in np.unique(given.load)]
        errors.append(about.by_temperature * known.temperature)
        self.weight = self.noise * math.sqrt(tau) / max(known.gap_uncertainty, _LEAST_EV)
        self._given = (_with_gap(about.jacobian, self.weight), errors, self.noise * math.sqrt(tau))
        self._off = np.append(self.residual, self.weight * (known.gap - diode.gap))
        self.covariance = self._solved(list(range(count)))[1]
        self.shunt, self.series = (self._asked([*range(CORE), each]) for each in (CORE, CORE + 1))
        if shunted:
            self.shunt = (diode.shunt, math.sqrt(self.covariance[CORE, CORE]))

    def _solved(self, rows: list[int]) -> tuple[Array, Array]:
        """Return the next step in a subset of the parameters, and their covariance."""
        jacobian, errors, noise = self._given
        design = jacobian[rows].T
        scale = np.sqrt(np.square(design).sum(axis=0))
        inverse = np.linalg.pinv(design / scale, rcond=1e-12) / scale[:, None]
        covariance = noise**2 * inverse @ inverse.T
        for error in errors:
            shift = inverse[:, :-1] @ error
            covariance = covariance + np.outer(shift, shift)
        return inverse @ self._off, covariance

    def _asked(self, rows: list[int]) -> tuple[float, float]:
        step, covariance = self._solved(rows)
        return float(step[-1]), math.sqrt(max(0.0, float(covariance[-1, -1])))
