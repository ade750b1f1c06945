"""Random numbers by index."""

from __future__ import annotations

import numpy as np

from hil.analysis.noise.numbers import BLOCK
from hil.simulation.seeds import Seeds


def test_value_depends_on_the_index_only():
    """Reading forwards, backwards or twice gives the same numbers, across block borders too."""
    stream = Seeds(3).stream("mag", "x")
    forwards = [stream.normal(index) for index in range(200)]
    assert [stream.normal(index) for index in reversed(range(200))] == forwards[::-1]
    assert Seeds(3).stream("mag", "x").normal(137) == forwards[137]


def test_uniform_numbers_do_not_disturb_normal_ones():
    """The two kinds have blocks of their own."""
    stream, other = Seeds(3).stream("mag", "x"), Seeds(3).stream("mag", "x")
    assert [(stream.uniform(i), stream.normal(i))[1] for i in range(70)] == [other.normal(i) for i in range(70)]
    assert all(0 <= stream.uniform(index) < 1 for index in range(500))


def test_seed_device_and_name_each_give_another_stream():
    """No two streams of a bench, and no two benches, share numbers."""
    first = {
        Seeds(seed).stream(device, name).normal(0) for seed in (1, 2) for device in ("a", "b") for name in ("x", "y")
    }
    assert len(first) == 8
    assert Seeds(1).stream("ab", "c").normal(0) != Seeds(1).stream("a", "bc").normal(0)


def test_numbers_are_standard_normal_and_independent():
    """Mean, spread and the correlation of neighbours over 50,000 numbers lie within 5 standard errors."""
    stream = Seeds(11).stream("psu", "voltage")
    numbers = np.array([stream.normal(index) for index in range(50_000)])
    error = 5 / np.sqrt(numbers.size)
    assert abs(numbers.mean()) < error
    assert abs(numbers.std() - 1) < error
    assert abs(np.mean(numbers[1:] * numbers[:-1])) < error
    assert abs(np.mean(numbers[64:] * numbers[:-64])) < error


def test_far_indices_work():
    """An index may be a time in nanoseconds."""
    stream = Seeds(1).stream("a", "b")
    assert stream.normal(3_000_000_000_000_000) == Seeds(1).stream("a", "b").normal(3_000_000_000_000_000)


def test_blocks_of_normal_numbers_are_addressed_by_their_number():
    """A block depends on key and number only; a longer part begins with the shorter; blocks are independent."""
    stream = Seeds(5).stream("gyro", "x")
    block = stream.normal_block(3, 4096)
    assert Seeds(5).stream("gyro", "x").normal_block(3, 100).tolist() == block[:100].tolist()
    assert abs(np.corrcoef(block, stream.normal_block(4, 4096))[0, 1]) < 0.06
    assert abs(block.mean()) < 0.06
    assert abs(block.std() - 1.0) < 0.04
    assert not set(block.tolist()) & {stream.normal(index) for index in range(64)}


def test_many_numbers_at_once_are_those_of_the_index():
    """A block of numbers has those that are asked for one by one, whatever was drawn before."""
    stream, other = Seeds(3).stream("mag", "x"), Seeds(3).stream("mag", "x")
    for block in (5, 0, 2**40):
        assert stream.normals(block) == [other.normal(BLOCK * block + place) for place in range(BLOCK)]
        stream.normal_block(block, 10)
