"""The composition root: a bench file becomes drivers on ports, simulated or replayed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from adcs_bench import adcs, bound

from hil.bench.binding import bind_replayed, bind_simulated
from hil.model.bench import Bus
from hil.model.errors import ClampExceeded, Diverged, EvidenceError, Refused
from hil.model.identity import Source
from hil.wire.exchange import find_bus, find_stream
from hil.wire.transcript import Transcript, read_transcript


def test_simulated_bench_answers_as_its_file_says():
    """Every role of the wiring is there, on simulated instruments that are who they should be."""
    with bound(adcs()) as bench:
        assert bench.source is Source.SIMULATED
        assert sorted(bench.roles) == ["magnetometer", "relays", "supply.coil", "supply.sensor"]
        assert bench.drivers["psu1"].identify().serial == "SIM-MY59002391"
        assert bench.person is bench.world.person
        assert bench.clock.utc().startswith("2026-01-01T08:00:0")
        assert bench.playback is None


def test_two_benches_of_one_name_in_a_process():
    """The second is refused and leaves the first as it is; after close the name is free."""
    with bound(adcs()) as first:
        with pytest.raises(Refused, match="sim://adcs/psu1 is in use by another bench of this process"):
            bind_simulated(adcs(), Transcript(None))
        assert first.roles["supply.coil"].enabled() is False
    assert find_stream("sim://adcs/psu1") is None
    assert find_bus("sim://adcs/i2c1") is None
    with bound(adcs()) as second:
        assert second.roles["supply.coil"].enabled() is False


def test_bench_that_cannot_be_bound_leaves_nothing_behind():
    """A driver that does not fit its connection is refused, and the name is free at once."""
    spec = adcs()
    psu1, relay1, mag1 = spec.instruments
    wrong = replace(spec, instruments=(psu1, relay1, replace(mag1, driver="keysight-e36300")), simulated=spec.simulated)
    peers = tuple(replace(peer, model="lis3mdl") if peer.device == "mag1" else peer for peer in spec.simulated.peers)
    wrong = replace(wrong, simulated=replace(spec.simulated, peers=peers))
    with pytest.raises(Refused, match="the driver keysight-e36300 needs a port"):
        bind_simulated(wrong, Transcript(None))
    with bound(spec) as bench:
        assert bench.drivers["mag1"] is not None


def test_unknown_driver_leaves_nothing_behind():
    """The same for a driver that is not installed."""
    spec = adcs()
    peers = tuple(
        replace(peer, model="keysight-e36300") if peer.device == "psu1" else peer for peer in spec.simulated.peers
    )
    instruments = (replace(spec.instruments[0], driver="keysight-e36400"), *spec.instruments[1:])
    wrong = replace(spec, instruments=instruments, simulated=replace(spec.simulated, peers=peers))
    with pytest.raises(Refused, match="unknown driver 'keysight-e36400', did you mean 'keysight-e36300'"):
        bind_simulated(wrong, Transcript(None))
    assert find_stream("sim://adcs/psu1") is None


def test_closing_twice_is_harmless():
    """A bench that was closed can be closed again."""
    with bound(adcs()) as bench:
        bench.close()


def written(path):
    """Return what a transcript holds that was sent to the supply."""
    return [operation.sent for operation in read_transcript(path) if operation.device == "psu1" and operation.sent]


@pytest.mark.parametrize(("voltage", "current"), [(6.01, 0.01), (5.0, 0.0201), (-0.1, 0.01)])
def test_clamp_stops_a_setting_before_its_bytes(tmp_path, voltage, current):
    """A setting beyond the bench file's clamps raises, and the transcript holds no byte of it."""
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        bench = bind_simulated(adcs(), transcript)
        try:
            with pytest.raises(ClampExceeded, match="supply.coil: (voltage|current) .* is outside its clamp"):
                bench.roles["supply.coil"].configure(voltage, current)
            transcript.flush()
            assert written(path) == []
            bench.roles["supply.coil"].configure(6.0, 0.02)
            bench.roles["supply.sensor"].configure(3.3, 0.05)
        finally:
            bench.close()
        transcript.flush()
    assert any(b"VOLT" in sent for sent in written(path))


def test_clamps_are_each_outputs_own():
    """3.4 V are the end for the sensor's supply, not for the coil's."""
    with bound(adcs()) as bench:
        bench.roles["supply.coil"].configure(3.5, 0.02)
        with pytest.raises(ClampExceeded, match="supply.sensor: voltage 3.5 V is outside its clamp 0 to 3.4 V"):
            bench.roles["supply.sensor"].configure(3.5, 0.02)


def conversation(bench):
    """Talk to all instruments, and return what was seen."""
    roles = bench.roles
    seen = [str(bench.drivers["psu1"].identify())]
    roles["supply.sensor"].configure(3.3, 0.02)
    roles["supply.sensor"].enable()
    bench.clock.sleep(0.1)
    seen += [roles["supply.sensor"].voltage(), roles["supply.sensor"].current()]
    roles["relays"].close("a")
    seen.append(roles["relays"].closed())
    roles["magnetometer"].start()
    seen.append(roles["magnetometer"].sample())
    roles["supply.sensor"].disable()
    return [*seen, bench.clock.now_ns()]


@pytest.fixture
def record(tmp_path):
    """A short recorded conversation: the transcript's path, and what was seen."""
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        bench = bind_simulated(adcs(), transcript)
        try:
            seen = conversation(bench)
        finally:
            bench.close()
        transcript.flush()
    return path, seen


def test_replay_shows_what_was_recorded(record):
    """The same conversation on the recorded bytes gives the same numbers at the same instants."""
    path, seen = record
    bench = bind_replayed(adcs(), Transcript(None), path, lambda: "step 1")
    try:
        assert bench.source is Source.REPLAYED
        assert not bench.has_person
        with pytest.raises(Refused, match="has no simulated person; answer with --answers or --ask"):
            bench.person  # noqa: B018 - asking is enough
        assert conversation(bench) == seen
        assert bench.playback.exhausted
    finally:
        bench.close()


def test_replay_of_another_conversation_diverges(record):
    """Another setting than the recorded one is told with device, step and both byte sequences."""
    path, _ = record
    bench = bind_replayed(adcs(), Transcript(None), path, lambda: "step 2 of test_x")
    try:
        bench.drivers["psu1"].identify()
        with pytest.raises(Diverged, match=r"psu1: write .* at step 2 of test_x, but the record holds psu1: write"):
            bench.roles["supply.sensor"].configure(3.2, 0.02)
    finally:
        bench.close()
    assert find_stream("replay://adcs/psu1") is None


def test_record_that_is_none_is_refused(tmp_path):
    """A file that is no transcript is told so, and no name is taken."""
    (tmp_path / "transcript.tsv").write_text("nothing\n", encoding="utf-8")
    with pytest.raises(EvidenceError, match="transcript.tsv is not a transcript of format 1 to 10"):
        bind_replayed(adcs(), Transcript(None), tmp_path / "transcript.tsv", lambda: "")
    assert find_stream("replay://adcs/psu1") is None


def test_bus_without_devices_is_there():
    """A bus that the file names and nobody uses disturbs nobody."""
    spec = adcs()
    with bound(replace(spec, buses=(*spec.buses, Bus(name="i2c2", port="/dev/i2c-2")))) as bench:
        assert bench.roles["supply.coil"].mode() == "off"
