"""The TMP117: its peer against the data sheet, and its driver against its peer, over both buses."""

from __future__ import annotations

import json
import math

import pytest
from sensor_bench import CHIPS, Bench, SensorChip

from hil.instruments.registry import DRIVERS
from hil.model.bench import Wire
from hil.model.errors import NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.simulation.registry import PEERS
from hil.simulation.truth import TruthError
from hil.wire.peer import Nack

MS = 1_000_000
COUNTS = [
    (25.0, "0C80"),
    (1.0, "0080"),
    (0.125, "0010"),
    (0.0, "0000"),
    (-0.125, "FFF0"),
    (-25.0, "F380"),
    (100.0, "3200"),
]
"""Temperatures and what stands in the register, table 7-1 of the data sheet."""


class Feeling:
    """What the sensor feels."""

    def __init__(self, celsius):
        self.celsius = celsius

    def observe_at(self, at_ns):
        """Return it."""
        return self.celsius


def bench(celsius=25.0, noise="0", settings=None, faults=(), truth=None, *, board=False):
    """Return a sensor that feels a temperature."""
    chip = SensorChip(
        driver=DRIVERS["tmp117"], model=PEERS["tmp117"], role="thermometer", unit="degC", named="TMP117", address=0x48,
        strapped=0x49, power_on=(0x01, b"\x02\x20"), ranges=(), rates=(), narrow=0.0, truth={}, expected=(), close=0.0,
        sleep=(0x01, 0x04),
    )  # fmt: skip
    made = Bench(chip, truth={"noise": noise, **(truth or {})}, settings=settings, faults=faults, board=board)
    made.peer._peer._temperature = Feeling(celsius)
    return made


def put(made, register, value):
    """Write a register as the data sheet shows it: address, pointer, high byte, low byte."""
    made.bus.write_i2c_block_data(0x48, register, list(value.to_bytes(2, "big")))


def test_registers_after_power_on():
    """Table 7-3: result, configuration, limits and identity."""
    made = bench()
    assert [made.read(register, 2).hex() for register in (0x00, 0x01, 0x02, 0x03, 0x0F)] == [
        "8000", "0220", "6000", "8000", "0117",
    ]  # fmt: skip


@pytest.mark.parametrize(("celsius", "code"), COUNTS)
def test_a_temperature_is_a_number_of_sixteen_bits(celsius, code):
    """As the data sheet's table has it, after the first cycle of 1 s."""
    made = bench(celsius)
    made.clock.sleep(0.9)
    assert made.read(0x00, 2).hex() == "8000"
    made.clock.sleep(0.2)
    assert made.read(0x00, 2).hex().upper() == code


@pytest.mark.parametrize(
    ("config", "cycle"),
    [(0x0000, 0.0155), (0x0020, 0.125), (0x0040, 0.5), (0x0060, 1.0), (0x0080, 0.125), (0x0220, 1.0), (0x0160, 1.0)],
)
def test_cycles_are_those_of_the_table(config, cycle):
    """Table 7-7: the flag comes after a cycle, and reading takes it away."""
    made = bench()
    put(made, 0x01, config)
    made.clock.sleep(cycle - 0.002)
    assert made.read(0x01, 2)[0] & 0x20 == 0
    made.clock.sleep(0.004)
    assert made.read(0x01, 2)[0] & 0x20
    assert made.read(0x01, 2)[0] & 0x20 == 0
    made.clock.sleep(cycle)
    assert made.read(0x00, 2) == b"\x0c\x80"
    assert made.read(0x01, 2)[0] & 0x20 == 0


def test_shutdown_and_soft_reset():
    """Nothing is converted in shutdown; a soft reset takes 2 ms, without an acknowledge."""
    made = bench()
    put(made, 0x01, 0x0420)
    made.clock.sleep(5)
    assert made.read(0x00, 2).hex() == "8000"
    put(made, 0x01, 0x0002)
    with pytest.raises((Nack, OSError)):
        made.read(0x01, 2)
    made.clock.sleep(0.003)
    assert made.read(0x01, 2).hex() == "0220"


def test_what_can_only_be_read_keeps_its_value():
    """Identity and result; a transfer stays at its register."""
    made = bench()
    put(made, 0x0F, 0xFFFF)
    put(made, 0x02, 0x1234)
    assert made.read(0x0F, 4).hex() == "01170117"
    assert made.read(0x02, 2).hex() == "1234"


@pytest.mark.parametrize("board", [False, True], ids=["host", "obc"])
@pytest.mark.parametrize("averages", ["1", "8", "32", "64"])
def test_the_driver_reads_what_the_sensor_feels(averages, board):
    """Each sample is a new one, at the cycle of the averaging, on the host's bus and on one that a board serves."""
    made = bench(-12.5, noise="0.01", settings={"averages": averages}, board=board)
    made.sensor.start()
    before = made.clock.now()
    figures = [made.sensor.temperature() for _ in range(8)]
    cycle = {"1": 0.0155, "8": 0.125, "32": 0.5, "64": 1.0}[averages]
    assert made.clock.now() - before == pytest.approx(8 * cycle, rel=0.3)
    assert all(figure.value == pytest.approx(-12.5, abs=0.06) and figure.unit == "degC" for figure in figures)
    assert str(made.driver.identify()) == str(Identity(model="TMP117"))
    assert [channel.unit for channel in made.sensor.channels()] == ["degC"]


def test_stop_and_start_again():
    """A sensor that sleeps has no samples; the driver says so before it asks."""
    made = bench()
    made.sensor.start()
    made.sensor.stop()
    assert made.read(0x01, 2)[0] & 0x0C == 0x04
    with pytest.raises(Refused, match="has not been started"):
        made.sensor.sample()
    made.sensor.start()
    assert made.sensor.sample() == (25.0,)


@pytest.mark.parametrize(
    ("faults", "error", "message"),
    [
        ([{"kind": "identity", "value": "0x0116"}], WrongIdentity, "DEVICE_ID is 0x116, the TMP117 has 0x117"),
        ([{"kind": "dead"}], NoReply, "no acknowledge at address 0x48"),
    ],
)
def test_what_is_wrong_at_the_start(faults, error, message):
    """Whoever answers instead, or nobody, or a line that is held."""
    with pytest.raises(error, match=message):
        bench(faults=faults).sensor.start()


@pytest.mark.parametrize("times", [1, 2], ids=["shutdown", "conversion"])
def test_a_configuration_that_reads_back_otherwise_is_refused(times):
    """Somebody else at the bus has set another averaging in between; nothing is measured with it."""
    made = bench(settings={"averages": "8"})
    write, sent = made.bus.write_i2c_block_data, []

    def disturbed(address, register, data):
        write(address, register, data)
        sent.append(data)
        if len(sent) == times:
            write(address, register, [0x00, 0x60])

    made.bus.write_i2c_block_data = disturbed
    with pytest.raises(Rejected, match=r"CONFIGURATION was set to 0x0\w+ and reads back 0x0060"):
        made.sensor.start()
    assert len(sent) == times


def test_beyond_its_range_there_is_no_number():
    """The chip measures from -55 to 150 degC."""
    hot = bench(160.0)
    hot.sensor.start()
    assert math.isnan(hot.sensor.sample()[0])


def test_a_busy_memory_is_a_flag_that_the_driver_passes_over():
    """The peer's own kind of fault shows in the configuration alone."""
    made = bench(faults=[{"kind": "eeprom-busy"}])
    assert made.read(0x01, 2).hex() == "1220"
    made.sensor.start()
    assert made.sensor.sample() == (25.0,)


def test_a_power_cut_is_no_reply_and_then_no_sample():
    """Power brings the settings of power-on, and the wrong averaging; another start heals it."""
    made = bench()
    made.sensor.start()
    made.supply.command(volts=0.0)
    with pytest.raises(NoReply, match="no acknowledge"):
        made.sensor.sample()
    made.supply.command(volts=3.3)
    made.clock.sleep(0.01)
    with pytest.raises(NoReply, match="no new sample"):
        made.sensor.sample()
    made.sensor.start()
    assert made.sensor.sample() == (25.0,)


def test_the_peer_goes_on_from_its_state():
    """Two equal benches, one of which was restored, read the same."""
    one, other = (bench(noise="0.05") for _ in range(2))
    one.clock.sleep(0.7)  # so that its conversions do not end when those of a sensor that was never set would
    one.sensor.start()
    one.clock.sleep(0.3)
    other.clock.wait_until(one.clock.now_ns())
    other.peer.restore(json.loads(json.dumps(one.peer.state())))
    for made in (one, other):
        made.clock.sleep(0.5)
    assert one.read(0x00, 2) == other.read(0x00, 2)
    assert one.peer.state() == other.peer.state()


def test_what_a_wire_and_a_truth_cannot_say():
    """Settings, addresses and noise that do not exist."""
    with pytest.raises(Refused, match="'averages' must be one of 1, 8, 32, 64"):
        bench(settings={"averages": "4"})
    with pytest.raises(Refused, match="unknown key 'average', did you mean 'averages'"):
        bench(settings={"average": "8"})
    with pytest.raises(TruthError, match="must be at least 0"):
        bench(noise="-1")


@pytest.mark.parametrize("chip", CHIPS, ids=lambda chip: f"{chip.named} {chip.role}")
def test_the_temperature_of_another_chip_is_a_thermometer(chip):
    """It is the chip's own number, and the thermometer does not start over what runs."""
    made = Bench(chip, truth=chip.truth)
    thermometer = made.driver.role(Wire(role="thermometer", instrument="device"))
    with pytest.raises(Refused, match="has not been started"):
        thermometer.temperature()
    thermometer.start()
    before = made.clock.now()
    thermometer.start()
    assert made.clock.now() == before
    assert made.sensor.sample()[3] == pytest.approx(thermometer.sample()[0], abs=0.01)
    assert thermometer.temperature().value == pytest.approx(chip.expected[3], abs=0.01)
    assert made.sensor.temperature().unit == "degC"
    thermometer.stop()
    with pytest.raises(Refused, match="has not been started"):
        made.sensor.sample()
    if chip.driver.sensor.chip.role == chip.role:
        own = {"range": chip.ranges[0]} if chip.ranges else {"rate": chip.rates[0]}
        with pytest.raises(Refused, match=f"the settings of this chip are those of its role {chip.role}"):
            made.driver.role(Wire(role="thermometer", instrument="device", settings=own))
