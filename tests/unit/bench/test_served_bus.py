"""A bus that an instrument serves: read, checked, bound, simulated and replayed."""

from __future__ import annotations

import errno
from dataclasses import replace

import pytest
from adcs_bench import bound, changed, found
from obc_bench import OBC_LINES, obc_bench

from hil.bench.binding import bind_replayed, bind_simulated, check_twin
from hil.bench.file.reading import load_bench
from hil.instruments.driver import ServesBus
from hil.model.bench import InstrumentSpec
from hil.model.errors import ConfigurationError, Refused
from hil.wire.exchange import find_bus, find_stream
from hil.wire.transcript import Transcript, read_transcript

FILE = "fixtures/benches/adcs/bench.yaml"
WHO_AM_I = 0x75


def place(text: str, snippet: str) -> str:
    """Return file, line and column of a snippet."""
    before = text[: text.index(snippet)]
    return f"{FILE}:{before.count(chr(10)) + 1}:{len(before) - (before.rfind(chr(10)) + 1) + 1}"


def test_a_served_bus_is_read(tmp_path):
    """The bus knows who serves it, and how fast; nothing is wrong with such a bench, its twin neither."""
    changed(tmp_path, *OBC_LINES)
    spec = load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    bus = next(bus for bus in spec.buses if bus.name == "adcs")
    assert (bus.port, bus.instrument, bus.frequency_hz) == ("", "obc1", 400_000.0)


@pytest.mark.parametrize(
    ("change", "at", "message"),
    [
        (("{instrument: obc1", "{instrument: obc2"), "adcs: {", "unknown instrument 'obc2', did you mean 'obc1'?"),
        (("{instrument: obc1", "{instrument: psu1"), "adcs: {", "psu1 serves no bus: the driver keysight-e36300 has"),
        (("{instrument: obc1", "{port: /dev/i2c-2, instrument: obc1"), "adcs: {", "adcs needs either a port or an ins"),
        (("{instrument: obc1, ", "{"), "adcs: {", "adcs needs either a port or an instrument that serves it"),
        (("{instrument: obc1", "{instument: obc1"), "instument", "unknown key 'instument', did you mean 'instrument'?"),
        (
            ("port: /dev/serial/by-id/usb-STM_NUCLEO-if02", 'bus: adcs, address: "0x70"'),
            "adcs: {",
            "adcs leads back to itself: obc1, which serves it, is on bus adcs",
        ),
        (
            ("  gyro1: {", '  gyro2: {driver: iim42652, bus: adcs, address: "0x68"}\n  gyro1: {'),
            '"0x68"',
            "gyro1 and gyro2 are both at bus adcs, address 0x68",
        ),
        (
            ("  adcs: {instr", "  more: {instrument: obc1}\n  adcs: {instr"),
            "adcs: {",
            "obc1 serves more already",
        ),
        (("bus: adcs,", "bus: adsc,"), "gyro1: {driver", "unknown bus 'adsc', did you mean 'adcs'?"),
    ],
)
def test_what_is_wrong_with_a_served_bus(tmp_path, change, at, message):
    """Unknown, unable, both, none, misspelt, behind itself, two at one address, two buses of one: each has a place."""
    text = changed(tmp_path, *OBC_LINES, change)
    assert any(line.startswith(f"{place(text, at)}: {message}") for line in found(tmp_path)), found(tmp_path)


def test_two_boards_behind_each_other(tmp_path):
    """A ring of any length is found, and reading it ends."""
    changed(
        tmp_path,
        *OBC_LINES,
        ("  adcs: {", "  deep: {instrument: obc2}\n  adcs: {"),
        ("port: /dev/serial/by-id/usb-STM_NUCLEO-if02", 'bus: deep, address: "0x70"'),
        ("  gyro1: {", '  obc2: {driver: obc-link, bus: adcs, address: "0x71"}\n  gyro1: {'),
    )
    lines = found(tmp_path)
    assert [line for line in lines if "deep leads back to itself: obc2, which serves it, is on bus adcs" in line]
    assert [line for line in lines if "adcs leads back to itself: obc1, which serves it, is on bus deep" in line]


def test_a_peer_that_serves_no_bus_has_a_place_too(tmp_path):
    """Where another peer stands in for the board, nobody could run the transfers."""
    text = changed(tmp_path, *OBC_LINES, ("obc1: {}", "obc1: {model: keysight-e36300}"))
    with pytest.raises(ConfigurationError) as caught:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    (line,) = map(str, caught.value.findings)
    assert line.startswith(place(text, "keysight-e36300}"))
    assert "this peer serves no bus, so adcs has no devices" in line


def test_an_instrument_behind_another_answers_through_it():
    """The gyroscope is read over the board, although the file names it first; the bus has no end of its own."""
    with bound(obc_bench()) as bench:
        assert isinstance(bench.drivers["obc1"], ServesBus)
        assert list(bench.drivers)[-1] == "gyro1"
        assert bench.drivers["gyro1"].identify().model
        assert bench.buses["adcs"].read_byte_data(0x68, WHO_AM_I) == 0x6F
        assert find_bus("sim://adcs/adcs") is None
        assert find_bus("sim://adcs/i2c1") is not None


def test_the_bus_runs_at_the_speed_of_the_file():
    """The same transfer takes longer on a slower bus."""
    took = []
    for frequency_hz in (100_000.0, 400_000.0):
        spec = obc_bench()
        spec = replace(spec, buses=(spec.buses[0], replace(spec.buses[1], frequency_hz=frequency_hz)))
        with bound(spec) as bench:
            bench.buses["adcs"].read_byte_data(0x68, WHO_AM_I)
            before_ns = bench.clock.now_ns()
            bench.buses["adcs"].read_i2c_block_data(0x68, 0x10, 32)
            took.append(bench.clock.now_ns() - before_ns)
    # Two addresses, the register's number and 32 bytes of 9 bits.
    assert took[0] - took[1] == 35 * 9 * 7500


def test_devices_on_one_served_bus_share_it():
    """Two drivers get one bus; who is not there is no acknowledge, not silence."""
    spec = obc_bench()
    extra = InstrumentSpec(name="gyro2", driver="iim42652", bus="adcs", address=0x69)
    spec = replace(spec, instruments=(*spec.instruments, extra))
    with bound(spec) as bench:
        assert list(bench.buses) == ["adcs"]
        with pytest.raises(OSError, match="0x69") as caught:
            bench.buses["adcs"].read_byte_data(0x69, WHO_AM_I)
        assert caught.value.errno == errno.EREMOTEIO


def test_a_driver_that_serves_no_bus_is_refused_at_binding(tmp_path):
    """A bench that was put together without its file's checks ends in a sentence, and frees its name."""
    record = tmp_path / "transcript.tsv"
    with record.open("wb", buffering=0) as sink:
        Transcript(sink).flush()
    spec = obc_bench()
    wrong = replace(spec, buses=(spec.buses[0], replace(spec.buses[1], instrument="psu1")))
    with pytest.raises(Refused, match="psu1 serves no bus; give 'adcs' a port, or another instrument"):
        bind_replayed(wrong, Transcript(None), record, lambda: "")
    assert find_stream("replay://adcs/psu1") is None


def test_a_restored_world_has_the_board_and_what_is_behind_it():
    """State and restore go through the board."""
    with bound(obc_bench()) as bench:
        bench.buses["adcs"].write_byte_data(0x68, 0x4F, 0x26)
        bench.clock.sleep(0.2)
        state, now_ns = bench.world.state(), bench.clock.now_ns()
    with bound(obc_bench()) as other:
        other.clock.wait_until(now_ns)
        other.world.restore(state)
        assert other.world.state() == state
        assert other.buses["adcs"].read_byte_data(0x68, 0x4F) == 0x26


def conversation(bench):
    """Talk to the board and over it to the gyroscope, and return what was seen."""
    seen = [str(bench.drivers["obc1"].identify()), str(bench.drivers["gyro1"].identify())]
    seen.append(bench.roles["obc"].analog(0))
    bus = bench.buses["adcs"]
    seen.append(bus.read_i2c_block_data(0x68, 0x1D, 4))
    with pytest.raises(OSError, match="0x1c behind obc1"):
        bus.read_byte(0x1C)
    bench.clock.sleep(0.1)
    return [*seen, bench.clock.now_ns()]


def test_replay_of_a_served_bus(tmp_path):
    """The record holds the board's bytes only, and they are enough: the same numbers at the same instants."""
    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        with_board = bind_simulated(obc_bench(), transcript)
        try:
            seen = conversation(with_board)
        finally:
            with_board.close()
        transcript.flush()
    assert {operation.device for operation in read_transcript(path)} == {"obc1"}
    bench = bind_replayed(obc_bench(), Transcript(None), path, lambda: "step 1")
    try:
        assert conversation(bench) == seen
        assert bench.playback.exhausted
    finally:
        bench.close()
