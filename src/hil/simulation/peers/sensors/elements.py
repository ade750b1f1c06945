"""True properties of a simulated sensor: bias, scale, misalignment and noise of its elements, and temperature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, cast

import numpy as np
from numpy.typing import NDArray

from hil.analysis.noise.numbers import RandomStream
from hil.analysis.noise.rate_noise import NoiseLevels, RateNoise
from hil.clock.port import NANOSECONDS
from hil.model.notation import Number, number, vector
from hil.simulation.faults import Drifting, Saturated
from hil.simulation.peers.model import PeerSetup
from hil.simulation.seeds import Seeds

__all__ = [
    "AXES",
    "AccelerationTruth",
    "AxesElement",
    "AxesTruth",
    "Die",
    "DieTruth",
    "FieldElement",
    "FieldTruth",
    "LevelsTruth",
    "RateTruth",
    "limited",
]

AXES = "xyz"

_MISALIGNED = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
_REFERENCE = 25.0

_NOTHING, _QUIET = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
_Vector = Annotated[tuple[float, float, float], vector(3)]
_Levels = Annotated[tuple[float, float, float], vector(3, minimum=0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class DieTruth:
    """What a sensor's temperature is where no plant says it [degC], and what the reading is off [K]."""

    temperature: Annotated[float, number(-40)] = _REFERENCE
    temperature_offset: Number = 0.0


class Die:
    """A sensor's temperature.

    Args:
        setup: of the peer: its truth says `temperature` [degC] and `temperature_offset` [K], which is what the reading
            is off; the terminal `temperature` goes to a plant's signal instead of the first.
        most: the highest temperature of the data sheet [degC]; the lowest is -40.
    """

    def __init__(self, setup: PeerSetup, *, most: float) -> None:
        own = setup.truth.part(DieTruth)
        if own.temperature > most:
            setup.truth.wrong("temperature", f"'temperature' must be at most {most:g}, found '{own.temperature:g}'")
        self._truth, self._offset = own.temperature, own.temperature_offset
        self._point = setup.connections.signal("temperature")

    def many(self, times_ns: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return its temperature at rising instants in degC."""
        if self._point is None:
            return np.full(times_ns.size, self._truth)
        return self._point.observe_many(times_ns)

    def counts(self, degrees: NDArray[np.float64], per_kelvin: float) -> NDArray[np.float64]:
        """Return counts of these temperatures, 0 at 25 degC, not yet rounded."""
        return (degrees + self._offset - _REFERENCE) * per_kelvin

    def counts_at(self, at_ns: int, per_kelvin: float) -> float:
        """Return counts of the temperature at an instant, 0 at 25 degC, not yet rounded."""
        degrees = self._point.observe_at(at_ns) if self._point else self._truth
        return (degrees + self._offset - _REFERENCE) * per_kelvin


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelsTruth:
    """Levels of each noise per axis, see `NoiseLevels`."""

    white: _Levels = _NOTHING
    flicker: _Levels = _NOTHING
    random_walk: _Levels = _NOTHING
    quantisation: _Levels = _NOTHING


@dataclass(frozen=True, slots=True, kw_only=True)
class AxesTruth(LevelsTruth):
    """Truth of three elements. Polynomials are in die temperature relative to 25 degC, lowest power first.

    By default there are no errors. `unit` is deg/s of a gyroscope, m/s2 of an accelerometer, uT of a magnetometer.

    Attributes:
        bias_x, bias_y, bias_z: three coefficients each [unit, unit/K, unit/K^2].
        scale_x, scale_y, scale_z: three coefficients each of the relative error [1, 1/K, 1/K^2].
        misalignment: xy, xz, yx, yz, zx, zy: how much of what the second axis sees the first one sees, too [rad].
        white, flicker, random_walk, quantisation: see `LevelsTruth`.
    """

    bias_x: _Vector = _NOTHING
    bias_y: _Vector = _NOTHING
    bias_z: _Vector = _NOTHING
    scale_x: _Vector = _NOTHING
    scale_y: _Vector = _NOTHING
    scale_z: _Vector = _NOTHING
    misalignment: Annotated[tuple[float, ...], vector(6)] = _NOTHING * 2


@dataclass(frozen=True, slots=True, kw_only=True)
class RateTruth(AxesTruth):
    """Truth of a gyroscope's elements [deg/s].

    The white noise is that of the ICM-42605's datasheet, 3.8 mdeg/s/sqrt(Hz) one-sided; flicker and random walk, which
    no datasheet tells, are guesses.
    """

    white: _Levels = (2.7e-3,) * 3
    flicker: _Levels = (1e-3,) * 3
    random_walk: _Levels = (1e-5,) * 3


@dataclass(frozen=True, slots=True, kw_only=True)
class AccelerationTruth(AxesTruth):
    """What an accelerometer's elements are [m/s2], and the acceleration that they see where no plant says it."""

    acceleration: _Vector = (0.0, 0.0, 9.80665)
    white: _Levels = (1.2e-3,) * 3


class AxesElement:
    """Three axes that sense rates, accelerations or a field, independent of when they are read.

    Args:
        setup: of the peer: its faults, its random numbers; its truth, where none is given.
        terminal: goes to a plant's three signals in the unit of the axes; the terminal `element` to the temperature
            that they follow, where it is not that of the chip's thermometer.
        truth: what they are.
        still: what they see where nothing is connected.
    """

    def __init__(
        self,
        setup: PeerSetup,
        terminal: str = "rate",
        truth: AxesTruth | None = None,
        still: tuple[float, float, float] = _NOTHING,
    ) -> None:
        self._truth = setup.truth.part(RateTruth) if truth is None else truth
        self._still = np.array(still)[:, np.newaxis]
        self._stream_of = "" if truth is None else f"{terminal} "
        self._rate = setup.connections.axes(terminal)
        self._point = setup.connections.signal("element")
        self._faults = setup.faults
        self._seeds: Seeds = setup.seeds
        self._name = setup.instrument.name
        self._bias, self._scale = (
            _Polynomial(np.array([getattr(self._truth, f"{kind}_{axis}") for axis in AXES]))
            for kind in ("bias", "scale")
        )
        self._misaligned = any(self._truth.misalignment)
        self._begun: tuple[int, float, float] | None = None
        self._noise: list[RateNoise] = []

    def begin(self, start_ns: int, *, rate: float, bandwidth: float) -> None:
        """Restart the noise: samples counted from 1 again must not repeat earlier noise.

        Args:
            start_ns: when samples begin to be counted.
            rate: of samples [Hz].
            bandwidth: noise bandwidth of the filter [Hz].
        """
        self._begun = (start_ns, rate, bandwidth)
        self._noise = [
            RateNoise(self._streams(f"{self._stream_of}{axis} from {start_ns}"), levels, rate=rate, bandwidth=bandwidth)
            for axis, levels in zip(AXES, _levels(self._truth), strict=True)
        ]

    def stop(self) -> None:
        """Stop sensing."""
        self._begun, self._noise = None, []

    def measured(self, first: int, ends_ns: NDArray[np.int64], degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the axes give, shape (3, n), for samples from number `first` on.

        Args:
            first: counted from 1.
            ends_ns: when the samples ended.
            degrees: the die's temperature then, as its thermometer feels it.
        """
        if self._point is not None:
            degrees = self._point.observe_many(ends_ns)
        seen = self._seen(ends_ns, degrees - _REFERENCE)
        for axis, noise in enumerate(self._noise):
            seen[axis] += noise.samples(first - 1, ends_ns.size)
        return seen

    def state(self) -> Mapping[str, object]:
        """Return what has begun, and the state of the noise of every axis."""
        return {"begun": self._begun, "noise": [noise.state() for noise in self._noise]}

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned."""
        begun = cast("tuple[int, float, float] | None", state["begun"])
        if begun is None:
            self.stop()
            return
        self.begin(begun[0], rate=begun[1], bandwidth=begun[2])
        for noise, carried in zip(self._noise, cast("list[Mapping[str, object]]", state["noise"]), strict=True):
            noise.restore(carried)

    def _streams(self, prefix: str) -> Callable[[str], RandomStream]:
        return lambda kind: self._seeds.stream(self._name, f"{prefix} {kind}")

    def _seen(self, ends_ns: NDArray[np.int64], warmer: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the axes see without noise, shape (3, n)."""
        rates = np.repeat(self._still, ends_ns.size, axis=1)
        for axis, point in enumerate(self._rate or ()):
            rates[axis] = point.observe_many(ends_ns)
        for fault in self._faults.of(Saturated):
            rates[:, (ends_ns >= fault.start_ns) & (ends_ns < fault.end_ns)] += fault.added
        seen = rates
        if self._misaligned:
            seen = rates.copy()
            for (here, other), share in zip(_MISALIGNED, self._truth.misalignment, strict=True):
                seen[here] += share * rates[other]
        if self._scale.any:
            seen *= 1 + self._scale.at(warmer)
        seen += self._bias.at(warmer)
        for drifting in self._faults.of(Drifting):
            held = (ends_ns >= drifting.start_ns) & (ends_ns < drifting.end_ns)
            seen[:, held] += drifting.added * warmer[held]
        return seen


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldTruth:
    """Truth of a magnetometer's elements.

    Attributes:
        offset: what they read in no field, with the jig's own magnetism [uT].
        gain: relative error of the sensitivity.
        drift: change of the offset over temperature [uT/K]; the offset is that at 25 degC.
        noise: white, in the best mode [uT rms], None for what the data sheet says.
        field_noise: levels in uT, in any mode, in the place of `noise`; white noise up to half the rate of samples.
    """

    offset: _Vector = _NOTHING
    gain: _Vector = _NOTHING
    drift: _Vector = _NOTHING
    noise: _Levels | None = None
    field_noise: LevelsTruth | None = None


class FieldElement:
    """Three axes that sense a magnetic field, with noise by sample number.

    Args:
        setup: of the peer: its truth; the terminal `field` goes to a plant's three signals [uT]; `element`, or else
            `temperature`, to the temperature that they follow, 25 degC where there is none.
        noise: of the data sheet, in the best mode [uT rms].
    """

    def __init__(self, setup: PeerSetup, *, noise: tuple[float, ...]) -> None:
        own = setup.truth.part(FieldTruth)
        self._offset, self._gain, self._drift = own.offset, own.gain, own.drift
        self._rms = own.noise or (noise if own.field_noise is None else _NOTHING)
        self._levels = None if own.field_noise is None else _levels(own.field_noise)
        self._levelled: list[RateNoise] = []
        self._field = setup.connections.axes("field")
        self._point = setup.connections.signal("element") or setup.connections.signal("temperature")
        self._faults = setup.faults
        self._seeds = setup.seeds
        self._name = setup.instrument.name
        self._start_ns = -1
        self._noise: list[RandomStream] = []

    def measured(
        self, number: int, at_ns: int, *, start_ns: int, louder: tuple[float, float, float] = _QUIET
    ) -> list[float]:
        """Return what the three axes give for one sample [uT].

        Args:
            number: of the sample, counted from `start_ns`.
            at_ns: when it ended.
            start_ns: when samples began to be counted: what is counted afresh must not repeat the last noise.
            louder: noise of the mode over that of the best one, of each axis.
        """
        if start_ns != self._start_ns:
            self._noise = [self._seeds.stream(self._name, f"{name} from {start_ns}") for name in AXES]
            self._start_ns, self._levelled = start_ns, []
        levelled = self._by_levels(number, at_ns)
        saturated, drifting = self._faults.now(Saturated, at_ns), self._faults.now(Drifting, at_ns)
        added, drifts = saturated.added if saturated else 0.0, drifting.added if drifting else 0.0
        drifts_at_all = self._point is not None and (drifts or any(self._drift))
        warmer = self._point.observe_at(at_ns) - _REFERENCE if self._point is not None and drifts_at_all else 0.0
        seen = []
        for axis in range(len(AXES)):
            field = (self._field[axis].observe_at(at_ns) if self._field else 0.0) + added
            noise = self._rms[axis] * louder[axis] * self._noise[axis].normal(number) if self._rms[axis] else 0.0
            offset = self._offset[axis] + (self._drift[axis] + drifts) * warmer
            seen.append(field * (1 + self._gain[axis]) + offset + noise + levelled[axis])
        return seen

    def _by_levels(self, number: int, at_ns: int) -> tuple[float, ...]:
        """Return the noise of the levels in one sample. It follows from its number alone, so that nothing is kept."""
        if self._levels is None:
            return _NOTHING
        if not self._levelled or number <= self._levelled[0].gone:
            rate = round(NANOSECONDS * number / (at_ns - self._start_ns), 3)  # whichever sample it is computed from
            self._levelled = [
                RateNoise(self._streams(name), level, rate=rate, bandwidth=rate / 2)
                for name, level in zip(AXES, self._levels, strict=True)
            ]
        return tuple([each.sample(number - 1) for each in self._levelled])

    def _streams(self, axis: str) -> Callable[[str], RandomStream]:
        prefix = f"field {axis} from {self._start_ns}"
        return lambda kind: self._seeds.stream(self._name, f"{prefix} {kind}")


def _levels(truth: LevelsTruth) -> tuple[NoiseLevels, ...]:
    """Return the levels of each axis."""
    kinds = ("white", "flicker", "random_walk", "quantisation")
    return tuple(NoiseLevels(**{kind: getattr(truth, kind)[axis] for kind in kinds}) for axis in range(len(AXES)))


def limited(counts: NDArray[np.float64], least: int, most: int) -> NDArray[np.float64]:
    """Return whole numbers within bounds."""
    return np.asarray(np.minimum(np.maximum(np.rint(counts), least), most))


class _Polynomial:
    """Polynomials of one argument.

    Args:
        coefficients: of each, shape (m, 3), lowest power first.
    """

    def __init__(self, coefficients: NDArray[np.float64]) -> None:
        self._constant, self._linear, self._square = coefficients.T[:, :, np.newaxis]
        self.any, self._curved = bool(coefficients.any()), bool(self._square.any())

    def at(self, argument: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return them at arguments of shape (n,), shape (m, n)."""
        slope = self._linear + argument * self._square if self._curved else self._linear
        return np.asarray(self._constant + argument * slope)
