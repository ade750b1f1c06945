"""The BME680: its peer against the data sheet, and its driver against its peer, over both buses."""

from __future__ import annotations

import json
import math

import pytest
from behind_obc import BehindObc
from sensor_bench import BME680, Bench

from hil.instruments.bme680 import Coefficients
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.simulation.truth import TruthError

PUBLISHED = (26203, 26519, 3)
OTHER = (25790, 26312, -7)


def made(celsius="25", noise="0", *, path=Bench, **more):
    """Return a sensor at a temperature."""
    return path(BME680, truth={"temperature": celsius, "noise": noise, **more.pop("truth", {})}, **more)


def measured(bench, mode=0xA1):
    """Let it measure once, and return its 20 bits."""
    bench.bus.write_byte_data(0x76, 0x74, mode)
    bench.clock.sleep(0.04)
    return int.from_bytes(bench.read(0x22, 3), "big") >> 4


def by_the_whole_numbers_of_the_data_sheet(counts, t1, t2, t3):
    """Return hundredths of a degC by the data sheet's other formula, which has neither driver nor peer."""
    first = (counts >> 3) - (t1 << 1)
    second = (first * t2) >> 11
    third = ((((first >> 1) * (first >> 1)) >> 12) * (t3 << 4)) >> 14
    return ((second + third) * 5 + 128) >> 8


def test_registers_after_power_on():
    """Identity, the article's coefficients, asleep, and no temperature yet."""
    bench = made()
    assert bench.read(0xD0) == b"\x61"
    assert (bench.read(0xE9, 2), bench.read(0x8A, 3)) == ((26203).to_bytes(2, "little"), b"\x97\x67\x03")
    assert bench.read(0x74) + bench.read(0x1D) + bench.read(0x22, 3) == b"\x00\x00\x80\x00\x00"


@pytest.mark.parametrize("article", [PUBLISHED, OTHER], ids=["published", "other"])
@pytest.mark.parametrize("celsius", ["-40", "-5.25", "0", "22.75", "85"])
def test_counts_are_those_of_the_article(celsius, article):
    """Both formulas of the data sheet make the temperature of them, with that article's coefficients only."""
    counts = measured(made(celsius, truth={"coefficients": [str(each) for each in article]}))
    assert by_the_whole_numbers_of_the_data_sheet(counts, *article) == pytest.approx(100 * float(celsius), abs=1)
    assert Coefficients(*article).celsius(counts) == pytest.approx(float(celsius), abs=0.001)
    wrong = OTHER if article == PUBLISHED else PUBLISHED
    assert abs(Coefficients(*wrong).celsius(counts) - float(celsius)) > 1.0


@pytest.mark.parametrize(("code", "cycle", "bits"), [(1, 0.00676, 16), (2, 0.00873, 17), (5, 0.0362, 20)])
def test_a_measurement_takes_its_time_and_ends_asleep(code, cycle, bits):
    """The flags tell it; without a filter the lowest bits are 0; a mode without conversions measures nothing."""
    bench = made("22.75")
    bench.bus.write_byte_data(0x76, 0x74, code << 5 | 1)
    bench.clock.sleep(cycle - 0.002)
    assert bench.read(0x1D) == b"\x20"
    bench.clock.sleep(0.002)
    assert (bench.read(0x1D), bench.read(0x74)) == (b"\x80", bytes([code << 5]))
    assert (int.from_bytes(bench.read(0x22, 3), "big") >> 4) % 2 ** (20 - bits) == 0
    assert bench.read(0x1D) == b"\x00"
    assert measured(bench, 0x01) == 0x80000


def test_the_filter_follows_slowly():
    """A coefficient of 3 takes a quarter of each new sample."""
    bench = made("20")
    bench.bus.write_byte_data(0x76, 0x75, 2 << 2)
    before = measured(bench)
    bench.peer._peer._die._truth = 40.0
    after = [Coefficients(*PUBLISHED).celsius(measured(bench)) for _ in range(2)]
    assert Coefficients(*PUBLISHED).celsius(before) == pytest.approx(20.0, abs=0.01)
    assert after == pytest.approx([25.0, 28.75], abs=0.05)


@pytest.mark.parametrize("path", [Bench, BehindObc], ids=["host", "obc"])
@pytest.mark.parametrize("averages", ["1", "16"])
def test_the_driver_reads_what_the_sensor_feels(averages, path):
    """Whatever article it is, and on both buses; nothing is asked of its heater."""
    truth = {"coefficients": [str(each) for each in OTHER], "temperature_offset": "0.5"}
    bench = made("-12.5", "0.01", path=path, truth=truth, settings={"averages": averages})
    bench.sensor.start()
    figures = [bench.sensor.temperature() for _ in range(5)]
    assert all(figure.value == pytest.approx(-12.0, abs=0.05) and figure.unit == "degC" for figure in figures)
    assert bench.read(0x70, 2) == b"\x08\x00"
    assert bench.driver.identify() == Identity(model="BME680")
    bench.sensor.stop()
    assert bench.read(0x74) == b"\x00"


@pytest.mark.parametrize(
    ("fault", "error", "message"),
    [
        ({"kind": "identity", "value": "0x60"}, WrongIdentity, "chip_id is 0x60, the BME680 has 0x61"),
        ({"kind": "dead"}, NoReply, "no acknowledge at address 0x76"),
        ({"kind": "asleep"}, NoReply, "no new sample within 0.123 s"),
        ({"kind": "stuck", "from": "1 s"}, NoReply, "16 consecutive samples are equal"),
        ({"kind": "garbled"}, (Garbled, Rejected, WrongIdentity, NoReply), "sensor: "),
    ],
    ids=lambda value: value.get("kind") if isinstance(value, dict) else None,
)
def test_what_is_wrong_is_found(fault, error, message):
    """At the start, or by the samples after it."""
    bench = made(noise="0.02", faults=[fault])
    with pytest.raises(error, match=message):
        bench.sensor.start()
        bench.clock.wait_until(1_000_000_000)
        for _ in range(20):
            bench.sensor.sample()


def test_what_cannot_be_is_no_number_or_refused():
    """Raw counts, coefficients of an empty memory, settings and truths that do not exist."""
    raw = made(faults=[{"kind": "temperature-raw", "from": "1 s"}])
    raw.sensor.start()
    raw.clock.wait_until(1_000_000_000)
    assert math.isnan(raw.sensor.sample()[0])
    with pytest.raises(Garbled, match="its factory coefficients cannot be: 00 00"):
        made(truth={"coefficients": ["0", "26519", "3"]}).sensor.start()
    with pytest.raises(Refused, match="'averages' must be one of 1, 2, 4, 8, 16"):
        raw.driver.role(Wire(role="thermometer", instrument="", settings={"averages": "3"}))
    with pytest.raises(TruthError, match="must have 16, 16 and 8 bits"):
        made(truth={"coefficients": ["70000", "1", "3"]})


def test_the_peer_goes_on_from_its_state():
    """In the middle of a measurement, with its filter on."""
    one, other = (made(noise="0.05", settings={"filter": "7"}) for _ in range(2))
    one.sensor.start()
    one.bus.write_byte_data(0x76, 0x74, 0xA1)
    other.clock.wait_until(one.clock.now_ns())
    other.peer.restore(json.loads(json.dumps(one.peer.state())))
    for bench in (one, other):
        bench.clock.sleep(0.1)
    assert one.peer.state() == other.peer.state()
