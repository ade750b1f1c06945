"""Readings of a photodiode, prior knowledge about them, and gates on them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis.gates import Gate, celsius, finite, numbers, stuck
from hil.analysis.photodiode.diode import SILICON, Array
from hil.analysis.tracing import traced
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["Known", "Readings", "asked", "checked", "volts"]

_SPAN_K = 10.0
_STEADY = 0.05  # of the light
_FEWEST, _FEWEST_OF_CELL = 50, 5  # least readings: in total, and per kelvin for comparing heating and cooling
_TOP = 0.9995  # of the full scale
_LEAST_V = 0.005  # least voltage of an illuminated reading
_WIDTH, _MOVING = 21, 0.05  # readings per temperature average; share of its fastest change


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Prior knowledge of a photodiode and its readings.

    The uncertainties are standard ones common to all readings, taken as exact (GUM 4.3), and propagated by the fit.

    Attributes:
        nominal: reference temperature of the figures [degC].
        gap, gap_uncertainty: energy gap of the semiconductor with its standard uncertainty [eV], used as a prior
            where the readings do not determine it better.
        series: series resistance of the photodiode [ohm].
        full_scale: full scale of the converter [V].
        reference: relative uncertainty of the converter's reference voltage.
        offset: uncertainty of the converter's zero [V].
        load: relative uncertainty of each load resistor; different loads are independent.
        temperature: uncertainty of the thermometer [K].
    """

    nominal: float = 25.0
    gap: float = SILICON
    gap_uncertainty: float = 0.03
    series: float = 0.0
    full_scale: float = math.inf
    reference: float = 0.0
    offset: float = 0.0
    load: float = 0.0
    temperature: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """Voltages [V], temperatures [degC], loads [ohm], light of mean 1, and the mask of fitted readings; each (n,)."""

    voltage: Array
    temperature: Array
    load: Array
    light: Array
    fitted: NDArray[np.bool_]

    @property
    def kept(self) -> Readings:
        """The fitted readings."""
        which, (volts, ohms) = self.fitted, (self.voltage[self.fitted], self.load[self.fitted])
        degrees, light = self.temperature[which], self.light[which]
        return Readings(voltage=volts, temperature=degrees, load=ohms, light=light, fitted=which[which])

    def gates(self, full_scale: float, gap: float) -> tuple[Gate, ...]:
        """Return the gates on the readings before the fit; full scale in V, gap in eV."""
        whole = [finite(name, getattr(self, name)) for name in ("voltage", "temperature", "light")]
        if not all(gate.ok for gate in whole):
            return tuple(whole)
        span = float(np.ptp(self.temperature[self.fitted]))
        high = np.flatnonzero(self.voltage >= _TOP * full_scale)
        dim = np.flatnonzero((self.voltage <= _LEAST_V) | (self.light <= 0.0))
        most = float(self.voltage.max())
        units = f"a junction never reaches the {gap:g} V of its gap: look at the unit, and at what was connected"
        wires = "look at the lamp, and at the photodiode and its wires: shorted, open, or the wrong way round"
        return (
            *whole,
            stuck("temperature", self.temperature),
            celsius("temperature", self.temperature),
            asked("span", span >= _SPAN_K, f"the temperatures span {span:.1f} K", f"{_SPAN_K:g} K are needed"),
            asked("saturated", not high.size, f"{high.size} readings are at full scale", "take less light", high),
            asked("forward", most < gap, f"the readings reach {most:.3g} V", units),
            asked("lit", not dim.size, f"{dim.size} readings show no light", wires, dim),
        )

    def steady(self) -> Gate:
        """Return the gate on the monitored light, which is corrected for, but varies little for a sound lamp."""
        change = float(np.ptp(np.quantile(self.light, [0.01, 0.99])))
        wrong = f"more than {_STEADY:.0%} is no constant lamp: let it warm up, and look at its supply"
        return asked("steady", change <= _STEADY, f"the light changed by {change:.1%}", wrong)

    def hysteresis(self, residual: Array) -> float:
        """Return the mean residual of heating minus cooling, relative to the reading; NaN if no kelvin has both."""
        if self.temperature.size < 2 * _WIDTH:
            return math.nan
        smooth = np.convolve(self.temperature, np.ones(_WIDTH) / _WIDTH, "valid")
        moving = np.gradient(np.pad(smooth, _WIDTH // 2, "edge"))
        least, share = _MOVING * float(np.abs(moving).max()), residual / self.voltage
        _, cell = np.unique(np.stack([self.load, np.floor(self.temperature)]), axis=1, return_inverse=True)
        counts, sums = [], []
        for leg in (moving > least, moving < -least):
            counts.append(np.bincount(cell[leg], minlength=cell.max() + 1))
            sums.append(np.bincount(cell[leg], share[leg], minlength=cell.max() + 1))
        both = (counts[0] >= _FEWEST_OF_CELL) & (counts[1] >= _FEWEST_OF_CELL)
        if not both.any():
            return math.nan
        return float((sums[0][both] / counts[0][both] - sums[1][both] / counts[1][both]).mean())


@traced
def volts(counts: ArrayLike, reference: Figure, full_scale: Figure) -> Array:
    """Return the voltages in V of a converter's counts, counts / full scale * reference, in the shape of `counts`.

    Args:
        counts: counts in LSB; means of several conversions need not be whole.
        reference: voltage at full scale in V; its uncertainty is common to all voltages, see `Known.reference`.
        full_scale: full-scale count in LSB, 4095 for twelve bits.
    """
    return np.asarray(np.asarray(counts, dtype=np.float64) * (reference.value / full_scale.value))


def checked(
    voltage: ArrayLike, temperature: ArrayLike, load: ArrayLike, light: ArrayLike, fitted: ArrayLike | None
) -> Readings:
    """Return validated readings; arguments as for `calibrate_photodiode`.

    Raises:
        Refused: array shapes do not match, or there are too few readings.
    """
    volts = np.array(voltage, dtype=np.float64)
    if volts.ndim != 1:
        raise Refused(f"the voltages have shape {volts.shape}, not (n,)", "give one per reading")
    try:
        degrees, ohms, lit = (
            np.array(np.broadcast_to(each, volts.shape), dtype=np.float64) for each in (temperature, load, light)
        )
        which = np.array(np.broadcast_to(True if fitted is None else fitted, volts.shape), dtype=bool)
    except ValueError:
        told = "voltages, temperatures, loads and light have different shapes"
        raise Refused(told, "give one of each per reading") from None
    if not (np.isfinite(ohms) & (ohms > 0.0)).all():
        raise Refused("a load is not above zero ohm", "give the resistance that the voltage is read at")
    if which.sum() < _FEWEST:
        raise Refused(f"{which.sum()} readings are fewer than the {_FEWEST} that show a calibration", "read more")
    mean = float(lit.mean())
    return Readings(voltage=volts, temperature=degrees, load=ohms, light=lit / mean if mean else lit, fitted=which)


def asked(name: str, ok: bool, told: str, wrong: str, places: NDArray[np.intp] | None = None) -> Gate:
    """Return a gate with its finding `told`, or the remedy `wrong` if it trips; indices are counted from 0."""
    samples = () if places is None else numbers(places)
    return Gate(name=name, channel="", ok=bool(ok), reason=told if ok else f"{told}; {wrong}", samples=samples)
