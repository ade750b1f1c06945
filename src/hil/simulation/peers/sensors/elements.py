"""What one simulated sensor really is: bias, scale, misalignment and noise of its elements, and its temperature."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Self, cast

import numpy as np
from numpy.typing import NDArray

from hil.simulation.faults import Saturated
from hil.simulation.noise.rate_noise import NoiseLevels, RateNoise
from hil.simulation.peers.model import PeerSetup
from hil.simulation.seeds import Seeds, Stream
from hil.simulation.truth import Truth

__all__ = ["AXES", "Die", "FieldElement", "RateElement", "limited"]

AXES = "xyz"

_MISALIGNED = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
_REFERENCE = 25.0

_Polynomial = tuple[float, ...]


class Die:
    """A sensor's temperature.

    Args:
        setup: of the peer: its truth says `temperature` [degC] and `temperature_offset` [K], which is what the reading
            is off; the terminal `temperature` goes to a plant's signal instead of the first.
        most: the highest temperature of the data sheet [degC]; the lowest is -40.
    """

    def __init__(self, setup: PeerSetup, *, most: float) -> None:
        self._truth = setup.truth.number("temperature", _REFERENCE, minimum=-40, maximum=most)
        self._offset = setup.truth.number("temperature_offset", 0.0)
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
class _RateTruth:
    """What a gyroscope's elements are. Polynomials are of the die's temperature above 25 degC, lowest power first.

    Attributes:
        bias: three coefficients per axis [deg/s, deg/s/K, deg/s/K^2].
        scale: three coefficients per axis of the relative error [1, 1/K, 1/K^2].
        misalignment: xy, xz, yx, yz, zx, zy: how much of the second axis' rate the first one sees [rad].
        noise: levels per axis.
    """

    bias: tuple[_Polynomial, ...]
    scale: tuple[_Polynomial, ...]
    misalignment: tuple[float, ...]
    noise: tuple[NoiseLevels, ...]

    @classmethod
    def read(cls, truth: Truth) -> Self:
        """Read a truth section; by default there are no errors.

        The white noise is then that of the ICM-42605's datasheet, 3.8 mdeg/s/sqrt(Hz) one-sided; flicker and random
        walk, which no datasheet tells, are guesses.
        """
        nothing = (0.0, 0.0, 0.0)
        return cls(
            bias=tuple(truth.vector(f"bias_{axis}", 3, nothing) for axis in AXES),
            scale=tuple(truth.vector(f"scale_{axis}", 3, nothing) for axis in AXES),
            misalignment=truth.vector("misalignment", 6, nothing * 2),
            noise=_levels(truth),
        )


def _levels(truth: Truth) -> tuple[NoiseLevels, ...]:
    usual = {"white": 2.7e-3, "flicker": 1e-3, "random_walk": 1e-5, "quantisation": 0.0}
    read = {kind: truth.vector(kind, 3, (level,) * 3) for kind, level in usual.items()}
    for kind, levels in read.items():
        if min(levels) < 0:
            truth.wrong(kind, "expected numbers from 0 up")
    return tuple(NoiseLevels(**{kind: levels[axis] for kind, levels in read.items()}) for axis in range(3))


class RateElement:
    """Three axes that sense rates: whoever reads them, and when.

    Args:
        setup: of the peer: its truth, its faults, its random numbers; the terminal `rate` goes to a plant's three
            signals [deg/s], without it the sensor is at rest.
    """

    def __init__(self, setup: PeerSetup) -> None:
        self._truth = _RateTruth.read(setup.truth)
        self._rate = setup.connections.axes("rate")
        self._faults = setup.faults
        self._seeds: Seeds = setup.seeds
        self._name = setup.instrument.name
        self._bias = np.array(self._truth.bias).T[:, :, np.newaxis]
        self._scale = np.array(self._truth.scale).T[:, :, np.newaxis]
        self._begun: tuple[int, float, float] | None = None
        self._noise: list[RateNoise] = []

    def begin(self, start_ns: int, *, rate: float, bandwidth: float) -> None:
        """Start noise anew: samples that are counted anew must not repeat the noise of the last ones.

        Args:
            start_ns: when samples begin to be counted.
            rate: of samples [Hz].
            bandwidth: noise bandwidth of the filter [Hz].
        """
        self._begun = (start_ns, rate, bandwidth)
        self._noise = [
            RateNoise(self._streams(f"{axis} from {start_ns}"), levels, rate=rate, bandwidth=bandwidth)
            for axis, levels in zip(AXES, self._truth.noise, strict=True)
        ]

    def stop(self) -> None:
        """Sense nothing."""
        self._begun, self._noise = None, []

    def measured(self, first: int, ends_ns: NDArray[np.int64], degrees: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the axes give, shape (3, n) [deg/s], for samples from number `first` on.

        Args:
            first: counted from 1.
            ends_ns: when the samples ended.
            degrees: the die's temperature then.
        """
        seen = self._seen(ends_ns, degrees - _REFERENCE)
        for axis, noise in enumerate(self._noise):
            seen[axis] += noise.samples(first - 1, ends_ns.size)
        return seen

    def state(self) -> Mapping[str, object]:
        """Return what has begun, and the state of the noise of every axis."""
        return {"begun": self._begun, "noise": [noise.state() for noise in self._noise]}

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        begun = cast("tuple[int, float, float] | None", state["begun"])
        if begun is None:
            self.stop()
            return
        self.begin(begun[0], rate=begun[1], bandwidth=begun[2])
        for noise, carried in zip(self._noise, cast("list[Mapping[str, object]]", state["noise"]), strict=True):
            noise.restore(carried)

    def _streams(self, prefix: str) -> Callable[[str], Stream]:
        return lambda kind: self._seeds.stream(self._name, f"{prefix} {kind}")

    def _seen(self, ends_ns: NDArray[np.int64], warmer: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what the axes see without noise, shape (3, n) [deg/s]."""
        rates = np.zeros((len(AXES), ends_ns.size))
        for axis, point in enumerate(self._rate or ()):
            rates[axis] = point.observe_many(ends_ns)
        for fault in self._faults.of(Saturated):
            rates[:, (ends_ns >= fault.start_ns) & (ends_ns < fault.end_ns)] += fault.added
        seen = rates.copy()
        for (here, other), share in zip(_MISALIGNED, self._truth.misalignment, strict=True):
            if share:
                seen[here] += share * rates[other]
        seen *= 1 + _polynomial(self._scale, warmer)
        seen += _polynomial(self._bias, warmer)
        return seen


class FieldElement:
    """Three axes that sense a magnetic field, with white noise by sample number.

    Args:
        setup: of the peer: its truth says `offset` [uT], what it reads in no field with the jig's own magnetism;
            `gain`, the relative error of the sensitivity; and `noise` [uT rms] in the best mode. The terminal `field`
            goes to a plant's three signals [uT].
        noise: of the data sheet, in the best mode [uT rms].
    """

    def __init__(self, setup: PeerSetup, *, noise: tuple[float, ...]) -> None:
        truth = setup.truth
        nothing = (0.0, 0.0, 0.0)
        self._offset, self._gain = truth.vector("offset", 3, nothing), truth.vector("gain", 3, nothing)
        self._rms = truth.vector("noise", 3, noise)
        if min(self._rms) < 0:
            truth.wrong("noise", "expected numbers from 0 up")
        self._field = setup.connections.axes("field")
        self._faults = setup.faults
        self._seeds = setup.seeds
        self._name = setup.instrument.name
        self._start_ns = -1
        self._noise: list[Stream] = []

    def measured(self, axis: int, number: int, at_ns: int, *, start_ns: int, louder: float) -> float:
        """Return what one axis gives for one sample [uT].

        Args:
            axis: 0 to 2.
            number: of the sample, counted from `start_ns`.
            at_ns: when it ended.
            start_ns: when samples began to be counted: what is counted anew must not repeat the noise of the last ones.
            louder: noise of the mode over that of the best one.
        """
        if start_ns != self._start_ns:
            self._noise = [self._seeds.stream(self._name, f"{name} from {start_ns}") for name in AXES]
            self._start_ns = start_ns
        field = self._field[axis].observe_at(at_ns) if self._field else 0.0
        saturated = self._faults.now(Saturated, at_ns)
        field += saturated.added if saturated else 0.0
        noise = self._rms[axis] * louder * self._noise[axis].normal(number)
        return field * (1 + self._gain[axis]) + self._offset[axis] + noise


def limited(counts: NDArray[np.float64], least: int, most: int) -> NDArray[np.float64]:
    """Return whole numbers within bounds."""
    return np.asarray(np.minimum(np.maximum(np.rint(counts), least), most))


def _polynomial(coefficients: NDArray[np.float64], argument: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return polynomials with coefficients of shape (3, m, 1), lowest power first, shape (m, n)."""
    constant, linear, square = coefficients
    return np.asarray(constant + argument * (linear + argument * square))
