"""Whoever asks for noise, and in which pieces: a sample depends on its index only."""

from __future__ import annotations

import json

import numpy as np
import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.analysis.noise.rate_noise import BLOCK, NoiseLevels, RateNoise
from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.peers.iim42652 import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

LEVELS = NoiseLevels(white=1.0, flicker=0.5, random_walk=0.1, quantisation=0.01)
LENGTH = 3 * BLOCK
CUTS = st.lists(st.integers(0, LENGTH), max_size=6).map(sorted)
ADDRESS = 0x69
MS = 1_000_000


def noise(bandwidth=20.0):
    """Return one axis, whose filter has a memory of its own."""
    seeds = Seeds(5)
    return RateNoise(lambda kind: seeds.stream("axis", kind), LEVELS, rate=100.0, bandwidth=bandwidth)


WHOLE = noise().samples(0, LENGTH)


@settings(max_examples=sweeps.examples(20), derandomize=True)
@given(cuts=CUTS, restored=st.booleans())
def test_pieces_are_the_whole(cuts, restored):
    """Read in any pieces, saved and restored between them through JSON or not, the samples are bit-identical."""
    reader = noise()
    parts = []
    for first, end in zip([0, *cuts], [*cuts, LENGTH], strict=True):
        parts.append(reader.samples(first, end - first))
        if restored:
            state = json.loads(json.dumps(reader.state()))
            reader = noise()
            reader.restore(state)
    assert np.array_equal(np.concatenate(parts), WHOLE)


@settings(max_examples=sweeps.examples(20), derandomize=True)
@given(skipped=st.integers(0, LENGTH - 1))
def test_what_nobody_read_changes_nothing(skipped):
    """Samples after a gap are the ones that they would be without it."""
    assert np.array_equal(noise().samples(skipped, LENGTH - skipped), WHOLE[skipped:])


class Sensor:
    """A streaming sensor, and who listens to its pin."""

    def __init__(self) -> None:
        self.clock = VirtualClock()
        self.edges = []
        self.peer = MODEL.build(
            PeerSetup(
                instrument=InstrumentSpec(name="gyro", driver="any", address=ADDRESS),
                truth=Truth({"white": ["0.1"] * 3, "odr_error": "0.003"}, ("truth",)),
                connections=Connections({}, {}, set(), ("connects",)),
                seeds=Seeds(8),
            )
        )
        self.peer.attach(self.clock)
        self.peer.on_interrupt(lambda: self.edges.append(self.clock.now_ns()))

    def start(self):
        """Stream at 200 Hz with a watermark of 40 packets, pulses active low, bandwidth 20 Hz."""
        for row in ("4f 67", "52 16", "14 02", "64 00", "65 04", "5f 06", "60 40 01", "16 40", "4e 0c"):
            self.peer.write(ADDRESS, bytes.fromhex(row))

    def take(self, at_ns):
        """Read status, counter and FIFO at an instant."""
        self.clock.wait_until(at_ns)
        self.peer.write(ADDRESS, b"\x2e")
        count = int.from_bytes(self.peer.read(ADDRESS, 2), "big")
        self.peer.write(ADDRESS, b"\x2d")
        return self.peer.read(ADDRESS, 3 + count)


@settings(max_examples=sweeps.examples(20), derandomize=True)
@given(looks=st.lists(st.integers(0, 2500 * 1000), min_size=1, max_size=6).map(sorted), saved=st.integers(0, 5))
def test_a_sensor_restored_goes_on_with_the_same_bytes(looks, saved):
    """Saved after any look through JSON, a fresh sensor gives the bytes and edges that the first one would have."""
    whole = Sensor()
    whole.start()
    expected = [whole.take(at * 1000) for at in [*looks, 3_000_000]]
    first = Sensor()
    first.start()
    cut = min(saved, len(looks) - 1)
    taken = [first.take(at * 1000) for at in looks[: cut + 1]]
    second = Sensor()
    second.clock.wait_until(first.clock.now_ns())
    second.peer.restore(json.loads(json.dumps(first.peer.state())))
    taken += [second.take(at * 1000) for at in [*looks[cut + 1 :], 3_000_000]]
    assert taken == expected
    assert first.edges + second.edges == whole.edges


@settings(max_examples=sweeps.examples(20), derandomize=True)
@given(looks=st.lists(st.integers(0, 2500 * 1000), max_size=8).map(sorted))
def test_looking_changes_no_sample(looks):
    """However often the FIFO is emptied within its 1.28 s, the packets are the same."""
    steps = sorted({*(at * 1000 for at in looks), *range(0, 3_000 * MS + 1, 1_000 * MS)})
    sensor, calm = Sensor(), Sensor()
    sensor.start()
    calm.start()
    packets = b"".join(sensor.take(at)[3:] for at in steps)
    assert packets == b"".join(calm.take(second * 1_000 * MS)[3:] for second in range(4))
    assert len(packets) > 590 * 8
