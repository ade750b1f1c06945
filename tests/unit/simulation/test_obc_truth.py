"""What a bench file may say of the simulated board: its truth, its faults, its analogue inputs."""

from __future__ import annotations

from math import isnan

import pytest
from adcs_bench import bound
from obc_bench import obc_bench
from obc_page import BoardUnderTest

from hil.simulation.faults import read_faults
from hil.simulation.peers.obc_link.board import MODEL
from hil.simulation.registry import fault_kinds
from hil.simulation.truth import TruthError


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ({"firmware": "1.0"}, "'firmware' must be a version such as '1.0.0', found \"1.0\""),
        ({"firmware": "1.0.256"}, "must be a version"),
        ({"unique_id": "zz"}, "'unique_id' must be 24 hexadecimal digits"),
        ({"clock_drift": "0.1"}, "'clock_drift' must be at most 0.01, found \"0.1\""),
        ({"ring": "20000"}, "'ring' must be at most 16384"),
        ({"boot_time": "0.2"}, "'boot_time' must be at most 0.1"),
        ({"clock_drfit": "0"}, "unknown key 'clock_drfit', did you mean 'clock_drift'?"),
    ],
)
def test_a_truth_that_cannot_be(truth, message):
    """It is told with its key and what would be right."""
    with pytest.raises(TruthError, match=message.replace("?", r"\?")):
        BoardUnderTest(truth)


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"kind": "nack"}, "'address' is missing"),
        ({"kind": "nack", "address": "104"}, "must be an address such as '0x68'"),
        ({"kind": "lose-frames", "frames": "0"}, "must be at least 1"),
        ({"kind": "resett"}, "unknown fault 'resett', did you mean 'reset'?"),
    ],
)
def test_a_fault_that_cannot_be(row, message):
    """It is told with its place."""
    with pytest.raises(TruthError) as caught:
        read_faults([row], ("faults",), fault_kinds(MODEL))
    assert message in str(caught.value) + " ".join(map(str, caught.value.others))


def test_an_analogue_input_sees_its_signal():
    """What a supply gives into the plant is read at the pin, within a count; a pin beyond full scale has no number."""
    connects = {"A3": "coil.sensor_power.voltage", "A5": "coil.ambient"}
    with bound(obc_bench(connects=connects)) as bench:
        supply = bench.roles["supply.sensor"]
        supply.configure(1.5, 0.02)
        supply.enable()
        bench.clock.sleep(0.1)
        obc = bench.roles["obc"]
        assert obc.analog(3).value == pytest.approx(1.5, abs=0.002)
        assert obc.analog(0).value == pytest.approx(0.0, abs=0.001)
        assert isnan(obc.analog(5).value)
