"""Arbitrary bytes never break the simulated battery cycler, and its state is all that it needs to go on."""

from __future__ import annotations

import json

import sweeps
from cycler_page import CyclerUnderTest, sealed
from hypothesis import given, settings
from hypothesis import strategies as st

TEXTS = (
    *("ID", "STATE", "STOP", "CLEAR", "GET rest", "SET rest=10", "SET beat=10", "SET cycles=1", "SET vend=3.600"),
    *("BEAT run=0007A3F2", "BEAT run=0007A3F3", "START run=0007A3F2 settings=432A", "START run=0007A3F3 settings=432A"),
)
LINES = st.builds(lambda tag, text: sealed(f":{tag} {text}"), st.integers(0, 65_535), st.sampled_from(TEXTS))
PIECES = st.lists(st.one_of(st.binary(max_size=100), LINES, st.just(b"\n")), max_size=8)
SHOWN = st.tuples(st.floats(2.5, 4.3), st.floats(-1.1, 1.1), st.floats(-60, 130))


def sound(data):
    """Return whether a line of level 2 is whole and short enough."""
    text, _, check = data.decode("ascii").rpartition("*")
    return len(data) <= 140 and sealed(text) == f"{text}*{check}".encode("ascii").replace(b"\r\n", b"\n")


@settings(max_examples=sweeps.examples(100), derandomize=True)
@given(pieces=PIECES, pause=st.floats(0, 12), shown=SHOWN)
def test_the_cycler_survives_any_bytes(pieces, pause, shown):
    """Every line that it sends is whole, its state is JSON, both relays are never closed, and STOP opens them."""
    under = CyclerUnderTest()
    under.battery.show(*shown)
    for piece in pieces:
        under.peer.receive(piece)
        under.clock.sleep(pause)
        json.dumps(under.peer.state())
        assert under.relays() in {"-", "C", "D"}
    under.peer.receive(b"\n")
    assert all(sound(data) for _, data in under.sent)
    under.fetch()
    assert under.ask(":0 STOP")[0].startswith(":0 OK state=")
    assert under.relays() == "-"


@settings(max_examples=sweeps.examples(50), derandomize=True)
@given(pieces=st.lists(st.binary(min_size=1, max_size=100), min_size=1, max_size=8), pause=st.floats(0, 12))
def test_level_one_takes_any_byte_once(pieces, pause):
    """The first byte starts it, the others change nothing."""
    under = CyclerUnderTest({"level": "1"})
    under.battery.load = 0.7
    for piece in pieces:
        under.peer.receive(piece)
        under.clock.sleep(pause)
    texts = under.fetch()
    assert texts[0] == "TEST ITERATION 1"
    assert all(text.startswith("3.600;") for text in texts[1:])


@settings(max_examples=sweeps.examples(60), derandomize=True)
@given(
    before=PIECES,
    after=PIECES,
    shown=SHOWN,
    wait=st.floats(0, 30),
    level=st.sampled_from("12"),
    opens=st.booleans(),
)
def test_a_restored_cycler_goes_on_alike(before, after, shown, wait, level, opens):
    """One that was restored from the state's JSON sends the same bytes at the same instants as the one that went on."""
    truth = {"level": level, "voltage_noise": "0.01", "clock_drift": "0.003"}
    faults = [{"kind": "lost-lines", "lines": "2", "from": "1 s"}, {"kind": "torn-lines", "share": "0.3"}]
    first, second = (CyclerUnderTest(truth, faults) for _ in range(2))
    for under in (first, second):
        under.battery.show(*shown)
    if opens:
        first.peer.opened()
    for piece in before:
        first.peer.receive(piece)
        first.clock.sleep(0.07)
    first.clock.sleep(wait)
    second.clock.wait_until(first.clock.now_ns())
    second.peer.restore(json.loads(json.dumps(first.peer.state())))
    second.clock.asked = first.clock.asked
    second.battery.inputs = dict(first.battery.inputs)
    for under in (first, second):
        under.sent.clear()
        under.battery.history.clear()
        for piece in after:
            under.peer.receive(piece)
            under.clock.sleep(3)
        under.clock.sleep(30)
    assert second.sent == first.sent
    assert second.battery.history == first.battery.history
    assert second.peer.state() == first.peer.state()
