"""Flight logs: phases at rest and in rotation, with the performance of gyroscope and magnetometer in each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hil.analysis import quality
from hil.analysis.allan.noise import characterise
from hil.analysis.extremes import saturated
from hil.analysis.gates import Facts, Gate, factor_of, finite, present, repeated, stuck
from hil.analysis.motion import AXES, FEWEST, SURE, Kind, Motions, Run, motions
from hil.analysis.statistics import mean, not_observable
from hil.model.errors import Refused
from hil.model.figure import Figure

__all__ = ["Flight", "Phase", "flight_phases"]

_NOISE = 500  # samples at rest needed for white noise
_MOST = 20  # rests whose white noise is fitted, to limit the computing time
_TURNS = 3.0  # turns needed for a rate from the field
_FLAT = 0.1  # of its radius, out of plane: a field beyond this does not rotate about one axis
_WHOLE = 0.99  # share of a turn's rates that must be present for their integral
_FAST = math.pi / 2.0  # per reading: a faster rotation of the field is ambiguous in sense
_RIPPLE = 0.03  # of the field, rms: less for a calibrated magnetometer in a constant field
_LARGEST = 10.0  # deg/s: larger than the bias of any small gyroscope
_WANDER = 0.01  # of the field: largest difference between the thirds of a rest for a constant field
_THIRDS = 3
_INNER = 5  # windows of a motion from which the first and last are ignored
_EARTH = (15.0, 75.0)  # uT: the Earth's field from the ground to low orbits
_OFF = 0.1  # tolerance between the sensors: uncalibrated scale, alignment and iron

_Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Phase:
    """A phase of a log: one kind of motion.

    Attributes:
        kind: kind of motion.
        first, last: its first and last sample, counted from 0.
        begin, end: times in s after the first sample, to within a window.
        rates: mean reading of each axis: at rest the bias.
        white: two-sided white noise of each axis at rest, from the Allan deviation; not observable otherwise.
        turning: rms magnitude of the rate without bias and noise; not observable at rest, or below twice its
            uncertainty. The first and last window of a motion, in which it may have begun or ended, are ignored if
            there are at least five.
        field: mean magnitude of the field, None without a magnetometer.
        ripple: relative standard deviation of that magnitude; small in a rotation for calibrated magnetometers.
        turns: number of turns of the field about one axis; not observable for other motion, or too few turns.
        agreement: turns by the rates over turns by the field, minus 1.
        gates: every gate with its result.
        remark: anomaly, in a sentence, or empty.
    """

    kind: Kind
    first: int
    last: int
    begin: float
    end: float
    rates: tuple[Figure, ...] = ()
    white: tuple[Figure, ...] = ()
    turning: Figure | None = None
    field: Figure | None = None
    ripple: Figure | None = None
    turns: Figure | None = None
    agreement: Figure | None = None
    gates: tuple[Gate, ...] = ()
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """Analysis of a flight log.

    Attributes:
        unit: unit of the rates.
        window: length of a window [s], the resolution of beginnings and ends.
        bias: bias of each axis, the median of the windows at rest; zeros if there was no rest.
        noise: standard deviation of a sample of each axis.
        phases: phases in order of time.
        remarks: remarks in sentences.
    """

    unit: str
    window: float
    bias: tuple[float, ...]
    noise: tuple[float, ...]
    phases: tuple[Phase, ...]
    remarks: tuple[str, ...]


def flight_phases(  # noqa: PLR0913 - two sensors, each with what is known of it
    rates: ArrayLike,
    rate: float,
    unit: str,
    *,
    still: float,
    radians: float,
    field: ArrayLike | None = None,
    field_unit: str = "uT",
    field_rate: float | None = None,
    microtesla: float = math.nan,
    window: float = 2.0,
    shortest: float = 10.0,
    facts: Facts | None = None,
    field_facts: Facts | None = None,
) -> Flight:
    """Find the phases of a flight log, and assess each.

    Args:
        rates: readings of the gyroscope, shape (n, 3), evenly spaced; NaN marks a missing sample.
        rate: sampling rate [Hz].
        unit: unit of the rates.
        still: largest change of bias within the log, in `unit`: slower rotations are detected by the field only.
        radians: one `unit` in rad/s, NaN if unknown.
        field: readings of the magnetometer, shape (n, 3), at the same times; NaN where it has none.
        field_unit: unit of the field.
        field_rate: sampling rate of the magnetometer [Hz], if lower than the gyroscope's.
        microtesla: one `field_unit` in uT, NaN if unknown.
        window: length of a window [s].
        shortest: shortest phase reported [s].
        facts, field_facts: known properties of the sensors, for the gates.

    Raises:
        Refused: the log is too short for ten windows, or no window has readings of both sensors.
    """
    table = np.asarray(rates, dtype=np.float64)
    vectors = None if field is None else np.asarray(field, dtype=np.float64)
    every = max(round(rate / (field_rate or rate), 2), 1.0)  # estimates of one rate differ by less than this rounding
    width = max(math.ceil(FEWEST * every), round(window * rate))
    # If windows had to be lengthened, a single one in which a motion begins is not a phase.
    least = max(2 if every > 1.0 and width > round(window * rate) else 1, round(shortest * rate / width))
    seen = _seen(table, vectors, width, least, still=still, every=every, lasts=width / rate)
    logged = _Logged(
        rates=table, field=vectors, rate=rate, unit=unit, field_unit=field_unit, radians=radians, bias=seen.bias,
        noise=seen.noise, width=width, every=every,
        facts=facts or Facts(), field_facts=field_facts or Facts(),
    )  # fmt: skip
    lasting = sorted((each for each in seen.runs if each.kind is Kind.REST), key=lambda each: each.first - each.after)
    phases = [logged.phase(each, noise=each in lasting[:_MOST]) for each in seen.runs]
    return Flight(
        unit=unit,
        window=width / rate,
        bias=tuple(seen.bias.tolist()),
        noise=tuple(seen.noise.tolist()),
        phases=tuple(phases),
        remarks=(
            *_remarks(calm=seen.calm, alone=vectors is None, still=f"{still:g} {unit}"),
            *(() if vectors is None else _no_earth(vectors, microtesla)),
            *([f"white noise is told of the {_MOST} longest of {len(lasting)} rests"] if len(lasting) > _MOST else []),
        ),
    )


def _seen(
    table: _Array, vectors: _Array | None, width: int, least: int, *, still: float, every: float, lasts: float
) -> Motions:
    """Separate rest from motion; refuse a log of too few windows, or without a complete one."""
    if len(table) < FEWEST * width:
        raise Refused(
            f"{len(table) * lasts / width:.4g} s are less than {FEWEST} windows of {lasts:.3g} s",
            "take a longer log, or a shorter window",
        )
    seen = motions(table, vectors, width, still=still, shortest=least, every=every)
    if all(each.kind is Kind.MISSING for each in seen.runs):
        raise Refused(
            f"no window of {lasts:.3g} s has half of the samples of every column",
            "choose another part of the log, or look at the columns one by one",
        )
    return seen


def _remarks(*, calm: bool, alone: bool, still: str) -> Iterator[str]:
    if not calm:
        yield "nothing was at rest: the rates hold the bias"
    if alone:
        yield f"without a magnetometer a steady turn of less than {still} is taken for rest"


def _no_earth(vectors: _Array, microtesla: float) -> Iterator[str]:
    sizes = present(np.sqrt(np.square(vectors).sum(axis=1))) * microtesla
    size = float(np.median(sizes)) if sizes.size else math.nan
    low, high = _EARTH
    if math.isfinite(size) and not low <= size <= high:
        yield f"the field has {size:.3g} uT, the earth's {low:g} to {high:g}: check columns, unit and what is near"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Logged:
    """The whole log, for assessing its phases."""

    rates: _Array
    field: _Array | None
    rate: float
    unit: str
    field_unit: str
    radians: float
    bias: _Array
    noise: _Array
    width: int
    every: float
    facts: Facts
    field_facts: Facts

    def phase(self, run: Run, *, noise: bool) -> Phase:
        """Return the phase of a run, with or without its white noise."""
        kind, first, after = run.kind, run.first, run.after
        bare = Phase(kind=kind, first=first, last=after - 1, begin=first / self.rate, end=after / self.rate)
        if kind is Kind.MISSING:
            return bare
        part = self.rates[first:after]
        found = replace(
            bare,
            rates=tuple(mean(present(column), self.unit) for column in part.T),
            white=tuple(self._white(column, told=noise) for column in part.T) if kind is Kind.REST else (),
            turning=not_observable(self.unit) if kind is Kind.REST else self._turning(part),
            gates=_gates("rate", part, self.facts, self.rate, at_rest=kind is Kind.REST),
        )
        if kind is Kind.REST and math.isfinite(self.radians):
            found = replace(found, gates=(*found.gates, *_likely(found.rates, math.degrees(self.radians))))
        return found if self.field is None else self._with_field(found, self.field[first:after], still=run.still_field)

    def _turning(self, part: _Array) -> Figure:
        inner = part[self.width : -self.width] if len(part) >= _INNER * self.width else part
        away = present(np.sqrt(np.square(inner - self.bias).sum(axis=1)))
        size = float(away.max()) if away.size else 0.0  # scaled, or squares of squares would overflow
        if not size > 0.0:
            return not_observable(self.unit)
        squares = mean(np.square(away / size), "1")
        turning = squares.value - float(np.square(self.noise / size).sum())
        if squares.uncertainty is None or not turning > 2.0 * squares.uncertainty:
            return not_observable(self.unit)
        rms = math.sqrt(turning)
        doubt = size * squares.uncertainty / (2.0 * rms)
        return Figure(value=size * rms, unit=self.unit, uncertainty=doubt, dof=squares.dof)

    def _white(self, column: _Array, *, told: bool) -> Figure:
        if not told or present(column).size < _NOISE:
            return not_observable(f"{self.unit}/sqrt(Hz)")
        return characterise(column, self.rate, self.unit, holes=True).white

    def _with_field(self, found: Phase, vectors: _Array, *, still: bool) -> Phase:
        size = present(np.sqrt(np.square(vectors).sum(axis=1)))
        middle = mean(size, self.field_unit)
        ripple = float(size.std()) / middle.value if middle.value > 0.0 else math.nan
        turns, agreement = self._turned(found, vectors)
        return replace(
            found,
            field=middle,
            ripple=Figure(value=ripple, unit="1"),
            turns=turns,
            agreement=agreement,
            gates=(
                *found.gates,
                *_gates("field", vectors, self.field_facts, self.rate / self.every, at_rest=found.kind is Kind.REST),
                _filled(vectors),
                _stands(vectors, middle) if found.kind is Kind.REST else _agrees(agreement),
            ),
            remark=_odd(found.kind, still_field=still, turned=turns.value, ripple=ripple),
        )

    def _turned(self, found: Phase, vectors: _Array) -> tuple[Figure, Figure]:
        """Return the turns of the field about one axis, and the turns by the rates over these, minus 1.

        The plane of rotation is that of the two largest principal components; the gyroscope is not used for it.
        """
        nothing = not_observable("1"), not_observable("1")
        rates = self.rates[found.first : found.last + 1] - self.bias
        whole, here = np.isfinite(vectors).all(axis=1), np.isfinite(rates).all(axis=1)
        if found.kind is Kind.REST or whole.sum() < FEWEST or here.mean() < _WHOLE:
            return nothing
        arm = vectors[whole] - vectors[whole].mean(axis=0)
        _, sizes, axes = np.linalg.svd(arm, full_matrices=False)
        if not sizes[1] > 0.5 * sizes[0] or sizes[2] > _FLAT * sizes[0]:
            return nothing
        angle = np.unwrap(np.arctan2(arm @ axes[1], arm @ axes[0]))
        steps = np.diff(np.flatnonzero(whole))
        if np.median(np.abs(np.diff(angle)) / steps) * steps.max() > _FAST:
            return nothing
        # The field rotates opposite to the sensor; a right-handed normal makes both signs equal.
        normal = np.cross(axes[0], axes[1])
        about, seconds = -(rates[here] @ normal) * self.radians, np.flatnonzero(here) / self.rate
        summed = np.concatenate(([0.0], np.cumsum((about[1:] + about[:-1]) / 2.0 * np.diff(seconds))))
        turned = np.interp(np.flatnonzero(whole) / self.rate, seconds, summed)
        total = float(angle[-1] - angle[0])
        if abs(total) < _TURNS * 2.0 * math.pi:
            return nothing
        turns = Figure(value=abs(total) / (2.0 * math.pi), unit="1")
        if not math.isfinite(self.radians):
            return turns, not_observable("1")
        factor, offset = np.polyfit(angle, turned, 1)
        rms = float(np.std(turned - factor * angle - offset))
        # The residual is not noise: it repeats every turn, so that only its ends count.
        return turns, Figure(value=float(factor) - 1.0, unit="1", uncertainty=math.sqrt(2.0) * rms / abs(total))


def _odd(kind: Kind, *, still_field: bool, turned: float, ripple: float) -> str:
    if kind is Kind.ROTATION and still_field:
        return "the field stands still: a turn about it, or a bias that drifted"
    if kind is Kind.UNSTEADY and turned > 0.0:
        return "the field turns, and the rates say little of it"
    if kind is not Kind.REST and ripple > _RIPPLE:
        return f"the field's magnitude varies by {ripple:.1%}, rms, as it turns: calibrate the magnetometer"
    return ""


def _gates(sensor: str, part: _Array, facts: Facts, rate: float, *, at_rest: bool) -> tuple[Gate, ...]:
    """Return the gates of a phase: all gates of a log at rest, or those applicable to a rotation."""
    whole = part[np.isfinite(part).all(axis=1)]
    channels = {f"{sensor} {axis}": np.ascontiguousarray(whole[:, place]) for place, axis in enumerate(AXES)}
    infinite = [
        finite(f"{sensor} {axis}", column[~np.isnan(column)]) for axis, column in zip(AXES, part.T, strict=True)
    ]
    if at_rest:
        return (*infinite, *quality.read(channels, facts, rate))
    each = [gate for name, values in channels.items() for gate in (stuck(name, values), saturated(name, values, facts))]
    return (*infinite, repeated(channels), *each)


def _likely(rates: tuple[Figure, ...], degrees: float) -> Iterator[Gate]:
    """Trip where the reading at rest is too large for a bias: a steady spin is as quiet as rest."""
    for axis, figure in zip(AXES, rates, strict=True):
        size = abs(figure.value) * degrees
        reason = f"it reads {size:.3g} deg/s, more than a bias is: a steady turn about the field, or another unit"
        if size > _LARGEST:
            yield Gate(name="bias", channel=f"rate {axis}", ok=False, reason=reason)


def _filled(vectors: _Array) -> Gate:
    """Trip where the field is zero in all axes: no sensor reads that, but programs fill empty cells with it."""
    zeros = int(np.count_nonzero((vectors == 0.0).all(axis=1)))
    reason = f"{zeros} readings are zero in all axes: where there is no reading, leave the cells empty"
    return Gate(name="filled", channel="", ok=not zeros, reason=reason if zeros else "no reading is zero in all axes")


def _stands(vectors: _Array, middle: Figure) -> Gate:
    """Trip where the field rotated in a rest, too slowly for any window to show, so that the bias includes it."""
    whole = vectors[np.isfinite(vectors).all(axis=1)]
    if len(whole) < _THIRDS * FEWEST:
        return Gate(name="stands", channel="", ok=None, reason="too few samples have the field of all axes")
    parts = np.array_split(whole, _THIRDS)
    means = np.array([part.mean(axis=0) for part in parts])
    doubt = float(max(np.linalg.norm(np.diff(part, axis=0).std(axis=0)) / math.sqrt(2.0 * len(part)) for part in parts))
    moved = max(float(np.linalg.norm(means[one] - means[other])) for one, other in ((0, 1), (1, 2), (0, 2)))
    angle = math.degrees(moved / middle.value) if middle.value > 0.0 else 0.0
    reason = (
        f"its field turned by {angle:.2g} deg from one third to another: the bias holds a slow turn, unless the field"
    )
    ok = moved <= max(_WANDER * middle.value, SURE * math.sqrt(2.0) * doubt)
    return Gate(name="stands", channel="", ok=ok, reason=f"{reason} itself did")


def _agrees(agreement: Figure) -> Gate:
    """Trip where rates and field disagree on the turns; name the factor if it is a known one."""
    name, ratio = "agrees", 1.0 + agreement.value
    if not math.isfinite(ratio):
        return Gate(name=name, channel="", ok=None, reason="no turn about one axis that the field could tell")
    reason = f"the rates turn {ratio:.4g} times as far as the field"
    known = factor_of(abs(ratio))
    ok = abs(ratio - 1.0) <= max(_OFF, SURE * (agreement.uncertainty or 0.0))
    if ratio < 0.0 and abs(ratio + 1.0) <= _OFF:
        known = "the axes of one sensor are left-handed, or one sign is wrong"
    return Gate(name=name, channel="", ok=ok, reason=f"{reason}: {known}" if known and not ok else reason)
