"""What trips the gates of a recording, and what does not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hil.analysis.changes import interleaved, jumps, steady, wrapped
from hil.analysis.extremes import resolved, rounding, saturated, spikes
from hil.analysis.gates import Facts, copies, repeated, stuck
from hil.analysis.quality import aliased, density, density_agrees, judge, tripped
from hil.model.errors import Refused

LSB = 1.0 / 131.0
FACTS = Facts(rate=100.0, lsb=LSB, full_scale=250.0, bandwidth=25.0, noise_density=0.0038, temperature="temperature")


def recording(seed=1, count=20_000, rate=100.0, level=0.0038):
    """A gyroscope at rest: counts of white noise with a density, and a temperature that drifts a little."""
    generator = np.random.default_rng(seed)
    time = np.arange(count) / rate
    noise = 0.05 + level * math.sqrt(rate) * generator.standard_normal((3, count))
    channels = {axis: np.rint(values / LSB) * LSB for axis, values in zip("xyz", noise, strict=True)}
    channels["temperature"] = np.rint((25.0 + 0.001 * time) * 132.48) / 132.48
    return time, channels


def names(time, channels, facts=FACTS):
    """Names and channels of the gates that trip."""
    return [(gate.name, gate.channel) for gate in tripped(time, channels, facts)]


def test_a_good_recording_passes_every_gate():
    """Nothing trips, and with all facts given nothing is left unjudged."""
    gates = judge(*recording(), FACTS)
    assert [gate for gate in gates if gate.ok is not True] == []
    assert len(gates) == 7 + 3 * 10 + 2
    assert all(gate.reason for gate in gates)


def test_without_facts_nothing_trips_and_the_reason_says_what_is_missing():
    """Gates that lack a fact are neither good nor bad."""
    gates = judge(*recording(), Facts(temperature="temperature"))
    unjudged = {gate.name: gate.reason for gate in gates if gate.ok is None}
    assert sorted(unjudged) == ["aliased", "density", "rate", "saturated"]
    assert "not known" in unjudged["saturated"]


@pytest.mark.parametrize("rounding", [0.0, 1e-15])
def test_a_stuck_channel_trips(rounding):
    """The same value all along, also with the rounding noise of a conversion."""
    time, channels = recording()
    channels["x"] = 17.937 * (1.0 + rounding * np.arange(time.size) % 3)
    assert ("stuck", "x") in names(time, channels)


def test_a_channel_that_stops_trips():
    """From sample 15,000 on the channel repeats its last value; the place is told."""
    time, channels = recording()
    channels["y"][15_000:] = channels["y"][14_999] + LSB
    found = {gate.name: gate.reason for gate in tripped(time, channels, FACTS) if gate.channel == "y"}
    assert "5000 equal samples follow each other from number 15001 on" in found["stuck"]


def test_coarse_readings_are_not_called_stuck():
    """Noise of 0.6 counts repeats often by chance; that is resolution, not a stuck channel."""
    time, channels = recording(level=0.6 * LSB / 10.0)
    assert not [name for name, _ in names(time, channels) if name in {"stuck", "repeated"}]


@pytest.mark.parametrize("axes", ["xyz", "x"])
def test_samples_read_twice_trip(axes):
    """A sensor that is read at twice its own rate repeats every other row, seen with three channels or one."""
    time, channels = recording()
    twice = {axis: np.repeat(channels[axis][::2], 2) for axis in axes}
    assert ("repeated", "") in names(time, twice)


def test_values_at_full_scale_trip():
    """One clipped sample is enough."""
    time, channels = recording()
    channels["z"][7] = -250.0
    assert ("saturated", "z") in names(time, channels)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_values_that_are_not_finite_trip(bad):
    """The first one is named; the other channels stay good."""
    time, channels = recording()
    channels["x"][99] = bad
    (gate,) = tripped(time, channels, FACTS)
    assert (gate.name, gate.channel) == ("finite", "x")
    assert "the first is number 100" in gate.reason


def test_gaps_order_jitter_and_rate_trip():
    """A hole of two seconds, a repeated timestamp, intervals that alternate by a fifth, and half of the rate."""
    time, channels = recording()
    late = time + 2.0 * (time > 50.0)
    assert names(late, channels) == [("gaps", "")]
    double = time.copy()
    double[500] = double[499]
    assert ("order", "") in names(double, channels)
    shaken = time + 0.001 * (np.arange(time.size) % 2)
    assert names(shaken, channels) == [("jitter", "")]
    assert ("rate", "") in names(2.0 * time, channels)
    assert names(0.0 * time, channels)[0] == ("order", "")


def test_noise_below_the_resolution_trips():
    """Noise of 0.2 counts around a value between two counts."""
    time, channels = recording(level=0.2 * LSB / 10.0)
    assert ("resolved", "x") in names(time, channels)


def test_bandwidth_beyond_half_of_the_rate_trips():
    """532 Hz read once a second: white noise reads 33 times too large."""
    time, channels = recording(rate=1.0)
    found = tripped(time, channels, Facts(bandwidth=532.0, temperature="temperature"))
    assert [gate.name for gate in found] == ["aliased"]
    assert "33 times too large" in found[0].reason


@pytest.mark.parametrize(
    ("factor", "why"),
    [
        (180.0 / math.pi, "near 57.3, as when degrees and radians are mixed up"),
        (math.pi / 180.0, "near 1/57.3, as when degrees and radians"),
        (9.81, "near 9.807, as when g and m/s"),
        (1000.0, "near 1000, as when milli"),
        (20.0, "20 times that of the data sheet"),
        (0.3, "0.3 times that of the data sheet"),
    ],
)
def test_a_density_far_from_the_data_sheet_trips(factor, why):
    """A known factor is named; an unknown one trips as well."""
    gate = density_agrees("x", 0.0038 * factor, FACTS)
    assert gate.ok is False
    assert why in gate.reason


def test_the_root_of_two_is_named_and_passes():
    """The scatter of parts explains it as well."""
    gate = density_agrees("x", 0.0038 * 1.43, FACTS)
    assert gate.ok is True
    assert "near 1.414, as when one-sided and two-sided densities are mixed up" in gate.reason


def test_the_density_is_one_sided_as_in_a_data_sheet():
    """White noise of one-sided density d has a variance of d^2 times half of the rate."""
    one_sided = 0.0038 / math.sqrt(2.0)
    _, channels = recording(count=200_000, level=one_sided / math.sqrt(2.0))
    assert density(channels["x"], 100.0) == pytest.approx(one_sided, rel=0.08)


def test_a_channel_in_radians_is_found_in_the_recording():
    """Readings divided by 57.3 have a density that the data sheet does not."""
    time, channels = recording()
    channels["z"] = channels["z"] * math.pi / 180.0
    facts = Facts(rate=100.0, noise_density=0.0038 * math.sqrt(2.0), temperature="temperature")
    found = tripped(time, channels, facts)
    assert [(gate.name, gate.channel) for gate in found] == [("alike", "z"), ("density", "z")]
    assert all("1/57.3" in gate.reason for gate in found)


@pytest.mark.parametrize(
    ("convert", "why"),
    [
        (lambda degrees: np.rint((degrees - 25.0) * 132.48) + 700.0, "raw counts"),
        (lambda degrees: np.rint(8.0 * np.sin(np.arange(degrees.size))), "raw counts"),
        (lambda degrees: degrees + 273.15, "as of kelvin"),
    ],
)
def test_a_temperature_that_is_none_trips(convert, why):
    """Counts far away, counts near zero, and kelvin."""
    time, channels = recording()
    channels["temperature"] = convert(channels["temperature"])
    (gate,) = tripped(time, channels, FACTS)
    assert (gate.name, gate.channel) == ("celsius", "temperature")
    assert why in gate.reason


def test_whole_degrees_that_stand_still_are_a_temperature():
    """Eight bits of temperature in a stable chamber."""
    time, channels = recording()
    channels["temperature"] = np.full(time.size, 25.0)
    assert names(time, channels) == []


def test_channels_of_another_length_are_refused():
    """Every channel has a value for each timestamp."""
    with pytest.raises(Refused, match="channel x has shape"):
        tripped([0.0, 1.0, 2.0], {"x": [1.0]}, Facts())


def noise(count=4000, seed=3):
    """White noise of 1."""
    return np.random.default_rng(seed).standard_normal(count)


def changed(places, value):
    """Noise with other values at some places."""
    values = noise()
    values[places] += value
    return values


@pytest.mark.parametrize(
    ("values", "first"),
    [
        (changed([1234], 15.0), 1235),
        (changed([5, 700, 701], -12.0), 6),
        (changed(np.s_[1300:1310], 15.0), 1301),
        (changed(np.s_[2048:2078], 8.0), 2049),
    ],
)
def test_spikes_and_knocks_trip(values, first):
    """One sample, two in a row, ten, thirty; the first is named within the average that shows it."""
    gate = spikes("x", values)
    assert gate.ok is False
    assert abs(gate.samples[0] - first) <= 64


def test_noise_drift_and_motion_are_no_spikes():
    """White noise, a random walk, coarse counts, a step, and a slow swing with quick parts."""
    swing = noise() * 0.01 + np.sin(np.arange(4000) / 50.0) ** 5
    step = noise() + 20.0 * (np.arange(4000) > 2000)
    for values in (noise(100_000), np.cumsum(noise()), np.rint(noise() * 0.7), np.rint(noise()), step, swing):
        assert spikes("x", values).ok is True


@pytest.mark.parametrize("counts", [1.4, 1.87, 2.0, 2.07, 3.33, 4.48])
def test_noise_of_a_few_counts_has_no_spikes(counts):
    """The median of what comes in whole counts is one of few numbers, up to a fifth off; wherever the mean lies."""
    for middle in (0.0, 0.25, 0.5):
        assert spikes("x", np.rint(noise(20_000) * counts + middle)).ok is True
    assert spikes("x", np.rint(changed([1234], 15.0) * counts)).ok is False


@pytest.mark.parametrize(("rate", "ok"), [(20.0, True), (19.99, True), (19.0, False)])
def test_a_bandwidth_of_half_the_nominal_rate_folds_nothing(rate, ok):
    """Also where the clocks of sensor and bench differ by as much as the gate of the rate allows."""
    gate = aliased(rate, Facts(bandwidth=10.0))
    assert gate.ok is ok


@pytest.mark.parametrize("level", [0.5, 1.0, 2.0])
def test_clipping_is_found_without_the_full_scale(level):
    """On one side; fine readings and counts of a tenth."""
    for values in (np.minimum(noise(), level), np.rint(10.0 * np.maximum(noise(), -level)) / 10.0):
        gate = saturated("x", values, Facts())
        assert gate.ok is False
        assert abs(values[gate.samples[0] - 1]) == pytest.approx(level)


@pytest.mark.parametrize("count", [0.25, 0.5, 0.7, 1.0])
def test_clipping_of_coarse_counts_is_found(count):
    """At 1 and 1.5 standard deviations, on one side or both; on a drift of twice the noise as well."""
    drift = np.linspace(0.0, 2.0, 4000)
    for level in (1.0, 1.5):
        last = round(level / count) * count
        values = np.rint(noise() / count) * count
        for clipped in (np.minimum(values, last), np.clip(values, -last, last)):
            assert saturated("x", clipped, Facts()).ok is False
        assert saturated("x", np.minimum(np.rint((noise() + drift) / count) * count, last + count), Facts()).ok is False


def test_half_a_percent_of_wild_samples_trips():
    """None stands out by more than chance allows, and together they hold more power than a tail of noise."""
    generator, values = np.random.default_rng(8), noise()
    values[generator.choice(4000, 20, replace=False)] += generator.choice([-1, 1], 20) * generator.uniform(4, 6, 20)
    assert spikes("x", values).ok is False


def test_counts_of_noise_are_not_clipped():
    """Coarse and fine counts, and a slow sine: nothing piles up at the last level."""
    sine = 20.0 * np.sin(np.arange(4000) / 100.0)
    for values in (
        np.rint(noise()),
        np.rint(10.0 * noise()),
        np.rint(noise() * 0.7),
        np.rint(sine + noise()),
        np.cumsum(np.rint(noise())),
    ):
        assert saturated("x", values, Facts()).ok is None


def test_noise_quantised_away_trips_without_the_count():
    """The readings themselves show what one count is."""
    gate = resolved("x", 0.00875 * np.rint(0.2 * noise() + 0.3), Facts())
    assert gate.ok is False
    assert "one count is 0.00875" in gate.reason
    assert resolved("x", noise(), Facts()).ok is None


def test_rounding_adds_what_the_formula_says():
    """Counts of one standard deviation: sqrt(1 + 1/12)."""
    assert rounding(np.rint(noise(100_000)), Facts()) == pytest.approx(math.sqrt(13.0 / 12.0) - 1.0, abs=0.003)
    assert rounding(noise(), Facts()) == 0.0


def test_the_samples_of_a_gate_are_numbered_from_one():
    """Where a channel is stuck, from the first to the last; of repeated rows the repetition."""
    values = noise()
    values[100:200] = values[100]
    assert stuck("x", values).samples == (101, 200)


@pytest.mark.parametrize("height", [1.5, 5.0, -20.0])
def test_a_mean_that_jumps_and_stays_trips(height):
    """After a reset; drift, a warm-up, a walk, a knock and a settling as the record begins do not."""
    place = np.arange(4000)
    gate = jumps("x", noise() + height * (place > 1500))
    assert gate.ok is False
    assert abs(gate.samples[0] - 1501) <= 300
    knock = noise() + 9.0 * ((place > 1500) & (place < 1540))
    settling = noise() + 5.0 * np.exp(-place / 100.0)
    walk = noise() + np.cumsum(noise(seed=4)) / 20.0
    for values in (noise(), noise() + place / 50.0, 10.0 * np.sin(place / 50.0) + noise(), settling, walk, knock):
        assert jumps("x", values).ok is True
    assert jumps("x", noise(400)).ok is None


def test_noise_that_changes_trips():
    """From a place on it is 1.4 times as large; 1.05 times is one noise, and spikes and drift are none."""
    place = np.arange(4000)
    gate = steady("x", noise() * np.where(place < 2000, 1.0, 1.4))
    assert gate.ok is False
    assert abs(gate.samples[0] - 2001) <= 500
    for values in (noise() * np.where(place < 2000, 1.0, 1.05), changed([5, 700], 50.0), noise() + place / 9.0):
        assert steady("x", values).ok is True
    assert steady("x", np.zeros(4000)).ok is None


@pytest.mark.parametrize("count", [1.0, 0.00875])
def test_counts_that_start_over_trip(count):
    """Signed counts read as unsigned, counts that overflow, bytes in the other order; a full range does not."""
    counts = np.rint(300.0 * noise()).astype(int)
    over = (counts + 32600 + 32768) % 65536 - 32768
    for values in (counts % 65536, over, counts.astype(">i2").view("<i2")):
        assert wrapped("x", count * values.astype(float), Facts()).ok is False
    whole = np.random.default_rng(5).integers(-32768, 32768, 4000)
    for values in (counts, counts + 32000, whole):
        assert wrapped("x", count * values.astype(float), Facts(lsb=count)).ok is True
    assert wrapped("x", noise(), Facts()).ok is None


def test_rows_that_stand_twice_or_three_times_are_told():
    """Whole copies only, holes among them; a column that stands still beside one that moves hides none."""
    rows = np.random.default_rng(1).standard_normal(30)
    rows[4] = np.nan
    assert [copies([np.tile(rows, times)]) for times in (1, 2, 3)] == [1, 2, 3]
    assert copies([np.tile(rows, 2), np.ones(60)]) == 2
    assert copies([np.ones(60)]) == 1
    assert copies([np.append(np.tile(rows, 2), 0.0)]) == 1
    assert copies([]) == 1
    gate = repeated({"x": np.tile(rows, 2)})
    assert (gate.ok, gate.samples) == (False, (31,))
    assert "the same 30 rows stand twice" in gate.reason


@pytest.mark.parametrize("turns", range(2, 7))
@pytest.mark.parametrize("beneath", [np.zeros(6000), np.linspace(0.0, 900.0, 6000), np.sin(np.arange(6000) / 300.0)])
def test_sensors_that_take_turns_are_told_apart(turns, beneath):
    """Whatever drifts beneath them, around holes; alone, each of them passes."""
    alone = np.random.default_rng(3).standard_normal(6000) + beneath
    alone[[100, 200]] = np.nan
    assert interleaved("x", alone).ok is True
    found = interleaved("x", alone + np.where(np.arange(6000) % turns == 1, 0.8, 0.0))
    assert found.ok is False
    assert "as where several sensors take turns" in found.reason


def test_a_line_beside_a_part_of_the_rate_is_no_turn():
    """50.1 Hz at 100 Hz passes by every sample; a straight line without noise tells nothing."""
    time = np.arange(6000) / 100.0
    noise_alone = np.random.default_rng(3).standard_normal(6000)
    assert interleaved("x", noise_alone + np.sin(2.0 * np.pi * 50.1 * time)).ok is True
    assert interleaved("x", time).ok is True


def test_what_is_not_a_turn_is_no_turn():
    """Samples that stand twice, and zeros that are lost at even distances, have gates of their own."""
    noise_alone = np.random.default_rng(3).standard_normal(6000)
    assert interleaved("x", np.repeat(noise_alone, 2) + np.arange(12_000) * 1e-4).ok is True
    assert interleaved("x", np.where(np.arange(6000) % 200 == 7, 0.0, 50.0 + noise_alone)).ok is True
    assert interleaved("x", np.full(6000, 18.18)).ok is True
