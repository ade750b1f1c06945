"""What every sensor on I2C must do, chip by chip: its driver against its peer, over the simulated bus."""

from __future__ import annotations

import json
import math

import pytest
import sweeps
from sensor_bench import CHIPS, Bench

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.sampled import Channel
from hil.instruments.sensors.axes import Axes
from hil.model.bench import Wire
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.simulation.truth import TruthError
from hil.wire.peer import Nack

SECOND = 1_000_000_000
EVERY = pytest.mark.parametrize("chip", CHIPS, ids=lambda chip: f"{chip.named} {chip.role}")
RANGES = [pytest.param(chip, name, id=f"{chip.named} {chip.role} {name}") for chip in CHIPS for name in chip.ranges]
RATES = [pytest.param(chip, name, id=f"{chip.named} {chip.role} {name}") for chip in CHIPS for name in chip.rates]
FULL = {"kind": "saturated", "from": "1 s", "until": "2 s"}


def right(chip, sample):
    """Check a sample against what the truth of the chip says."""
    assert sample[:3] == pytest.approx(chip.expected[:3], abs=chip.close)
    assert sample[3] == pytest.approx(chip.expected[3], abs=0.01)


@pytest.mark.parametrize(("chip", "name"), RANGES)
def test_the_truth_arrives_at_every_range(chip, name):
    """Axes and temperature of the article arrive in their units."""
    bench = Bench(chip, truth=chip.truth, settings={"range": name})
    bench.sensor.start()
    for _ in range(3):
        bench.clock.sleep(0.05)
        right(chip, bench.sensor.sample())


@pytest.mark.parametrize(("chip", "name"), RATES)
def test_the_truth_arrives_at_every_rate(chip, name):
    """Once it was started, every sample is valid."""
    bench = Bench(chip, truth=chip.truth, settings={"rate": name})
    bench.sensor.start()
    right(chip, bench.sensor.sample())


@EVERY
def test_channels_have_units(chip):
    """Three axes, and the die's temperature."""
    expected = (*(Channel(axis, chip.unit) for axis in "xyz"), Channel("temperature", "degC"))
    assert Bench(chip).sensor.channels() == expected


@EVERY
def test_it_is_identified_by_its_type(chip):
    """Nothing names the article, and there is nothing to switch."""
    bench = Bench(chip)
    assert bench.driver.identify() == Identity(model=chip.named)
    assert bench.driver.outlets() == ()


@EVERY
def test_another_device_at_the_address(chip):
    """It is named in the identity, start refuses it, and nothing is written to it."""
    bench = Bench(chip, faults=[{"kind": "identity", "value": "0x47"}])
    assert bench.driver.identify().model.endswith(" 0x47")
    with pytest.raises(WrongIdentity, match=rf"is 0x47, the {chip.named} has .* strap"):
        bench.sensor.start()
    assert bench.read(chip.power_on[0], len(chip.power_on[1])) == chip.power_on[1]


@EVERY
def test_beyond_the_range_there_is_no_number(chip):
    """Neither check nor recording takes it for one, however long it lasts; the temperature goes on."""
    bench = Bench(chip, truth=chip.truth, faults=[FULL])
    bench.sensor.start()
    bench.clock.wait_until(SECOND + SECOND // 10)
    for _ in range(40):
        *axes, temperature = bench.sensor.sample()
        assert all(math.isnan(axis) for axis in axes)
        assert temperature == pytest.approx(chip.expected[3], abs=0.01)
        bench.clock.sleep(0.01)
    bench.clock.wait_until(2 * SECOND + SECOND // 10)
    right(chip, bench.sensor.sample())


@EVERY
def test_a_stuck_sensor_is_no_reply(chip):
    """It answers, and its numbers stand still; samples before do not count."""
    bench = Bench(chip, faults=[{"kind": "stuck", "from": "1 s"}])
    bench.sensor.start()
    for _ in range(40):
        bench.sensor.sample()
    bench.clock.wait_until(SECOND)
    with pytest.raises(NoReply, match="sensor: 16 consecutive samples are equal"):
        for _ in range(100):
            bench.sensor.sample()
            bench.clock.sleep(0.0125)


@EVERY
def test_a_sensor_that_fell_asleep_gives_no_number(chip):
    """Its registers stay readable; there is no sample that could pass. One that cannot be woken does not start."""
    bench = Bench(chip, faults=[{"kind": "asleep", "from": "2 s"}])
    bench.sensor.start()
    bench.clock.wait_until(2 * SECOND)
    of_sample, of_start = chip.nap
    if of_sample:
        with pytest.raises(NoReply, match=f"sensor: .*{of_sample}"):
            for _ in range(20):
                bench.sensor.sample()
                bench.clock.sleep(0.01)
    else:
        for _ in range(30):
            bench.clock.sleep(0.01)
            assert all(math.isnan(axis) for axis in bench.sensor.sample()[:3])
    with pytest.raises((NoReply, Rejected), match=f"sensor: .*{of_start}"):
        bench.sensor.start()


@EVERY
def test_a_temperature_in_counts_is_no_number(chip):
    """It is beyond what the chip is made for; the axes go on. A start does not wait for it for ever."""
    bench = Bench(chip, truth=chip.truth, faults=[{"kind": "temperature-raw", "from": "1 s"}])
    bench.sensor.start()
    assert bench.sensor.temperature().value == pytest.approx(chip.expected[3], abs=0.01)
    bench.clock.wait_until(2 * SECOND)
    sample = bench.sensor.sample()
    assert sample[:3] == pytest.approx(chip.expected[:3], abs=chip.close)
    assert math.isnan(sample[3])
    if isinstance(bench.sensor, Axes):
        with pytest.raises(NoReply, match="temperature is marked invalid"):
            bench.sensor.temperature()
    if chip.warm_first:
        with pytest.raises(NoReply, match="no valid data .*switched on|no valid data .*was set"):
            bench.sensor.start()


@EVERY
def test_a_dead_sensor_is_no_reply_at_once(chip):
    """A missing acknowledge needs no waiting."""
    bench = Bench(chip, faults=[{"kind": "dead", "from": "1 s"}])
    bench.sensor.start()
    bench.clock.wait_until(SECOND)
    with pytest.raises(NoReply, match=f"no acknowledge at address {chip.die or chip.address:#04x}: Remote I/O error;"):
        bench.sensor.sample()
    assert bench.clock.now() == pytest.approx(1.0, abs=0.001)


@EVERY
def test_stop_and_start_again(chip):
    """Asleep there is no sample; awake there is a new one."""
    bench = Bench(chip, truth=chip.truth)
    with pytest.raises(Refused, match="has not been started"):
        bench.sensor.sample()
    bench.sensor.start()
    bench.sensor.stop()
    register, asleep = chip.sleep
    assert bench.read(register) == bytes([asleep])
    with pytest.raises(Refused, match="has not been started"):
        bench.sensor.sample()
    bench.sensor.start()
    right(chip, bench.sensor.sample())


@EVERY
def test_a_garbled_bus_does_not_start(chip):
    """Flipped bits in the name or in the settings are found out."""
    bench = Bench(chip, faults=[{"kind": "garbled"}])
    with pytest.raises((WrongIdentity, Rejected, Garbled, NoReply)):
        bench.sensor.start()


@EVERY
def test_a_bus_that_becomes_garbled_is_found_out(chip):
    """Samples may look like any others; what the chip calls itself does not. BNO055 and AK09916 tell it sooner."""
    bench = Bench(chip, truth=chip.truth | chip.noisy, faults=[{"kind": "garbled", "from": "2 s"}])
    bench.sensor.start()
    with pytest.raises((Garbled, NoReply, Rejected)) as caught:
        while bench.clock.now() < 8.0:
            bench.sensor.sample()
            bench.clock.sleep(0.1)
    assert caught.value.device == "sensor"
    assert bench.clock.now() < 4.6


@EVERY
def test_a_start_while_settings_are_garbled_is_refused_or_right(chip):
    """Whenever the disturbance begins, a start that succeeds has set what it should."""
    started = 0
    for step in sweeps.sample(range(1, 60), 8):
        boot_us = round(chip.boot * 1e6)
        wrong = [{"kind": "garbled", "from": f"{boot_us + step * 50} us", "until": f"{boot_us + 4000} us"}]
        bench = Bench(chip, truth=chip.truth, faults=wrong)
        try:
            bench.sensor.start()
        except DeviceFault:
            continue
        started += 1
        bench.clock.wait_until(SECOND)
        right(chip, bench.sensor.sample())
    assert started


@EVERY
def test_without_power_there_is_nobody(chip):
    """A start says so; after a power cut the sensor has to be started, and its registers are those of power-on."""
    bench = Bench(chip, truth=chip.truth)
    register, values = chip.power_on
    assert bench.read(register, len(values)) == values
    bench.sensor.start()
    bench.supply.command(volts=0.0)
    with pytest.raises(NoReply):
        bench.sensor.start()
    with pytest.raises(OSError, match="Remote I/O error"):
        bench.read(register)
    bench.supply.command(volts=3.3)
    with pytest.raises(Nack):
        bench.peer.read(chip.address, 1)
    bench.clock.sleep(chip.boot + 0.01)
    assert bench.read(register, len(values)) == values
    bench.sensor.start()
    right(chip, bench.sensor.sample())


@EVERY
def test_samples_do_not_depend_on_who_reads_before(chip):
    """Two sensors with the same commands give the same sample, read thirty times before or never."""
    often, once = Bench(chip, truth=chip.noisy), Bench(chip, truth=chip.noisy)
    for bench in (often, once):
        bench.sensor.start()
        bench.clock.wait_until(SECOND)
    for _ in range(30):
        often.sensor.sample()
        often.clock.sleep(0.004)
    for bench in (often, once):
        bench.clock.wait_until(5 * SECOND)
    assert often.sensor.sample() == once.sensor.sample()


@EVERY
def test_a_sampling_that_restarts_has_other_noise(chip):
    """Or the difference of two recordings would cancel it."""
    bench = Bench(chip, truth=chip.noisy)
    rows = []
    for _ in range(2):
        bench.sensor.start()
        rows.append([bench.sensor.sample()[:3] for _ in range(5)])
    assert rows[0] != rows[1]


@EVERY
def test_a_restored_peer_goes_on(chip):
    """Its state is JSON, and the other one gives the same samples."""
    first, second = Bench(chip, truth=chip.noisy), Bench(chip, truth=chip.noisy)
    for bench in (first, second):
        bench.sensor.start()
    first.clock.wait_until(2 * SECOND)
    state = json.loads(json.dumps(first.peer.state()))
    second.sensor.stop()  # it wakes with the state alone
    second.clock.wait_until(2 * SECOND)
    second.peer.restore(state)
    assert json.loads(json.dumps(second.peer.state())) == state
    for bench in (first, second):
        bench.clock.sleep(0.5)
    assert first.sensor.sample() == second.sensor._sample()


@EVERY
def test_an_address_that_cannot_be_strapped(chip):
    """The peer has two, and says which."""
    known = f"the {chip.named} answers at 0x{chip.address:02X} or 0x{chip.strapped:02X}, not at 0x10"

    class Elsewhere(Bench):
        """A bench whose sensor has another address."""

        def build(self, name, model, truth, faults):
            self.chip = type("Other", (), {"address": 0x10})
            return super().build(name, model, truth, faults)

    with pytest.raises(TruthError, match=known):
        Elsewhere(chip)
    with pytest.raises(TruthError, match="must be a hexadecimal number such as 0x3C, found .nobody"):
        Bench(chip, faults=[{"kind": "identity", "value": "nobody"}])


@EVERY
def test_wires_that_it_cannot_serve_are_refused(chip):
    """Another role, a channel, a setting that it does not know, a value that does not exist."""
    driver = Bench(chip).driver
    for sentence, changes in (
        (f"does not fill the role supply.*it fills the role .*{chip.role}", {"role": "supply"}),
        ("has no channels", {"channel": 1}),
        ("unknown key 'odr'", {"settings": {"odr": "80"}}),
        ("'range' must be a number in .*, found \"wide\"", {"settings": {"range": "wide"}}),
        ("'range' must be one of .*, found", {"settings": {"range": "77"}}),
        ("'rate' must be one of .* Hz, found", {"settings": {"rate": "77 Hz"}}),
    ):
        if ("'range'" in sentence and not chip.ranges) or ("'rate'" in sentence and not chip.rates):
            continue
        with pytest.raises(Refused, match=sentence):
            driver.role(Wire(**{"role": chip.role, "instance": "", "instrument": "sensor"} | changes))


@EVERY
def test_it_needs_a_bus(chip):
    """A port leads nowhere."""
    with pytest.raises(Refused, match="needs an I2C bus"):
        chip.driver(Connection(device="sensor", clock=VirtualClock(), clamps=Clamps()))
