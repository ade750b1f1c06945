"""What goes wrong with the simulated battery cycler, and how its lines show it."""

from __future__ import annotations

import pytest
from cycler_page import Battery, CyclerUnderTest, sealed

from hil.clock.virtual import VirtualClock
from hil.simulation.faults import Faults, read_faults
from hil.simulation.peers.cycler.firmware import MODEL
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import TruthError
from hil.wire.simulated_line import SimulatedLine


def running(faults, **settings):
    """Return a cycler that charges a battery for ever."""
    under = CyclerUnderTest(faults=faults)
    under.battery.load = 0.7
    assert len(under.start(beat="600", **settings)) == 2
    return under


def test_a_reset_opens_the_relays_and_shows_in_the_banner():
    """A dip of the supply ends the test; lines count from 1 again."""
    under = running([{"kind": "reset", "from": "12 s"}])
    lines = under.wait(30)
    assert [line.split(";")[0] for line in lines] == ["3.600", "3.600", "START ARDUINO", "IDLE", "IDLE", "IDLE"]
    assert lines[2].endswith(";42;BROWNOUT")
    assert [line.split(";")[1] for line in lines[2:]] == ["1", "2", "3", "4"]
    assert under.battery.history[-1] == (12_000_000_000, "charge", False)


def test_lost_lines_leave_a_gap_in_the_numbers():
    """As many as the fault says, replies included, from the instant that it says."""
    under = running([{"kind": "lost-lines", "lines": "3", "from": "8 s"}])
    numbers = [line.split(";")[4] for line in under.wait(40)]
    assert numbers == ["3", "7", "8", "9", "10"]
    under = running([{"kind": "lost-lines", "from": "8 s"}])
    under.wait(9)
    assert under.ask(":5 ID") == []
    assert len(under.ask(":5 ID")) == 1


def test_torn_lines_are_shorter_and_fail_their_sum():
    """About the share of all lines misses a piece; the others are whole."""
    under = running([{"kind": "torn-lines", "share": "0.25"}])
    under.clock.sleep(5 * 400)
    whole = [data for _, data in under.sent if data.endswith(b"\r\n") and _sound(data)]
    assert len(under.sent) == 400
    assert 60 <= len(under.sent) - len(whole) <= 140
    again = running([{"kind": "torn-lines", "share": "0.25"}])
    again.clock.sleep(5 * 400)
    assert again.sent == under.sent


def test_a_spike_is_in_the_lines_of_its_time_alone():
    """One line shows what was added to its voltage, the others what there is."""
    under = running([{"kind": "spike", "volts": "0.05", "from": "12 s", "until": "17 s"}])
    assert [line.split(";")[0] for line in under.wait(24)] == ["3.600", "3.600", "3.650", "3.600"]


def _sound(data):
    text, star, _ = data.decode("ascii").rpartition("*")
    return bool(star) and sealed(text).rstrip(b"\n") == data.rstrip(b"\r\n")


@pytest.mark.parametrize(("relay", "closed"), [("charge", "C"), ("discharge", "-")])
def test_a_stuck_relay_stays_where_it_is(relay, closed):
    """STOP is answered and says what the coil does; the contact follows when the fault is over."""
    under = running([{"kind": "stuck-relay", "relay": relay, "from": "1 s", "until": "20 s"}])
    under.wait(6)
    assert under.ask(":0 STOP")[0] == ":0 OK state=STOPPED"
    assert "relays=- " in under.ask(":3 STATE")[0]
    assert under.relays() == closed
    under.wait(20)
    assert under.relays() == "-"


def test_a_relay_that_does_not_open_trips_a_rest():
    """Three lines of a rest with a current are enough."""
    under = running(
        [{"kind": "stuck-relay", "relay": "charge", "from": "1 s"}], rest="600", vfull="3.600", vend="3.000"
    )
    under.battery.load = 0.04
    assert under.wait(5)[-1].startswith("CHARGE END")
    under.battery.load = 0.7
    assert under.wait(15)[-1].startswith("TEST TRIPPED RELAY")


def test_a_relay_that_does_not_close_trips_for_want_of_current():
    """Twelve lines without a current are enough."""
    under = running([{"kind": "stuck-relay", "relay": "charge"}])
    assert under.wait(60)[-1].startswith("TEST TRIPPED CURRENT")


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ({"kind": "lost-lines", "lines": "0"}, "must be at least 1"),
        ({"kind": "stuck-relay"}, "'relay' is missing"),
        ({"kind": "stuck-relay", "relay": "charg"}, "did you mean 'charge'?"),
        ({"kind": "torn-lines", "share": "2"}, "must be at most 1"),
    ],
)
def test_a_fault_that_cannot_be(row, message):
    """It is told with its place."""
    with pytest.raises(TruthError) as caught:
        read_faults([row], ("faults",), fault_kinds(MODEL))
    assert message in str(caught.value) + " ".join(map(str, caught.value.others))


def test_opening_the_port_reaches_the_cycler():
    """The line tells a peer that can notice it, through the wrapper of its faults, but one without power."""
    under = CyclerUnderTest()
    line = SimulatedLine("cycler", under.peer, under.clock)
    line.opened()
    under.clock.sleep(2)
    assert under.fetch()[0].startswith("START ARDUINO;1;0;")
    dead = CyclerUnderTest(faults=[{"kind": "dead", "until": "1 s"}])
    SimulatedLine("cycler", dead.peer, dead.clock).opened()
    assert dead.wait(2) == []


def test_a_peer_that_cannot_notice_is_opened_all_the_same():
    """The wrapper and the line ask for nothing that a peer does not have."""
    clock = VirtualClock()

    class Plain:
        def attach(self, line, clock):
            """Take nothing."""

        def receive(self, data):
            """Take nothing."""

    peer = FaultySerialPeer(Plain(), Faults(), Seeds(1).stream("plain", "faults"))
    peer.attach(Battery(), clock)
    line = SimulatedLine("plain", peer, clock)
    line.opened()
    assert line.waiting() == 0
