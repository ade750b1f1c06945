"""What a simulated bench costs: an operation on a wire, a reading through its bytes, an hour."""

from __future__ import annotations

from io import FileIO
from types import SimpleNamespace

import pytest
from adcs_bench import adcs

from hil.bench.binding import bind_simulated
from hil.bench.envelope import Monitor
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.scheduler import Scheduler
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
    bus = bench.drivers["mag1"]._connection.bus
    read = cost("I2C transaction (one register)", times(lambda: bus.read_byte_data(0x1C, 0x0F)), units=CALLS)
    assert read == 0x3D


def test_an_operation_on_a_stream(bench, cost):
    """One query and its line over the tapped port, without any driver's session."""
    port = bench.drivers["psu1"]._connection.port

    def ask():
        port.write(b"*IDN?\n")
        return port.read_line()

    assert b"E36312A" in cost("stream transaction (*IDN? and its reply)", times(ask), units=CALLS)


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
    watch = SimpleNamespace(reading=lambda *reading: readings.append(reading), tick=bench.transcript.flush)

    def monitor(limit):
        return Monitor(limit, getattr(bench.roles[limit.output], limit.quantity), 0)

    scheduler = Scheduler(bench, [monitor(limit) for limit in bench.spec.envelope], StopFlags(), watch)
    scheduler.watch_from_now()
    minutes = 2
    cost("simulated hour of an idle bench", lambda: scheduler.sleep(60 * minutes), units=minutes / 60, rounds=3)
    assert len(readings) >= 60 * minutes
