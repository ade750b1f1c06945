"""What a bench file may say of the simulated battery cycler: its truth, and its errors of measurement."""

from __future__ import annotations

import pytest
from cycler_page import CyclerUnderTest

from hil.simulation.truth import TruthError


@pytest.mark.parametrize(
    ("truth", "message"),
    [
        ({"level": "3"}, "'level' must be one of 1, 2"),
        ({"cycles": "0"}, "'cycles' must be at least 1, found \"0\""),
        ({"serial": "c-1"}, 'must be up to eight capital letters and digits, found "c-1"'),
        ({"firmware": "1.0"}, "must be a version such as '1.0.0', found \"1.0\""),
        ({"clock_drift": "0.1"}, "'clock_drift' must be at most 0.01"),
        ({"voltage_nosie": "0"}, "unknown key 'voltage_nosie', did you mean 'voltage_noise'"),
    ],
)
def test_a_truth_that_cannot_be(truth, message):
    """It is told with its key and what would be right."""
    with pytest.raises(TruthError, match=message):
        CyclerUnderTest(truth)


def test_an_article_measures_wrongly():
    """Gain and offset show in every line, in the units of the line."""
    under = CyclerUnderTest({"voltage_gain": "1.01", "current_offset": "-0.02", "temperature_offset": "0.5"})
    under.battery.show(4.0, 0.7, 25.0)
    under.start()
    assert under.wait(5)[0].startswith("4.040;0.680;0.0038;25.5;")


def test_noise_follows_time():
    """Equal instants give equal numbers, whoever asks, and their scatter is what the truth says."""
    first, second = (CyclerUnderTest({"voltage_noise": "0.01"}) for _ in range(2))
    for under in (first, second):
        under.battery.load = 0.7
        under.start(beat="600")
    second.wait(2)
    second.ask(":3 STATE")
    first.clock.sleep(500)
    second.clock.sleep(498)
    assert [data for _, data in first.sent[:20]] == [data for _, data in second.sent[:20]]
    volts = [float(line.split(";")[0]) for line in first.fetch() if line[0].isdigit()]
    assert len(volts) == 100
    mean = sum(volts) / len(volts)
    assert 0.008 < (sum((value - mean) ** 2 for value in volts) / len(volts)) ** 0.5 < 0.012


def test_the_devices_clock_drifts():
    """A fast clock sends its lines early, and tells its own milliseconds."""
    under = CyclerUnderTest({"clock_drift": "0.005"})
    under.battery.load = 0.7
    under.start(beat="600")
    under.fetch()
    under.clock.sleep(100)
    at_ns, data = under.sent[19]
    assert at_ns == pytest.approx(100e9 / 1.005, abs=1e6)
    assert b";100000;C*" in data
