"""The field of a coil, told from the Earth's field, its drift, and noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sweeps
from scipy.stats import binom
from scipy.stats import t as student

from hil.analysis.magnetics import Response, direction, odd_response
from hil.model.figure import FigureStatus

COIL = np.array([3.0, -4.0, 12.0])
EARTH = np.array([20.0, -5.0, -41.0])


def phases(repetitions, *, coil=COIL, even=0.0, drift=0.0, bend=0.0, order=None):
    """Return +I, 0, -I means without noise, and the times of the phases."""
    order = order if order is not None else [(0, 1, 2)] * repetitions
    times = np.array([[3 * row + place for place in places] for row, places in enumerate(order)], dtype=float)
    surroundings = EARTH + drift * times[:, :, None] + bend * times[:, :, None] ** 2
    plus, zero, minus = np.moveaxis(surroundings, 1, 0)
    return (plus + coil + even, zero, minus - coil + even), times


def inside(figure, truth, level=0.95):
    """Say whether the interval of a figure holds the truth."""
    return abs(figure.value - truth) <= student.ppf(0.5 + level / 2, figure.dof) * figure.uncertainty


def assert_coverage(hits, trials, level=0.95):
    """Demand that a share of hits is what the level says, in a band that a fair count leaves once in 10,000."""
    low, high = binom.interval(0.9999, trials, level)
    assert low <= hits <= high, f"{hits} of {trials} intervals hold the truth"


def test_odd_part_is_the_coil_whatever_the_surroundings():
    """The Earth's field and the magnetometer's offset do not appear in the odd part."""
    (plus, zero, minus), _ = phases(3)
    response = odd_response(plus, zero, minus)
    assert response.odd == pytest.approx(COIL, abs=1e-12)
    assert response.even == pytest.approx(np.zeros(3), abs=1e-12)
    assert response.dof == 2


def test_even_part_shows_what_both_signs_share():
    """Remanence or heat that does not follow the sign of the current is the even part, and no odd one."""
    (plus, zero, minus), _ = phases(4, even=np.array([0.3, 0.0, -0.4]))
    response = odd_response(plus, zero, minus)
    assert response.odd == pytest.approx(COIL, abs=1e-12)
    assert np.linalg.norm(response.even) == pytest.approx(0.5)


@pytest.mark.parametrize("order", [[(0, 1, 2)] * 4, [(0, 1, 2), (2, 1, 0)] * 2, [(1, 0, 2), (0, 2, 1)] * 2])
def test_linear_drift_cancels_in_any_order(order):
    """A steady drift of the Earth's field leaves odd and even part alone and is reported."""
    slope = np.array([0.8, -0.2, 0.05])
    (plus, zero, minus), times = phases(4, drift=slope, order=order)
    response = odd_response(plus, zero, minus, times=times)
    assert response.odd == pytest.approx(COIL, abs=1e-9)
    assert response.even == pytest.approx(np.zeros(3), abs=1e-9)
    assert response.drift == pytest.approx(slope)


def test_default_times_are_phases_in_a_row():
    """Without times the phases are taken as +I, 0, -I one after the other."""
    (plus, zero, minus), _ = phases(3, drift=np.array([1.0, 2.0, 3.0]))
    assert odd_response(plus, zero, minus).odd == pytest.approx(COIL, abs=1e-9)


def test_two_repetitions_in_turned_order_cancel_drift():
    """Two repetitions are enough to take a drift out."""
    (plus, zero, minus), times = phases(2, drift=np.array([1.0, 2.0, 3.0]), order=[(0, 1, 2), (2, 1, 0)])
    assert odd_response(plus, zero, minus, times=times).odd == pytest.approx(COIL, abs=1e-9)


def test_quadratic_drift_cancels_from_the_mean_and_widens_it():
    """A bent drift does not move the odd part, and its scatter is not hidden."""
    (plus, zero, minus), _ = phases(5, bend=0.02)
    response = odd_response(plus, zero, minus)
    assert response.odd == pytest.approx(COIL, abs=1e-9)
    assert response.even == pytest.approx(np.full(3, 0.02), abs=1e-9)
    assert response.component("x").uncertainty > 0.05


def test_unsteady_surroundings_make_the_drift_and_so_the_coil_uncertain():
    """A level that jumps between repetitions leaves the slope uncertain, and in one order of phases the coil too."""
    (plus, zero, minus), _ = phases(4)
    jumps = np.array([0.0, 1.0, 0.0, 1.0])[:, None]
    response = odd_response(plus + jumps, zero + jumps, minus + jumps)
    # Levels 0 1 0 1 at 0 3 6 9: slope 1/15, rest of squares 4/5, over 2 and over 45 the slope's variance.
    assert response.drift == pytest.approx(np.full(3, 1 / 15))
    assert response.odd == pytest.approx(COIL + 1 / 15)
    assert response.component("x").uncertainty == pytest.approx(math.sqrt(0.8 / 2 / 45))


def test_two_repetitions_allow_for_the_slope_that_they_cannot_judge():
    """Two levels leave no rest, so the slope is taken to be as noisy as the halves of the differences say."""
    (plus, zero, minus), _ = phases(2)
    response = odd_response(plus + np.array([[0.0], [0.6]]), zero, minus)
    spread = np.var([0.0, 0.3], ddof=1)
    assert response.component("y").uncertainty == pytest.approx(math.sqrt(spread / 2 + spread * 2 / 3 / 4.5))


@pytest.mark.system
@pytest.mark.parametrize(("repetitions", "seed"), [(2, 11), (3, 12), (6, 13)])
def test_intervals_of_the_odd_part_cover(repetitions, seed):
    """95 % intervals hold the coil's field 95 times in 100, under noise and drift, from two repetitions on."""
    generator = np.random.default_rng(seed)
    (plus, zero, minus), _ = phases(repetitions, drift=np.array([0.3, -0.6, 0.1]))
    hits, rounds = 0, sweeps.chosen(150, 400)
    for _ in range(rounds):
        noise = generator.normal(0, 0.4, (3, repetitions, 3))
        response = odd_response(plus + noise[0], zero + noise[1], minus + noise[2])
        hits += sum(inside(response.component(axis), truth) for axis, truth in zip("xyz", COIL, strict=True))
    assert_coverage(hits, 3 * rounds)


@pytest.mark.system
@pytest.mark.parametrize(("tilt", "seed"), [(20.0, 21), (90.0, 22), (165.0, 23)])
def test_intervals_of_the_angle_cover(tilt, seed):
    """95 % intervals of an angle hold the true one 95 times in 100, away from 0 and 180 deg."""
    generator = np.random.default_rng(seed)
    coil = 10 * np.array([math.sin(math.radians(tilt)), 0.0, math.cos(math.radians(tilt))])
    (plus, zero, minus), _ = phases(5, coil=coil)
    hits, rounds = 0, sweeps.chosen(250, 600)
    for _ in range(rounds):
        noise = generator.normal(0, 0.3, (3, 5, 3))
        response = odd_response(plus + noise[0], zero + noise[1], minus + noise[2])
        hits += inside(direction(response, [0, 0, 1]).angle, tilt)
    assert_coverage(hits, rounds)


def test_uncertainty_of_the_angle_is_its_slope_times_the_covariance():
    """For a field known unequally well in its directions, the uncertainty is that of the angle's derivatives."""
    root = np.array([[0.2, 0.0, 0.0], [-0.1, 0.05, 0.0], [0.15, 0.02, 0.3]]) / 10
    field, normal = np.array([6.0, -7.0, 5.0]), np.array([0.0, 0.6, 0.8])
    response = Response(
        odd=field,
        odd_covariance=root @ root.T,
        even=np.zeros(3),
        even_covariance=np.zeros((3, 3)),
        drift=np.zeros(3),
        unit="uT",
        repetitions=9,
    )

    def angle(vector):
        return math.degrees(math.acos(vector @ normal / np.linalg.norm(vector)))

    slopes = [(angle(field + step) - angle(field - step)) / 2e-5 for step in np.eye(3) * 1e-5]
    found = direction(response, normal).angle
    assert found.value == pytest.approx(angle(field))
    assert found.uncertainty == pytest.approx(np.linalg.norm(slopes @ root), rel=1e-3)
    assert found.dof == pytest.approx(8)


@pytest.mark.system
def test_angle_near_zero_is_not_claimed_too_well():
    """An aligned coil, whose measured angle is noise alone, stays inside its interval at least as often as stated."""
    generator = np.random.default_rng(31)
    (plus, zero, minus), _ = phases(8, coil=np.array([0.0, 0.0, 10.0]))
    hits = 0
    for _ in range(500):
        noise = generator.normal(0, 0.3, (3, 8, 3))
        hits += inside(
            direction(odd_response(plus + noise[0], zero + noise[1], minus + noise[2]), [0, 0, 1]).angle, 0.0
        )
    assert hits >= binom.ppf(1e-4, 500, 0.95)


@pytest.mark.parametrize(("wound", "sense"), [(+1.0, +1.0), (-1.0, -1.0)])
def test_both_hand_conventions_are_told_apart(wound, sense):
    """A coil wound the other way gives the other sign along the outward normal, and the supplementary angle."""
    generator = np.random.default_rng(41)
    (plus, zero, minus), _ = phases(4, coil=wound * np.array([0.0, 0.0, 8.0]))
    noise = generator.normal(0, 0.05, (3, 4, 3))
    seen = direction(odd_response(plus + noise[0], zero + noise[1], minus + noise[2]), [0, 0, 2])
    assert seen.sense.value == sense
    assert seen.sense.status is FigureStatus.MEASURED
    assert seen.projection.value == pytest.approx(8.0 * wound, abs=0.2)
    assert seen.significance.value > 5
    assert seen.angle.value == pytest.approx(0.0 if wound > 0 else 180.0, abs=2)


def test_dead_coil_has_no_sense_and_no_angle():
    """Noise alone has a sign, but it is not observable, so it cannot pass."""
    generator = np.random.default_rng(42)
    (plus, zero, minus), _ = phases(6, coil=np.zeros(3))
    noise = generator.normal(0, 0.3, (3, 6, 3))
    seen = direction(odd_response(plus + noise[0], zero + noise[1], minus + noise[2]), [0, 0, 1])
    assert seen.sense.status is FigureStatus.NOT_OBSERVABLE
    assert seen.angle.status is FigureStatus.NOT_OBSERVABLE


def test_field_without_scatter_has_no_significance():
    """A magnetometer that never moves says nothing of its noise, so the sign does not count."""
    seen = direction(odd_response(*phases(3, coil=np.zeros(3))[0]), [0, 0, 1])
    assert seen.significance.status is FigureStatus.NOT_OBSERVABLE
    assert seen.sense.status is FigureStatus.NOT_OBSERVABLE


def test_alignment_widens_the_angle_only():
    """How well the magnetometer stands to the board is part of the angle's uncertainty."""
    generator = np.random.default_rng(43)
    (plus, zero, minus), _ = phases(4)
    response = odd_response(plus + generator.normal(0, 0.1, (4, 3)), zero, minus)
    bare, aligned = direction(response, COIL), direction(response, COIL, alignment=2.0)
    assert aligned.angle.uncertainty == pytest.approx(math.hypot(bare.angle.uncertainty, 2.0))
    assert aligned.angle.dof > bare.angle.dof
    assert aligned.projection == bare.projection


def test_raw_samples_give_the_means():
    """Raw samples of each phase, of any length, give the same odd part as their means."""
    generator = np.random.default_rng(44)
    blocks = [
        [generator.normal(0, 0.5, (length, 3)) + sign * COIL + EARTH for length in (30, 40, 35)] for sign in (1, 0, -1)
    ]
    raw = odd_response(*blocks)
    means = odd_response(*[np.array([block.mean(axis=0) for block in phase]) for phase in blocks])
    assert raw.odd == pytest.approx(means.odd)


def test_noise_within_the_phases_is_a_floor():
    """Repetitions that agree by chance do not make the uncertainty smaller than the noise of their samples."""
    generator = np.random.default_rng(45)
    block = generator.normal(0, 1.0, (50, 3))
    response = odd_response([block + COIL] * 4, [block] * 4, [block - COIL] * 4)
    expected = block.std(axis=0, ddof=1) / math.sqrt(50 * 4 * 2)
    assert np.sqrt(np.diag(response.odd_covariance)) == pytest.approx(expected, rel=0.4)


@pytest.mark.parametrize("spoil", ["one repetition", "NaN", "infinite", "nothing"])
def test_degenerate_input_is_not_observable(spoil):
    """One repetition, a number that is not finite, or no data at all give figures that cannot pass."""
    repetitions = {"one repetition": 1, "nothing": 0}.get(spoil, 4)
    (plus, zero, minus), times = phases(max(repetitions, 1))
    plus, zero, minus, times = plus[:repetitions], zero[:repetitions], minus[:repetitions], times[:repetitions]
    if spoil in {"NaN", "infinite"}:
        zero[1, 2] = math.nan if spoil == "NaN" else math.inf
    response = odd_response(plus, zero, minus, times=times)
    seen = direction(response, [0, 0, 1])
    for figure in (response.component("z"), seen.angle, seen.projection, seen.sense):
        assert figure.status is FigureStatus.NOT_OBSERVABLE


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: odd_response(np.ones((2, 3)), np.ones((3, 3)), np.ones((2, 3))), "no current 3 times"),
        (lambda: odd_response(np.ones((2, 2)), np.ones((2, 2)), np.ones((2, 2))), r"shape \(2,\)"),
        (lambda: odd_response(*[np.ones((2, 3))] * 3, times=np.ones((3, 3))), r"need \(2, 3\)"),
        (lambda: odd_response(*[np.ones((2, 3))] * 3, times=np.ones((2, 3))), "follow each other"),
        (lambda: direction(odd_response(*phases(2)[0]), [0, 0, 0]), "not all zero"),
        (lambda: odd_response(*phases(2)[0]).component("w"), "axes are x, y and z"),
    ],
)
def test_wrong_shapes_are_told_in_a_sentence(call, words):
    """A wrong shape is a ValueError that says what was expected."""
    with pytest.raises(ValueError, match=words):
        call()
