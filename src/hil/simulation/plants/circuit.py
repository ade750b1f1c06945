"""A coil behind a supply that holds its voltage or its current limit, solved exactly."""

from __future__ import annotations

from math import exp, inf, log

__all__ = ["drive"]


def drive(
    current: float, volts: float, limit: float, *, ohms: float, henries: float, seconds: float
) -> tuple[float, float]:
    """Return the current after `seconds`, and the mean of its square meanwhile.

    L di/dt + R i = V is solved by i = V/R + (i0 - V/R) exp(-t R/L). The supply holds the current once
    it reaches the limit from either side: below it the full voltage drives the coil, above it none does.

    Args:
        current: A at the start, positive out of the supply.
        volts: V that the supply holds as long as the current stays below the limit.
        limit: A, at least 0.
        ohms: resistance, above 0.
        henries: inductance, above 0.
        seconds: how long, above 0.
    """
    tau = henries / ohms
    target, limited = volts / ohms, volts / ohms > limit
    until = seconds
    if limited:
        target = 0.0 if current > limit else target
        until = min(seconds, _time_to(limit, current, target, tau))
    decay = exp(-until / tau)
    after = target + (current - target) * decay
    square = _square(target, current - target, decay, tau, until)
    if limited and until < seconds:
        after = limit
        square += limit * limit * (seconds - until)
    return after, square / seconds


def _time_to(level: float, current: float, target: float, tau: float) -> float:
    """Return when a relaxation from `current` to `target` passes a level between them."""
    if level == target:
        return inf
    return tau * log((current - target) / (level - target))


def _square(target: float, gap: float, decay: float, tau: float, seconds: float) -> float:
    """Return the integral of (target + gap exp(-t/tau))^2 over `seconds`."""
    return target * target * seconds + 2 * target * gap * tau * (1 - decay) + gap * gap * tau / 2 * (1 - decay * decay)
