"""What a simulated bench costs: an operation on a wire, a reading through its bytes, an hour."""

from __future__ import annotations

from contextlib import contextmanager
from io import FileIO
from types import SimpleNamespace

import pytest
import pyvisa
from adcs_bench import adcs

from hil.bench.binding import bind_simulated
from hil.bench.bound import url_of
from hil.bench.envelope import Monitor
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.executive.watching.scheduler import Scheduler
from hil.wire.opening import open_bus
from hil.wire.transcript import Transcript

CALLS = 200


@pytest.fixture
def bench(tmp_path):
    """The ADCS bench with its transcript, the magnetometer powered and measuring."""
    spec = adcs()
    with FileIO(tmp_path / "transcript.tsv", "w") as sink:
        bound = bind_simulated(spec, Transcript(sink))
        bound.roles["supply.sensor"].configure(3.3, 0.02)
        bound.roles["supply.sensor"].enable()
        bound.clock.sleep(0.1)
        bound.roles["magnetometer"].start()
        yield bound
        bound.close()


def times(function):
    """Return a function that calls another `CALLS` times, and returns its last result."""

    def many():
        for _ in range(CALLS - 1):
            function()
        return function()

    return many


def test_an_operation_on_a_bus(bench, cost):
    """One register over the tapped bus: two messages, noted in the transcript."""
    name = bench.spec.instrument("mag1").bus
    bus = open_bus("mag1", url_of(bench.source, bench.spec, name), bench.clock, bench.transcript)
    read = cost("I2C transaction (one register)", times(lambda: bus.read_byte_data(0x1C, 0x0F)), units=CALLS)
    assert read == 0x3D


def test_an_operation_on_a_stream(bench, cost):
    """One query and its line over the tapped port, without any driver's session."""
    assert b"E36312A" in cost("stream transaction (*IDN? and its reply)", times(asking(bench)), units=CALLS)


def test_a_simulated_line_beside_pyvisa_sim(bench, tmp_path, pair):
    """The same question and reply by pyvisa-sim, which computes no physics and records nothing."""
    ask = asking(bench)

    def ours():
        times(ask)()
        bench.transcript.flush()

    with canned(tmp_path / "canned.yaml", ask().decode("ascii").rstrip()) as other:
        assert other() == ask()
        pair("*IDN? and its reply, here and by pyvisa-sim", ours, times(other), units=CALLS)


def asking(bench):
    """Return a function that asks the supply for its identification."""
    port = bench.drivers["psu1"]._connection.port

    def ask():
        port.write(b"*IDN?\n")
        return port.read_line()

    return ask


@contextmanager
def canned(path, reply):
    """Give a function that asks pyvisa-sim, which answers with this text, on the level of bytes."""
    ends = '{ASRL INSTR: {q: "\\n", r: "\\n"}, TCPIP INSTR: {q: "\\n", r: "\\n"}}'
    path.write_text(
        f'spec: "1.0"\ndevices:\n  psu: {{eom: {ends}, dialogues: [{{q: "*IDN?", r: "{reply}"}}]}}\n'
        "resources:\n  TCPIP::localhost::inst0::INSTR: {device: psu}\n",
        encoding="ascii",
    )
    manager = pyvisa.ResourceManager(f"{path}@sim")
    with manager.open_resource("TCPIP::localhost::inst0::INSTR") as supply:

        def ask():
            supply.write_raw(b"*IDN?\n")
            return supply.read_raw()

        yield ask
    manager.close()


def test_a_sample_over_i2c(bench, cost):
    """Four channels of the magnetometer, the wait for a fresh conversion included."""
    magnetometer = bench.roles["magnetometer"]
    assert len(cost("recorded sample over I2C (field and temperature)", times(magnetometer.sample), units=CALLS)) == 4


def test_a_reading_over_scpi(bench, cost):
    """One measured current of the supply."""
    supply = bench.roles["supply.coil"]
    assert cost("reading over SCPI (one current)", times(supply.current), units=CALLS).unit == "A"


def test_a_reading_over_modbus(bench, cost):
    """The contacts of the relay board."""
    assert cost("reading over Modbus (eight coils)", times(bench.roles["relays"].closed), units=CALLS) == ()


def test_an_hour_of_an_idle_bench(bench, cost):
    """A bench that is only watched: plants on their grid, two monitors through the bytes."""
    readings = []
    watch = SimpleNamespace(
        reading=lambda *reading: readings.append(reading),
        tick=bench.transcript.flush,
        hold_as_recorded=lambda: None,
    )

    def monitor(limit):
        return Monitor(limit, getattr(bench.roles[limit.output], limit.quantity), 0)

    monitors = [monitor(limit) for limit in bench.spec.envelope]
    scheduler = Scheduler(
        bench, monitors, StopFlags(), watch, timeline_of(bench, NoMachine(), SimpleNamespace(course=0))
    )
    scheduler.watch_from_now()
    minutes = 2
    cost("simulated hour of an idle bench", lambda: scheduler.sleep(60 * minutes), units=minutes / 60, rounds=3)
    assert len(readings) >= 60 * minutes
