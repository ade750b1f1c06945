"""The five Allan terms over seeds: every subset of them, alone and with what is no noise.

`PYTHONPATH=tests/support python tests/numeric/test_allan_terms.py SEEDS [KIND...]` prints the table of
docs/reference/allan.md.
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

from hil.analysis import SensorModel, quality, simulate
from hil.analysis.allan import fit as allan_fit
from hil.analysis.allan.curves import slow
from hil.analysis.allan.noise import characterise
from hil.analysis.allan.rolloff import rolloff
from hil.analysis.gates import Facts
from hil.analysis.noise.rate_noise import NoiseLevels
from hil.analysis.noise.series import noise
from hil.model.figure import FigureStatus

COUNT, RATE = 16_384, 10.0
DURATION = COUNT / RATE
LEVELS = {"quantisation": 0.1, "white": 1.0, "flicker": 0.5, "random_walk": 0.2, "ramp": 0.02}
SUBSETS = [subset for size in range(1, 6) for subset in combinations(LEVELS, size) if subset != ("ramp",)]
"""All but the ramp alone, which is a line without noise."""


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
TITLES = {
    plain: "nothing else",
    warm_up: "a warm-up",
    slow_sine: "a slow sine",
    first_order: "a filter of first order",
    second_order: "a filter of second order",
    counts: "counts of the white noise",
    coarse: "counts of five times the white noise",
    clipped: "clipping at 1.5 standard deviations",
    spiked: "three spikes",
}
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

    def add(self, figure, truth):
        """Count one figure, None of a record that a gate flags."""
        self.absent += not truth
        if figure is None or figure.status in {FigureStatus.NOT_OBSERVABLE, FigureStatus.MODEL_REJECTED}:
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
            flagged = any(gate.ok is False for gate in quality.read({"x": values}, Facts(), RATE))
            model = None if flagged else characterise(values, RATE, "deg/s")
            for name, tally in found.items():
                truth = LEVELS[name] if name in subset else 0.0
                if name == "ramp" and truth and disturb in CURVES:
                    continue
                if name == "white" and disturb is counts:
                    truth = math.sqrt(truth**2 + STEP**2 / 12.0 / RATE)
                tally.add(getattr(model, name, None), truth)
    return found


def table(disturb, records, found):
    """Return the rows of the page's table."""
    for name, tally in found.items():
        shares = [band(hits, tally.measured, claim) for hits, claim in ((tally.one, 0.6827), (tally.two, 0.95))]
        held = f"{tally.held} of {tally.bounds}" if tally.bounds else "-"
        invented = f"{tally.invented} of {tally.absent}"
        cells = (
            TITLES[disturb],
            records,
            name.replace("_", " "),
            tally.measured,
            *shares,
            invented,
            held,
            tally.silent,
        )
        yield f"| {' | '.join(map(str, cells))} |"


def band(hits, trials, claim):
    """Return a share with the band of 95 % around what is claimed."""
    if trials < 10:
        return "-"
    return f"{hits / trials:.1%} ± {196.0 * math.sqrt(claim * (1.0 - claim) / trials):.1f}".replace("%", " %")


def spread(trials, share):
    """Return 3.3 standard deviations of hits: one band in a thousand is left by chance."""
    return 3.3 * math.sqrt(trials * share * (1.0 - share))


def judge(found):
    """Hold a sweep against what is promised, with bands that follow from the number of trials.

    An interval may be a little wider than it claims: as one whose share is a third nearer to 1.
    """
    one, two = 0.6827, 0.95
    widest = 1.0 - (1.0 - one) * 2.0 / 3.0
    for tally in found.values():
        assert tally.one >= one * tally.measured - spread(tally.measured, one)
        assert tally.one <= widest * tally.measured + spread(tally.measured, widest)
        assert tally.two >= two * tally.measured - spread(tally.measured, two)
        assert tally.invented <= 0.01 * tally.absent + spread(tally.absent, 0.01)
        assert tally.held >= 0.95 * tally.bounds - spread(tally.bounds, 0.95)


@pytest.mark.system
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("disturb", sweeps.sample([plain, *DISTURBED], 4))
def test_what_is_measured_was_put_in_and_covers(disturb):
    """100 seeds of every subset and disturbance in a soak: intervals cover as they claim, hardly a term is invented."""
    subsets, seeds = sweeps.sample(SUBSETS, 4 if disturb is plain else 1), sweeps.chosen(1, 100)
    found = sweep(disturb, subsets, seeds)
    sys.stdout.write("\n".join(table(disturb, len(subsets) * seeds, found)))
    judge(found)


def disturbed(disturb, subset, seed):
    """Return the record that the sweep makes of a subset with a seed."""
    generator = np.random.default_rng([seed, SUBSETS.index(subset)])
    return disturb(record(generator, subset), generator)


@pytest.mark.parametrize(
    ("subset", "seed"), [(("white", "flicker"), 4), (("flicker", "ramp"), 0), (("quantisation", "white", "flicker"), 5)]
)
def test_a_warm_up_with_flicker_is_no_random_walk(subset, seed):
    """Flicker with an exponential looks like random walk: it is a bound, and the remark says why."""
    model = characterise(disturbed(warm_up, subset, seed), RATE, "deg/s")
    assert model.random_walk.status is FigureStatus.UPPER_LIMIT
    assert model.remark


@pytest.mark.parametrize("seed", [1072, 1207, 1628])
def test_random_walk_that_looks_like_flicker_is_no_flicker(seed):
    """Flicker that walk in its place explains within three standard deviations is a bound; these read 6 times too high.

    The levels are those published for the axis z of a BMI088, whose flicker is far below its random walk.
    """
    levels = NoiseLevels(white=8.971e-3, flicker=1.2293e-4, random_walk=8.1563e-5)
    flicker = characterise(
        simulate(SensorModel(levels=levels, rate=1.0), 14_400, seed=seed).values, 1.0, "rad/s"
    ).flicker
    assert flicker.status is FigureStatus.UPPER_LIMIT
    assert flicker.value > levels.flicker


@pytest.mark.parametrize(("disturb", "corner"), [(first_order, 0.57), (second_order, 1.0)])
@pytest.mark.parametrize("subset", [("white",), ("random_walk",), ("quantisation", "white", "flicker", "ramp")])
def test_a_filter_is_found_in_the_spectrum(disturb, corner, subset):
    """Its corner to a third, under any noise but that which has its inverse shape; none where there is none."""
    found = rolloff(disturbed(disturb, subset, 0), RATE)
    assert found.corner == pytest.approx(corner, rel=0.34)
    assert rolloff(disturbed(plain, subset, 0), RATE) is None


def test_a_filter_is_found_around_holes_and_not_in_short_records():
    """Parts with a hole are left out; with too few parts nothing is said."""
    values = disturbed(first_order, ("white",), 0)
    values[::3000] = math.nan
    assert rolloff(values, RATE).corner == pytest.approx(0.57, rel=0.34)
    assert rolloff(values[:1000], RATE) is None


@pytest.mark.system
@pytest.mark.parametrize("seed", [4, 6])
def test_bounds_behind_a_filter_count_what_it_takes_off(seed):
    """White noise that the fit does not select is bounded above its truth though the filter lowers every point."""
    white = characterise(disturbed(first_order, ("white", "flicker", "random_walk"), seed), RATE, "deg/s").white
    assert white.status is FigureStatus.UPPER_LIMIT
    assert white.value > LEVELS["white"]


@pytest.mark.system
@pytest.mark.timeout(600)
def test_flicker_behind_a_filter_is_right_whether_it_is_measured_or_not(monkeypatch):
    """Over all records its square covers as it claims; what is measured is what came out large."""
    fits, plainly = [], allan_fit.fit
    monkeypatch.setattr(allan_fit, "fit", lambda points: fits.append(plainly(points)) or fits[-1])
    pulls = []
    for subset in sweeps.sample([each for each in SUBSETS if "flicker" in each], 2):
        for seed in range(sweeps.chosen(15, 100)):
            model = characterise(disturbed(first_order, subset, seed), RATE, "deg/s")
            if model.flicker.status is not FigureStatus.MODEL_REJECTED and "the record holds" not in model.remark:
                pulls.append((fits[-1].offered[2] - LEVELS["flicker"] ** 2) / math.sqrt(fits[-1].covariance[2, 2]))
    inside = sum(abs(pull) < 1.0 for pull in pulls)
    sys.stdout.write(f"flicker after a filter: {inside} of {len(pulls)} inside, mean {np.mean(pulls):.2f}\n")
    assert abs(inside - 0.6827 * len(pulls)) <= spread(len(pulls), 0.6827)
    assert abs(np.mean(pulls)) <= 3.3 * 1.1 / math.sqrt(len(pulls))


def test_quantisation_of_the_angle_below_a_count_is_flagged():
    """It moves neighbours apart by more than it scatters, and rounding it to counts is no white noise."""
    gates = quality.read({"x": disturbed(counts, ("quantisation",), 0)}, Facts(), RATE)
    assert "resolved" in {gate.name for gate in gates if gate.ok is False}


def test_a_walk_that_meets_a_rail_once_is_flagged():
    """Its noise bounces off the rail: no number within is read as often as that at the end."""
    gates = quality.read({"x": disturbed(clipped, ("quantisation", "random_walk", "ramp"), 5)}, Facts(), RATE)
    assert "saturated" in {gate.name for gate in gates if gate.ok is False}


@pytest.mark.system
@pytest.mark.parametrize("seed", range(3))
def test_white_noise_beside_a_warm_up_is_that_without_it(seed):
    """The curve is taken off before white noise is fitted: what is left of it moves the value by little."""
    values = record(np.random.default_rng(seed), ("white",))
    bare, warm = (characterise(each, RATE, "deg/s") for each in (values, values + 10.0 * np.exp(-TIME / 100.0)))
    assert "settling" in warm.remark
    assert abs(warm.white.value - bare.white.value) < 0.3 * bare.white.uncertainty


def test_random_walk_is_as_uncertain_as_a_curve_that_may_be_in_it():
    """How far it moves if the nearest curve is real is half the width of an even distribution (GUM 4.3.7)."""
    values = record(np.random.default_rng(1), ("white", "random_walk")) + 0.5 * np.sin(TIME / 60.0)
    walk, found = characterise(values, RATE, "deg/s").random_walk, slow(values, RATE)
    assert walk.status is FigureStatus.MEASURED
    assert found.open > 0.0
    assert walk.uncertainty > found.open / math.sqrt(3.0)


@pytest.mark.system
@pytest.mark.parametrize("seed", [5, 9, 10, 11, 22])
def test_a_jump_that_no_gate_sees_is_no_random_walk(seed):
    """A mean that moves by 0.4 standard deviations of a sample explains the record as well: slow noise is a bound."""
    generator = np.random.default_rng(seed)
    values = record(generator, ("white",))
    values += 0.4 * math.sqrt(RATE) * (np.arange(COUNT) > generator.uniform(0.1, 0.9) * COUNT)
    assert all(gate.ok is not False for gate in quality.read({"x": values}, Facts(), RATE))
    model = characterise(values, RATE, "deg/s")
    assert {model.flicker.status, model.random_walk.status} == {FigureStatus.UPPER_LIMIT}
    assert "a jump" in model.remark


@pytest.mark.parametrize("curve", [np.exp(-TIME / 200.0), np.sin(TIME / 30.0)])
def test_what_is_left_without_a_curve_is_noise(curve):
    """A warm-up or a sine of ten times the noise is taken off to a hundredth of it, around a hole as well."""
    noise_alone = np.random.default_rng(1).standard_normal(COUNT)
    values = 5.0 + 10.0 * curve + noise_alone
    values[300:310] = math.nan
    rest = slow(values, RATE).rest(values)
    assert np.isnan(rest[300:310]).all()
    assert np.nanstd(rest - noise_alone) < 0.15


if __name__ == "__main__":
    sys.stdout.write("| with | records | term | measured | inside 68 % | inside 95 % | measured but absent |")
    sys.stdout.write(" bounds that hold | neither |\n|---|---|---|---|---|---|---|---|---|\n")
    for each in (plain, *DISTURBED):
        if each.__name__ in (sys.argv[2:] or [each.__name__]):
            rows = table(each, len(SUBSETS) * int(sys.argv[1]), sweep(each, SUBSETS, int(sys.argv[1])))
            sys.stdout.write("\n".join(rows) + "\n")
            sys.stdout.flush()
