"""The physics of a whole simulated bench depends on its commands alone, not on who looks, how often, and when."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
from twin import Twin

COMMANDS = (
    ("psu", b"VOLT 3.3,(@1);CURR 0.1,(@1);:OUTP ON,(@1)\n"),
    ("board", "x_plus"),
    ("psu", b"VOLT 5,(@2);CURR 0.016,(@2);:OUTP ON,(@2)\n"),
    ("relays", bytes.fromhex("01 05 00 00 FF 00 8C 3A")),
    ("relays", bytes.fromhex("01 05 00 01 FF 00 DD FA")),
    ("psu", b"CURR 0.008,(@2)\n"),
    ("board", "y_plus"),
    ("psu", b"OUTP OFF,(@2)\n"),
)
INSTANTS_NS = tuple(173_456_789 * (number + 1) for number in range(len(COMMANDS)))
END_NS = 2_000_000_000
QUIET_NS = 30_000_000
"""Nobody looks so shortly before a command: a look takes time, and a command at another instant is another command."""
SILENCE_NS = 5_000_000
"""A frame of Modbus ends with a silence; a query within it would spoil the frame, on real lines too."""


def look(twin, rng):
    """Look at something, in one of the ways that there are."""
    match rng.integers(6):
        case 0:
            twin.exchange("psu", b"MEAS:CURR? (@2)\n", 0.02)
        case 1:
            twin.exchange("psu", b"MEAS:VOLT? (@1);:STAT:QUES:INST:ISUM2:COND?\n", 0.02)
        case 2:
            twin.exchange("relays", bytes.fromhex("01 01 00 00 00 08 3D CC"), 0.02)
        case 3:
            twin.coil.observe("field.z")
        case 4:
            twin.world.person.answer("choose", "compass", "Which way?", ("outward", "inward", "unclear"))
        case _:
            twin.clock.sleep(float(rng.uniform(1e-6, 2e-2)))


def command(twin, number):
    """Give one command at its instant."""
    twin.clock.wait_until(INSTANTS_NS[number])
    device, what = COMMANDS[number]
    if device == "board":
        twin.coil.command(board=what)
    else:
        twin.lines[device].write(what)


def moments(twin):
    """Return every plant's state as JSON, which keeps every bit."""
    return json.dumps(twin.world.state()["plants"], sort_keys=True)


def lived(seed=None, *, restored_after=None):
    """Return a world's plants at the end; a seed lets it be looked at, a number lets a fresh world go on from there."""
    twin, rng = Twin(), None if seed is None else np.random.default_rng(seed)
    for number, (instant_ns, next_ns) in enumerate(pairwise((*INSTANTS_NS, END_NS))):
        command(twin, number)
        twin.clock.wait_until(instant_ns + SILENCE_NS)
        while rng is not None and twin.clock.now_ns() < next_ns - QUIET_NS:
            look(twin, rng)
        if number == restored_after:
            twin.clock.wait_until(instant_ns + 40_000_000)  # lines are quiet again, contacts have settled
            twin = restored(twin)
    twin.clock.wait_until(END_NS)
    return moments(twin)


def restored(twin):
    """Return a fresh world that goes on from the state of this one, through JSON."""
    state = json.loads(json.dumps(twin.world.state()))
    other = Twin()
    other.clock.wait_until(twin.clock.now_ns())
    other.world.restore(state)
    return other


@pytest.mark.parametrize("seed", range(12))
def test_looking_changes_no_plant(seed):
    """Queries, sensor reads, answers and idle waits at random instants leave every bit of the plants as it was."""
    assert lived(seed) == lived()


@pytest.mark.parametrize("number", range(len(COMMANDS)))
def test_a_world_restored_between_commands_ends_the_same(number):
    """A fresh world that takes the state over goes on to the same bits."""
    assert lived(restored_after=number) == lived()


def test_the_commands_move_the_plants():
    """What is compared is not a bench at rest: current, copper and board change on the way."""
    twin = Twin()
    currents = []
    for number in range(len(COMMANDS)):
        command(twin, number)
        twin.clock.sleep(0.06)
        currents.append(round(twin.coil.observe("winding_current"), 3))
    assert currents == [0, 0, 0.016, 0, -0.016, -0.008, -0.008, 0]
