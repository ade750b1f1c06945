"""Plans as JSON, and packets between two processes."""

from __future__ import annotations

import json
import os

import pytest
from guarded import output_of, plan_of
from hypothesis import given
from hypothesis import strategies as st

from hil.guardian import channel
from hil.guardian.channel import HungUp
from hil.guardian.plan_codec import read_plan, seconds_of, written_plan
from hil.model.safing import Exchange, GuardedOutput, GuardedPort, GuardPlan, SafeBytes

_NAMES = st.text(max_size=8)
_SECONDS = st.floats(0, 1e4)
_EXCHANGES = st.lists(
    st.builds(
        Exchange,
        send=st.binary(max_size=20),
        expect=st.sampled_from([b"", rb"\Aon ([-0-9.]+)\r\n", b"\x01\x06(\x00)\xff"]),
        within_s=_SECONDS,
        quiet_s=_SECONDS,
    ),
    max_size=3,
).map(tuple)
_OUTPUTS = st.builds(
    GuardedOutput,
    output=_NAMES,
    state=_NAMES,
    device=st.just("psu"),
    within_s=_SECONDS,
    code=st.builds(
        SafeBytes,
        resync=_EXCHANGES,
        off=_EXCHANGES,
        proof=_EXCHANGES,
        who=st.none() | st.just(Exchange(send=b"*IDN?\n", expect=rb"[^\n]+\n")),
    ),
    cut_by=st.lists(_NAMES, max_size=2).map(tuple),
)


@given(outputs=st.lists(_OUTPUTS, max_size=3), names=st.lists(_NAMES, max_size=3), hang_s=_SECONDS)
def test_a_plan_is_read_as_it_was_written(outputs, names, hang_s):
    """Whatever the bytes are, none is lost."""
    plan = GuardPlan(
        bench="adcs",
        run="reports/1",
        ports=(GuardedPort(device="psu", url="/dev/ttyUSB0", baud=9600), GuardedPort(device="relays")),
        outputs=tuple(outputs),
        hang_s=hang_s,
        latches=tuple(names),
        journal="guardian.jsonl",
    )
    assert read_plan(written_plan(plan)) == plan


def test_limits_of_a_number_are_kept(tmp_path):
    """They come back as a pair."""
    plan = plan_of(tmp_path, output_of("one", "psu"))
    assert read_plan(written_plan(plan)).outputs[0].code.proof[1].between == (-0.05, 0.05)


@pytest.mark.parametrize(
    ("proof", "device", "why"),
    [
        (Exchange(send=b"", expect=b"on ("), "psu", "not a regular expression"),
        (Exchange(send=b"", expect=b"on", between=(0.0, 1.0)), "psu", "no group"),
        (Exchange(send=b""), "other", "no port"),
    ],
)
def test_a_plan_that_could_not_be_carried_out_is_refused_before_it_is_needed(proof, device, why):
    """Mistakes are told while the executive is there to hear it."""
    code = SafeBytes(off=(), proof=(proof,))
    output = GuardedOutput(output="one", state="off", device=device, within_s=1.0, code=code)
    plan = GuardPlan(bench="b", run="r", ports=(GuardedPort(device="psu"),), outputs=(output,), journal="")
    with pytest.raises(ValueError, match=why):
        read_plan(written_plan(plan))


@pytest.mark.parametrize("wrong", [b"", b"[]", b"{}", json.dumps({"bench": 1}).encode()])
def test_what_is_no_plan_is_refused(wrong):
    """Half a plan is none."""
    with pytest.raises((ValueError, KeyError, TypeError)):
        read_plan(wrong)


def test_an_exchange_takes_no_longer_than_is_reckoned():
    """Silence that does not come, bytes that are not taken, and no reply."""
    code = SafeBytes(
        off=(Exchange(send=b"x", within_s=0.2, quiet_s=0.1),),
        proof=(Exchange(send=b"x", within_s=0.2, quiet_s=0.1),),
        owed_s=0.5,
    )
    assert seconds_of(code) == pytest.approx(1.4 + 3.0)


def test_packets_come_whole_with_their_descriptors():
    """Two packets stay two, and what was passed is open on the other side."""
    one, other = channel.pair()
    with one, other:
        assert channel.receive(other) is None
        assert channel.send(one, "plan", one.fileno(), number=1)
        assert channel.send(one, "beat")
        told, (passed,) = channel.receive(other)
        assert told == {"kind": "plan", "number": 1}
        os.close(passed)
        assert channel.receive(other) == ({"kind": "beat"}, [])


def test_sending_to_who_does_not_read_does_not_wait():
    """A stopped process fills its side; who sends is told, and goes on."""
    one, other = channel.pair()
    with one, other:
        sent = 0
        while channel.send(one, "beat"):
            sent += 1
            assert sent < 1_000_000
        assert sent > 10
        assert channel.receive(other) == ({"kind": "beat"}, [])


def test_a_closed_end_is_known_on_the_other():
    """What was sent before is read first."""
    one, other = channel.pair()
    with other:
        channel.send(one, "leave")
        one.close()
        assert channel.receive(other) == ({"kind": "leave"}, [])
        with pytest.raises(HungUp):
            channel.receive(other)
        with pytest.raises(HungUp):
            channel.send(other, "heard")
