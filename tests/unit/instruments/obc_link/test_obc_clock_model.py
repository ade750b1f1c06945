"""The clock model: drift with an honest uncertainty, whatever the delays."""

from __future__ import annotations

import random

import pytest

from hil.instruments.obc_link.streams import ClockEstimate, ClockReading, estimate


def exchanges(seed, *, drift=0.0, count=60, span=600.0, jitter=0.0, asymmetry=0.0):
    """Return exchanges over `span` seconds; each way takes 400 us, and `jitter` on top at random."""
    draw = random.Random(seed)
    made = []
    for index in range(count):
        sent = index * span / (count - 1)
        middle = sent + 400e-6 + asymmetry + draw.expovariate(1 / jitter) if jitter else sent + 400e-6 + asymmetry
        received = middle + 400e-6 + (draw.expovariate(1 / jitter) if jitter else 0.0)
        device = round(3.0 + middle * (1.0 + drift), 6)
        made.append(ClockReading(sent=sent, device_received=device, device_sent=device, received=received))
    return made


def test_nothing_tells_nothing():
    """Without an exchange nothing is known."""
    assert estimate([]) == ClockEstimate()


def test_few_exchanges_tell_the_offset_only():
    """Two exchanges, or many at one instant, have no drift with an uncertainty."""
    one = ClockReading(sent=1.0, device_received=4.0, device_sent=4.0, received=1.001)
    assert estimate([one]).offset == pytest.approx(-2.9995)
    assert estimate([one] * 5).drift is None


def test_offset_and_delay_of_one_exchange():
    """The two quantities of RFC 5905: half the sum of the ways, and the time on the way."""
    one = ClockReading(sent=10.0, device_received=2.001, device_sent=2.003, received=10.006)
    assert one.offset == pytest.approx(8.001)
    assert one.delay == pytest.approx(0.004)


@pytest.mark.parametrize("drift", [-100e-6, 0.0, 35e-6])
def test_the_drift_is_found(drift):
    """Without jitter the drift is known to a few parts in 1e10 after ten minutes."""
    found = estimate(exchanges(1, drift=drift))
    assert abs(found.drift - drift) < 5 * found.drift_uncertainty < 1e-8


def test_a_constant_asymmetry_shifts_only_the_offset():
    """One way that is always slower changes the offset by half of it, the drift not at all."""
    straight, skewed = estimate(exchanges(1, drift=1e-5)), estimate(exchanges(1, drift=1e-5, asymmetry=200e-6))
    assert skewed.drift == pytest.approx(straight.drift, abs=1e-9)
    assert straight.offset - skewed.offset == pytest.approx(100e-6, abs=2e-6)


def test_the_uncertainty_covers_the_truth_under_jitter():
    """With delays of random length two standard uncertainties hold the drift about as often as they should."""
    hits = 0
    for seed in range(300):
        found = estimate(exchanges(seed, drift=12e-6, jitter=300e-6))
        hits += abs(found.drift - 12e-6) <= 2.0 * found.drift_uncertainty
    assert 270 <= hits <= 300


def test_slow_exchanges_are_left_out():
    """A few very slow exchanges on one way do not move the estimate."""
    clean = exchanges(1, drift=1e-5)
    slow = [
        ClockReading(
            sent=one.sent,
            device_received=one.device_received,
            device_sent=one.device_sent,
            received=one.received + (0.05 if index % 7 == 0 else 0.0),
        )
        for index, one in enumerate(clean)
    ]
    assert estimate(slow).drift == pytest.approx(estimate(clean).drift, abs=1e-8)
