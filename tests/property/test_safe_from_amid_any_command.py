"""A driver that is killed after any byte leaves a line from which bytes alone make the output safe."""

from __future__ import annotations

import pytest
import sweeps
from by_bytes import BY_BYTES, rig


def recorded(kind):
    """Return all that a driver writes in its session, with the instants, and the bytes that make it safe."""
    with rig(kind) as found:
        kind.drive(found)
        assert found.on()
        return tuple(found.sent), found.code(kind.proof)


def cuts(sent):
    """Return every place within what was sent: the number of whole writes, and of bytes of the next."""
    return [(place, size) for place, (_, data) in enumerate(sent) for size in range(len(data))]


def cut_off(found, sent, place, size):
    """Send again what was sent, at the same instants, up to one place."""
    for at_ns, data in sent[:place]:
        found.clock.wait_until(at_ns)
        found.line.write(data)
    at_ns, data = sent[place]
    found.clock.wait_until(at_ns)
    if size:
        found.line.write(data[:size])


@pytest.mark.parametrize("name", BY_BYTES)
def test_it_is_made_safe_wherever_the_driver_ends(name):
    """At every byte of a session: everything goes off, and that is proven."""
    kind = BY_BYTES[name]
    sent, code = recorded(kind)
    was_on = 0
    for place, size in sweeps.sample(cuts(sent), 30):
        with rig(kind) as found:
            cut_off(found, sent, place, size)
            was_on += bool(found.on())
            assert found.make_safe(code), (sent[place], size)
            assert not found.on(), (sent[place], size)
    assert was_on


@pytest.mark.parametrize("name", sorted(set(BY_BYTES) - {"eurotherm-3216", "omron-e5cc", "waveshare-relay"}))
def test_half_a_command_switches_nothing_on(name):
    """What ends a rest on the line does not let it be executed: nothing that was off is on for a moment.

    Frames with a checksum at their end are whole or nothing.
    """
    kind = BY_BYTES[name]
    sent, code = recorded(kind)
    for place, size in sweeps.sample(cuts(sent), 30):
        with rig(kind) as found:
            cut_off(found, sent, place, size)
            found.clock.sleep(0.2)  # whole commands before it are carried out
            before = found.on()
            for exchange in (*code.resync, *code.off):
                found.exchange(exchange)
                found.clock.sleep(0.2)
                assert found.on() <= before, (sent[place], size)
