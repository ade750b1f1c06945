"""What holds for every coil, field and orientation."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hil.analysis.coil import on_axis_rectangle
from hil.analysis.magnetics import direction, odd_response

steady = settings(derandomize=True, max_examples=sweeps.examples(60))

fields = arrays(np.float64, (3, 4, 3), elements=st.floats(-50, 50).map(lambda value: round(value, 3)))
quaternions = arrays(np.float64, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1)


def rotation(quaternion):
    """Return the rotation matrix of a quaternion of any length."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@steady
@given(noise=fields, quaternion=quaternions)
def test_direction_does_not_depend_on_the_axes(noise, quaternion):
    """Turning board and magnetometer together changes neither angle nor projection, nor their uncertainties."""
    turn = rotation(quaternion)
    coil, normal = np.array([2000.0, -500.0, 1000.0]), np.array([0.6, 0.0, 0.8])
    plus, zero, minus = noise[0] + coil, noise[1], noise[2] - coil
    here = direction(odd_response(plus, zero, minus), normal)
    there = direction(odd_response(plus @ turn.T, zero @ turn.T, minus @ turn.T), turn @ normal)
    for one, other in ((here.angle, there.angle), (here.projection, there.projection)):
        assert other.status is one.status
        assert other.value == pytest.approx(one.value, abs=1e-6)
        assert other.uncertainty == pytest.approx(one.uncertainty, rel=1e-5, abs=1e-5)


@steady
@given(noise=fields, offset=arrays(np.float64, 3, elements=st.floats(-1e3, 1e3)), slope=st.floats(-10, 10))
def test_surroundings_do_not_matter(noise, offset, slope):
    """Any constant field and any steady drift give the same odd and even part."""
    times = np.arange(12.0).reshape(4, 3)
    moved = noise + offset + slope * times.T[:, :, None]
    still, drifting = odd_response(*noise), odd_response(*moved)
    assert drifting.odd == pytest.approx(still.odd, abs=1e-8)
    assert drifting.even == pytest.approx(still.even, abs=1e-8)
    assert drifting.odd_covariance == pytest.approx(still.odd_covariance, abs=1e-6)


@steady
@given(noise=fields)
def test_swapped_polarity_turns_the_field_round(noise):
    """Plus and minus exchanged, in time too, give the opposite odd part and the same even part."""
    times = np.arange(12.0).reshape(4, 3)
    right = odd_response(*noise, times=times)
    swapped = odd_response(noise[2], noise[1], noise[0], times=times[:, ::-1])
    assert swapped.odd == pytest.approx(-right.odd, abs=1e-9)
    assert swapped.even == pytest.approx(right.even, abs=1e-9)


@steady
@given(
    side_a=st.floats(0.005, 0.5),
    side_b=st.floats(0.005, 0.5),
    distance=st.floats(-1, 1),
    current=st.floats(-1, 1),
    turns=st.integers(1, 500),
)
def test_loop_formula_has_the_symmetries_of_the_coil(side_a, side_b, distance, current, turns):
    """Sides can be exchanged, both faces are equal, and the field is proportional to turns and current."""
    field = on_axis_rectangle(turns, side_a, side_b, distance, current)
    assert on_axis_rectangle(turns, side_b, side_a, -distance, current) == pytest.approx(field, rel=1e-12)
    assert on_axis_rectangle(1, side_a, side_b, distance, -current) * -turns == pytest.approx(field, rel=1e-12)
