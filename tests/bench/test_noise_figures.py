"""What the noise of a sensor and a packet of the gyroscope cost."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis.noise.rate_noise import BLOCK, NoiseLevels, RateNoise
from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.peers.iim42652 import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

LEVELS = NoiseLevels(white=3e-3, flicker=1e-3, random_walk=1e-5)
BLOCKS = 20
FRAMES = 100


@pytest.mark.parametrize("piece", [BLOCK, 100])
def test_a_sample_of_noise(cost, piece):
    """White, flicker and random walk of one axis, a block or a frame at a time."""

    def record():
        seeds = Seeds(1)
        noise = RateNoise(lambda kind: seeds.stream("x", kind), LEVELS, rate=100.0, bandwidth=104.7)
        return [noise.samples(first, piece) for first in range(0, BLOCKS * BLOCK, piece)]

    parts = cost(f"noise of one axis, one sample in {piece}", record, units=BLOCKS * BLOCK, rounds=3)
    assert np.concatenate(parts).std() > 0


def test_a_random_number(cost):
    """What it is compared with: a normal number of a block."""
    stream = Seeds(1).stream("x", "white")
    blocks = cost("normal number, one in a block", lambda: stream.normal_block(7, 2**18), units=2**18)
    assert blocks.size == 2**18


def test_a_packet_of_the_gyroscope(cost):
    """A second of 100 packets: sampled at the watermark, read through the registers."""
    clock = VirtualClock()
    peer = MODEL.build(
        PeerSetup(
            instrument=InstrumentSpec(name="gyro", driver="any", address=0x68),
            truth=Truth({}, ("truth",)),
            connections=Connections({}, {}, set(), ("connects",)),
        )
    )
    peer.attach(clock)
    for row in ("4f 68", "14 03", "64 00", "65 04", "5f 06", "60 20 03", "16 40", "4e 0c"):
        peer.write(0x68, bytes.fromhex(row))

    def frames():
        taken = 0
        for _ in range(FRAMES):
            clock.sleep(1.0)
            peer.write(0x68, b"\x30")
            taken += len(peer.read(0x68, 800))
        return taken

    assert cost("packet of the simulated gyroscope", frames, units=FRAMES * 100, rounds=3) == FRAMES * 800
