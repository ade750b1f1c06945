"""A bench on hardware whose supply takes messages: opened, tapped, guarded and replayed as one at a plain stream."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from message_servers import HiSlipServer, Supply
from serial_server import SerialServer

from hil.bench.binding import bind_replayed
from hil.bench.file.reading import load_bench
from hil.bench.live import bind_live, reach_of_hardware
from hil.executive.watching.machine import plan_of
from hil.model.bench import InstrumentSpec, SafeStep, Wire
from hil.model.errors import Diverged, Refused
from hil.model.serial_line import SerialLine
from hil.wire.transcript import Transcript, read_transcript

ROOT = Path(__file__).parents[3]
FILE = load_bench(ROOT / "fixtures" / "benches", "battery", ROOT)
EPOCH = "2026-01-01T00:00:00Z"


def bench_of(port, **more):
    """Return a bench of one supply."""
    return replace(
        FILE,
        instruments=(InstrumentSpec(name="psu1", driver="keysight-e36300", port=port, **more),),
        wiring=(Wire(role="supply", instance="charge", instrument="psu1", channel=1),),
        safe_off=(SafeStep(output="supply.charge", state="off", within_s=2.0),),
        **dict.fromkeys(("buses", "clamps", "envelope", "rest", "hold", "cut_paths", "watch_after"), ()),
    )


def test_it_is_transcribed_and_replayed(tmp_path):
    """The bytes of every message, without what carried them."""
    supply, record = Supply(), tmp_path / "transcript.tsv"
    with HiSlipServer(supply) as server:
        spec = bench_of(f"TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")
        with record.open("wb", buffering=0) as sink:
            transcript = Transcript(sink)
            bench = bind_live(spec, reach_of_hardware(spec), EPOCH, transcript)
            identity = bench.drivers["psu1"].identify()
            assert set(bench.descriptors) == {"psu1"}
            (port,) = plan_of(bench, tmp_path, ()).ports
            bench.close()
            transcript.flush()
    assert (port.speaks, port.url) == ("hislip", f"hislip://127.0.0.1:{server.port}/hislip0")
    assert (identity.model, identity.serial) == ("E36312A", "MY1")
    assert b"*IDN?\n" in [each.sent for each in read_transcript(record)]
    with closing(bind_replayed(spec, Transcript(None), record, lambda: "", outside=True)) as bench:
        assert bench.drivers["psu1"].identify() == identity
        with pytest.raises(Diverged):
            bench.drivers["psu1"].identify()


def test_a_line_of_a_server_is_guarded_as_it_is_set(tmp_path):
    """The guardian gets all that it needs to reopen it."""
    with SerialServer() as server:
        line = SerialLine(parity="even")
        spec = bench_of(server.url, baud=19200, serial_line=line)
        with closing(bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))) as bench:
            (port,) = plan_of(bench, tmp_path, ()).ports
        assert (port.speaks, port.url, port.baud, port.line) == ("telnet", server.url, 19200, line)
        assert (server.line.baudrate, server.line.parity) == (19200, "E")


def test_what_is_never_opened_is_not_tried_in_another_way():
    """A scheme that goes past every check of who is at a port."""
    spec = bench_of("alt:///dev/null")
    with pytest.raises(Refused, match="is never opened"):
        bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))


def test_by_visa_it_is_transcribed_guarded_and_replayed(tmp_path):
    """The same bytes; the guardian opens it by itself, because the library's session is the run's."""
    record = tmp_path / "transcript.tsv"
    with HiSlipServer(Supply()) as server:
        spec = bench_of(f"visa:TCPIP::127.0.0.1::hislip0,{server.port}::INSTR")
        with record.open("wb", buffering=0) as sink:
            transcript = Transcript(sink)
            bench = bind_live(spec, reach_of_hardware(spec), EPOCH, transcript)
            identity = bench.drivers["psu1"].identify()
            (port,) = plan_of(bench, tmp_path, ()).ports
            bench.where = {"psu1": "visa:USB0::0x2A8D::0x1102::MY1::INSTR"}
            with pytest.raises(Refused, match="cannot make supply.charge safe: it is at visa:USB0.* without 'visa:'"):
                plan_of(bench, tmp_path, ())
            bench.close()
            transcript.flush()
    assert (port.speaks, port.url, port.apart) == ("hislip", f"hislip://127.0.0.1:{server.port}/hislip0", True)
    assert b"*IDN?\n" in [each.sent for each in read_transcript(record)]
    with closing(bind_replayed(spec, Transcript(None), record, lambda: "", outside=True)) as bench:
        assert bench.drivers["psu1"].identify() == identity
