"""The world of a served bench: its pace, its lines, its true state, and faults that come while it lives."""

from __future__ import annotations

import pytest
import sweeps
from echo import EchoPeer
from served import Wall, bench_of

from hil.clock.virtual import VirtualClock
from hil.model.errors import Refused
from hil.simulation.registry import PEERS, fault_kinds
from hil.simulation.served.bench import true_state
from hil.simulation.served.ends import ServedLine
from hil.simulation.served.server import Pace

MS = 1_000_000
SETTINGS = {
    "chatty": {"every": "10 ms"},
    "identity": {"value": "0x47"},
    "late": {"by": "300 ms"},
    "nack": {"address": "0x68"},
    "stuck-relay": {"relay": "charge"},
    "welded": {"contact": "1"},
}


def test_the_bench_goes_at_its_speed():
    """At twenty times real time half a second of the wall is ten of the bench, and an event is awaited as long."""
    wall, clock = Wall(), VirtualClock()
    pace = Pace(wall, 20.0)
    happened = []
    clock.at(4_000 * MS, lambda: happened.append(clock.now_ns()))
    assert pace.seconds_until(4_000 * MS) == pytest.approx(0.2)
    wall.seconds += 0.5
    pace.follow(clock)
    assert happened == [4_000 * MS]
    assert clock.now_ns() == pytest.approx(10_000 * MS)
    assert pace.seconds_until(4_000 * MS) == 0
    assert pace.slipped_s == 0


def test_a_world_that_cannot_keep_up_slips():
    """Time that a busy world could not live through in a tenth of a second is left out, and told."""
    wall, clock = Wall(), VirtualClock()
    pace = Pace(wall, 1.0)

    def busy():
        wall.seconds += 0.06
        clock.at(clock.now_ns() + MS, busy)

    clock.at(0, busy)
    wall.seconds += 100.0
    pace.follow(clock)
    assert clock.now_ns() == MS
    assert pace.slipped_s == pytest.approx(100.0 - 0.001)
    before = clock.now_ns()
    wall.seconds += 0.0005
    assert before <= pace.present_ns()


def line_with(peer, baud):
    """Return a line with a client, and its clock."""
    clock = VirtualClock()
    line = ServedLine("echo", baud)
    peer.attach(line, clock)
    line.connect(peer, clock)
    line.opened()
    return line, clock


def test_bytes_take_the_time_of_their_bits_both_ways():
    """At 9600 baud eight bytes reach the peer after 8.33 ms, and its answer is there after as long again."""
    peer = EchoPeer(delay_ns=2 * MS)
    line, clock = line_with(peer, 9600)
    line.take(b"12345678")
    assert line.room == 0
    clock.wait_until(8 * MS)
    assert not peer.received
    clock.wait_until(9 * MS)
    assert peer.received_at == [pytest.approx(8.333 * MS, rel=1e-3)]
    assert line.room > 0
    clock.wait_until(18 * MS)
    assert not line.outbox
    clock.wait_until(19 * MS)
    assert line.outbox == b"12345678"


def test_what_nobody_fetches_overflows_and_is_counted():
    """A serial host holds four kilobytes; what comes besides is lost, and so is what comes while nobody is there."""
    peer = EchoPeer()
    line, clock = line_with(peer, 115200)
    line.send(b"a" * 4000)
    line.send(b"b" * 1000)
    clock.wait_until(1000 * MS)
    assert (len(line.outbox), line.lost) == (4096, 904)
    line.closed()
    line.send(b"c")
    clock.wait_until(2000 * MS)
    assert not line.outbox


def test_a_network_loses_nothing_of_a_long_reply():
    """A block of an oscilloscope is far longer than a serial host's buffer."""
    line, clock = line_with(EchoPeer(), 0)
    line.send(b"#9000250000" + b"x" * 250_000)
    clock.wait_until(MS)
    assert (len(line.outbox), line.lost) == (250_011, 0)


def test_a_network_takes_a_burst_at_once_and_a_flood_slowly():
    """A kilobyte is there at once; a client that goes on writing has to wait, as for an instrument's processor."""
    peer = EchoPeer()
    line, clock = line_with(peer, 0)
    taken = 0
    while line.room:
        line.take(b"x" * line.room)
        taken += 256
    clock.wait_until(0)
    assert 1024 <= len(peer.received) == taken <= 1536
    clock.wait_until(line.room_at_ns)
    assert line.room > 0


def test_the_true_state_is_found_by_its_path():
    """Plants show signals and inputs, groups of signals are found by their name, peers show what they keep."""
    bench = bench_of("adcs")
    everything = true_state(bench, "")
    assert set(everything) == {"plants", "peers", "lines"}
    assert set(everything["plants"]) == {"coil", "chamber", "table"}
    coil = true_state(bench, "plants.coil")
    assert coil["inputs"]["board"] == "reference"
    assert true_state(bench, "plants.coil.field") == {axis: coil["signals"][f"field.{axis}"] for axis in "xyz"}
    assert true_state(bench, "plants.coil.field.z") == coil["signals"]["field.z"]
    assert true_state(bench, "plants.coil.contact_a") is False
    assert true_state(bench, "peers.psu1.channels.2.on") is False
    assert true_state(bench, "peers.relay1.coils.0") is False
    assert true_state(bench, "lines.psu1") == {"open": False, "lost": 0}


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("plant", "did you mean 'plants'"),
        ("plants.coli", "did you mean 'coil'"),
        ("plants.coil.feild", "there is no 'feild'"),
        ("peers.psu1.channels.9", "there is no '9'"),
        ("peers.psu1.channels.2.on.more", "there is no 'more'"),
    ],
)
def test_a_wrong_path_is_told(path, message):
    """Whoever asks for what there is not learns what is near."""
    with pytest.raises(Refused, match=message):
        true_state(bench_of("adcs"), path)


def devices():
    """Return every device of both benches with every fault that it knows."""
    for name in ("adcs", "battery"):
        bench = bench_of(name)
        for instrument in bench.spec.instruments:
            model = PEERS[instrument.driver]
            for kind in (each.name for each in fault_kinds(model)):
                yield pytest.param(name, instrument.name, kind, id=f"{name}-{instrument.name}-{kind}")


@pytest.mark.parametrize(("name", "device", "kind"), sweeps.sample(devices(), 31))
def test_every_fault_can_come_while_the_bench_lives(name, device, kind):
    """A fault that is injected twice changes nothing at that instant, and the bench goes on."""
    bench = bench_of(name)
    bench.clock.wait_until(1_234_567_891)
    before = true_state(bench, "plants")
    row = {"kind": kind, "until": "500 ms", **SETTINGS.get(kind, {})}
    bench.inject(device, row)
    assert bench.clock.now_ns() == 1_234_567_891
    assert true_state(bench, "plants") == before
    bench.inject(device, {**row, "from": "100 ms"})
    bench.clock.wait_until(3_000 * MS)
    bench.inject(device, row)
    bench.clock.wait_until(4_000 * MS)


def answer(bench, command=b"*IDN?\n"):
    """Say something to the supply and return what is there a tenth of a second later."""
    line = bench.lines["psu1"]
    line.outbox.clear()
    line.take(command)
    bench.clock.wait_until(bench.clock.now_ns() + 100 * MS)
    return bytes(line.outbox)


def test_an_injected_fault_holds_from_and_until_as_counted_from_now():
    """A supply that dies in a second and for one second answers before and after; its outputs stay as they were."""
    bench = bench_of("adcs")
    bench.lines["psu1"].opened()
    bench.clock.wait_until(5_000 * MS)
    assert answer(bench, b"VOLT 3.3,(@3);:OUTP ON,(@3)\n*OPC?\n") == b"1\n"
    bench.inject("psu1", {"kind": "dead", "from": "1 s", "until": "2 s"})
    assert answer(bench).startswith(b"Keysight")
    bench.clock.wait_until(6_500 * MS)
    assert answer(bench) == b""
    assert true_state(bench, "plants.coil.sensor_power.voltage") == pytest.approx(3.3)
    bench.clock.wait_until(7_500 * MS)
    assert answer(bench).startswith(b"Keysight")
    assert true_state(bench, "peers.psu1.channels.3.on") is True


def spoken(bench, until_s):
    """Ask the table for its position ten times a second of the bench, and return every answer with its time."""
    line, heard = bench.lines["table1"], []
    while bench.clock.now_ns() < until_s * 1000 * MS:
        line.take(b"1TP\r\n")
        bench.clock.wait_until(bench.clock.now_ns() + 100 * MS)
        heard.append(bytes(line.outbox))
        line.outbox.clear()
    return heard


@pytest.mark.parametrize("kind", ["garbled", "late", "slipping"])
def test_a_fault_that_is_injected_is_the_one_of_the_bench_file(kind):
    """From the moment on at which it holds every byte is the one that would come had it been known from the start."""
    row = {"kind": kind, **SETTINGS.get(kind, {})}
    told, known = bench_of("adcs"), bench_of("adcs")
    known.inject("table1", {**row, "from": "3 s", "until": "6 s"})
    for bench in (told, known):
        bench.lines["table1"].opened()
        bench.lines["table1"].take(b"1MO;1VA20;1MV+\r\n")
    before = [spoken(bench, 2.0) for bench in (told, known)]
    told.inject("table1", {**row, "from": "1 s", "until": "4 s"})
    after = [spoken(bench, 8.0) for bench in (told, known)]
    assert before[0] == before[1]
    assert after[0] == after[1]
    assert true_state(told, "plants") == true_state(known, "plants")


def test_bytes_on_their_way_survive_an_injection():
    """A question that was asked before a fault came to another device is answered once, after it."""
    bench = bench_of("adcs")
    line = bench.lines["psu1"]
    line.opened()
    line.take(b"*IDN?\n")
    bench.inject("relay1", {"kind": "welded", "contact": "1"})
    bench.clock.wait_until(MS)
    bench.inject("relay1", {"kind": "welded", "contact": "2"})
    bench.clock.wait_until(100 * MS)
    assert line.outbox.count(b"Keysight") == 1


@pytest.mark.parametrize(
    ("device", "row", "message"),
    [
        ("psu9", {"kind": "dead"}, "no simulated device 'psu9'"),
        ("psu1", {"kind": "daed"}, "did you mean 'dead'"),
        ("psu1", {"kind": "dead", "from": 3}, "must be a duration"),
        ("psu1", {"kind": "late"}, "'by' is missing"),
        ("psu1", {"kind": "dead", "form": "1 s"}, "unknown key 'form'"),
        ("psu1", {}, "'kind' is missing"),
    ],
)
def test_a_fault_that_cannot_be_is_refused_and_the_bench_goes_on(device, row, message):
    """A wrong fault is told as in a bench file, and nothing has changed."""
    bench = bench_of("adcs")
    bench.lines["psu1"].opened()
    world = bench.world
    with pytest.raises(Refused, match=message):
        bench.inject(device, row)
    assert bench.world is world
    assert answer(bench).startswith(b"Keysight")
