"""The function generator's driver against its peer, seen by an oscilloscope at the node that it drives."""

from __future__ import annotations

import numpy as np
import pytest
from facing import facing

from hil.instruments.driver import Outlet
from hil.instruments.keysight_33500 import Keysight33500
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, NoReply, Refused, Rejected
from hil.simulation.peers.keysight_33500 import MODEL
from hil.simulation.plants.signal_node import SignalNode

CLAMP = Clamp(output="function_generator", quantity="peak", unit="V", minimum=0.0, maximum=3.0)


def generator(*, faults=(), clamps=None, node=None):
    """Return a driver facing a generator at a node."""
    plants = {"node": node or SignalNode("node", 10_000_000)}
    return facing(
        MODEL, driver=Keysight33500, plants=plants, connects={"1": "node.drive"}, faults=faults, clamps=clamps
    )


def output(driver):
    """Return the role of its first output."""
    return driver.role(Wire(role="function_generator", instrument="device", channel=1))


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ("sine", lambda turns: np.sin(2 * np.pi * turns)),
        ("square", lambda turns: np.where(turns % 1 < 0.5, 1.0, -1.0)),
        ("ramp", lambda turns: 2 * (turns % 1) - 1),
        ("dc", lambda turns: 0 * turns),
    ],
)
def test_every_shape_is_at_the_node(shape, expected):
    """With amplitude, offset and frequency, from the instant at which it was switched on; nothing before and after."""
    node = SignalNode("node", 10_000_000)
    with generator(node=node) as (driver, clock):
        found = output(driver)
        found.configure(shape, 500.0, 2.0, 0.5)
        assert node.observe("voltage") == 0.0
        assert not found.enabled()
        found.enable()
        assert found.enabled()
        assert found.peak().value == pytest.approx(0.5 if shape == "dc" else 1.5)
        assert driver.outlets() == (Outlet(1, on=True), Outlet(2, on=False))
        clock.sleep(0.02)
        since = int(node.inputs["drive"].split()[-1])
        times = since + np.arange(1, 400) * 37_003
        seen = node.waveform("voltage", times)
        assert seen == pytest.approx(0.5 + expected((times - since) * 500e-9), abs=1e-6)
        found.disable()
        assert node.observe("voltage") == 0.0


def test_clamps_hold_before_a_byte_leaves():
    """Amplitude and offset count together, and what stood before while it is on."""
    with generator(clamps={1: (CLAMP,)}) as (driver, clock):
        found = output(driver)
        with pytest.raises(ClampExceeded):
            found.configure("sine", 100.0, 2.0, 2.5)
        assert clock.now() == 0.0
        found.configure("sine", 100.0, 5.0, 0.0)
        found.enable()
        with pytest.raises(ClampExceeded):
            found.configure("dc", 100.0, 0.0, 2.0)


def test_what_it_cannot_do_is_refused_or_rejected():
    """By the driver where it knows, by the instrument where that knows."""
    with generator() as (driver, _):
        found = output(driver)
        for shape, frequency, amplitude in (("noise", 1.0, 1.0), ("sine", 0.0, 1.0), ("sine", 1.0, -1.0)):
            with pytest.raises(Refused):
                found.configure(shape, frequency, amplitude)
        with pytest.raises(Rejected, match="Settings conflict"):
            found.configure("sine", 100.0, 20.0, 5.0)
        with pytest.raises(Rejected, match="Data out of range"):
            found.configure("sine", 1e9, 1.0)


def test_an_output_that_stays_on_is_a_fault():
    """Off is read back; a dead instrument is silent."""
    with generator(faults=[{"kind": "refuse-off"}]) as (driver, _):
        output(driver).enable()
        with pytest.raises(Rejected, match="switched off and is on"):
            output(driver).disable()
    with generator(faults=[{"kind": "dead"}]) as (driver, _), pytest.raises(NoReply):
        output(driver).enable()
