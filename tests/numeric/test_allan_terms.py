"""The five Allan terms over seeds: every subset of them, alone and with what is no noise.

`python tests/numeric/test_allan_terms.py SEEDS` prints the tables of docs/reference/allan.md.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import pytest
import sweeps
from scipy.signal import butter, lfilter
from scipy.special import stdtrit

from hil.analysis import quality
from hil.analysis.allan.noise import characterise
from hil.analysis.gates import Facts
from hil.analysis.noise.rate_noise import NoiseLevels
from hil.analysis.noise.series import noise
from hil.model.figure import FigureStatus

COUNT, RATE = 16_384, 10.0
DURATION = COUNT / RATE
LEVELS = {"quantisation": 0.1, "white": 1.0, "flicker": 0.5, "random_walk": 0.2, "ramp": 0.02}
SUBSETS = [subset for size in range(1, 6) for subset in combinations(LEVELS, size) if subset != ("ramp",)]
"""All but the ramp alone, which is a line without noise."""

FEW = [
    ("white",),
    ("white", "flicker"),
    ("white", "random_walk"),
    ("white", "ramp"),
    ("white", "flicker", "random_walk"),
]


def record(generator, terms):
    """Return a record of the given terms."""
    return noise(NoiseLevels(**{name: LEVELS[name] for name in terms}), COUNT, RATE, generator)


TIME = np.arange(COUNT) / RATE


def plain(values, _):
    """Nothing but the terms."""
    return values


def warm_up(values, generator):
    """An exponential, from a third to three times the white noise of a sample."""
    size, settling = generator.choice([1.0, 3.0, 10.0]), generator.uniform(0.02, 0.3) * DURATION
    return values + size * np.exp(-TIME / settling)


def slow_sine(values, generator):
    """A sine of 0.6 to 20 periods."""
    size, cycles, phase = generator.choice([0.5, 2.0, 5.0]), generator.uniform(0.6, 20.0), generator.uniform(0.0, 6.3)
    return values + size * np.sin(2.0 * np.pi * cycles * TIME / DURATION + phase)


def first_order(values, _):
    """A filter of first order."""
    return lfilter([0.3], [1.0, -0.7], values)[100:]


def second_order(values, _):
    """A Butterworth filter of second order, at a tenth of the rate."""
    return lfilter(*butter(2, 1.0, fs=RATE), values)[200:]


def counts(values, _):
    """Counts as large as the white noise of a sample."""
    return np.rint(values / STEP) * STEP


STEP = 3.0


def coarse(values, _):
    """Counts of five times the white noise of a sample."""
    return np.rint(values / 15.0) * 15.0


def clipped(values, _):
    """Clipped at 1.5 standard deviations."""
    return np.clip(values, *(values.mean() + 1.5 * values.std() * np.array([-1.0, 1.0])))


def spiked(values, generator):
    """Three spikes of 30 standard deviations."""
    values[generator.integers(0, COUNT, 3)] += 30.0 * math.sqrt(RATE)
    return values


DISTURBED = [warm_up, slow_sine, first_order, second_order, counts, coarse, clipped, spiked]
CURVES = {warm_up, slow_sine}
"""What has a slope of its own, so that no ramp can be held against it."""


@dataclass
class Tally:
    """What was said of one term."""

    measured: int = 0
    one: int = 0
    two: int = 0
    invented: int = 0
    absent: int = 0
    bounds: int = 0
    held: int = 0
    silent: int = 0
    pulls: list[float] = field(default_factory=list)

    def add(self, figure, truth, *, flagged):
        """Count one figure."""
        self.absent += not truth
        if flagged or figure.status in {FigureStatus.NOT_OBSERVABLE, FigureStatus.MODEL_REJECTED}:
            self.silent += 1
        elif figure.status is FigureStatus.UPPER_LIMIT:
            self.bounds += 1
            self.held += figure.value >= truth
        elif not truth:
            self.invented += 1
        else:
            pull = (figure.value - truth) / figure.uncertainty
            self.measured += 1
            self.one += abs(pull) < stdtrit(figure.dof, 0.84134)
            self.two += abs(pull) < stdtrit(figure.dof, 0.975)
            self.pulls.append(pull)


def sweep(disturb, subsets, seeds):
    """Return a tally of each term over subsets and seeds."""
    found = {name: Tally() for name in LEVELS}
    for subset in subsets:
        for seed in range(seeds):
            generator = np.random.default_rng([seed, SUBSETS.index(subset)])
            values = disturb(record(generator, subset), generator)
            gates = quality.read({"x": values}, Facts(), RATE)
            model = characterise(values, RATE, "deg/s")
            for name, tally in found.items():
                truth = LEVELS[name] if name in subset else 0.0
                if name == "ramp" and truth and disturb in CURVES:
                    continue
                if name == "white" and disturb is counts:
                    truth = math.sqrt(truth**2 + STEP**2 / 12.0 / RATE)
                tally.add(getattr(model, name), truth, flagged=any(gate.ok is False for gate in gates))
    return found


def table(title, found):
    """Return the rows of a table."""
    for name, tally in found.items():
        share = [f"{each / tally.measured:.3f}" if tally.measured else "-" for each in (tally.one, tally.two)]
        held = f"{tally.held}/{tally.bounds}" if tally.bounds else "-"
        spread = f"{np.std(tally.pulls):.2f}" if tally.measured else "-"
        yield (
            f"| {title} | {name} | {tally.measured} | {share[0]} | {share[1]} | {spread} | "
            f"{tally.invented}/{tally.absent} | {held} | {tally.silent} |"
        )


def near(hits, trials, share, margin):
    """Whether a share of hits agrees with a probability: 3.3 standard deviations, and a margin of the model."""
    return abs(hits - trials * share) <= 3.3 * math.sqrt(trials * share * (1.0 - share)) + margin * trials


def judge(found):
    """Hold a sweep against what is promised."""
    for tally in found.values():
        assert near(tally.one, tally.measured, 0.6827, 0.05)
        assert near(tally.two, tally.measured, 0.95, 0.02)
        assert tally.invented <= 0.01 * tally.absent + 3.3 * math.sqrt(0.01 * tally.absent)
        assert tally.held >= 0.95 * tally.bounds - 3.3 * math.sqrt(0.05 * tally.bounds)


@pytest.mark.timeout(3600)
def test_every_subset_of_the_terms_is_found():
    """100 seeds of each in a soak: intervals cover as they claim, at most 1 in 100 is invented, bounds hold."""
    found = sweep(plain, sweeps.sample(SUBSETS, 4), sweeps.chosen(1, 100))
    sys.stdout.write("\n".join(table("plain", found)))
    judge(found)
    assert found["white"].measured


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("disturb", sweeps.sample(DISTURBED, 3))
def test_what_is_no_noise_is_not_measured_as_noise(disturb):
    """100 seeds with each disturbance in a soak: a warm-up or a sine is no slow noise, a filter bends nothing."""
    found = sweep(disturb, sweeps.sample(FEW, 1), sweeps.chosen(1, 100))
    sys.stdout.write("\n".join(table(disturb.__name__, found)))
    judge(found)


if __name__ == "__main__":
    sys.stdout.write("| log | term | measured | 68 % | 95 % | pull | invented | bounds that hold | silent |\n")
    sys.stdout.write("|---|---|---|---|---|---|---|---|---|\n")
    for each in (plain, *DISTURBED):
        rows = table(each.__name__, sweep(each, SUBSETS if each is plain else FEW, int(sys.argv[1])))
        sys.stdout.write("\n".join(rows) + "\n")
        sys.stdout.flush()
