"""Net charge and energy of a battery test beside the instrument's own, as a table and for machines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict

from hil.analysis.battery.counted import Net, net
from hil.analysis.battery.series import Series
from hil.analysis.battery.steps import Segmentation, segment
from hil.logs.battery import BatteryLog

__all__ = ["as_json", "as_lines"]

_HEAD = f"{'net':10s}  {'trapezoid':>12s}  {'counted edges':>13s}  {'its own':>12s}  {'apart':>12s}  {'of it':>8s}"


def as_json(log: BatteryLog, data: Series, how: Segmentation) -> dict[str, object]:
    """Return net charge and energy with their parts, the instrument's own, and the differences.

    Args:
        log: what was read.
        data: what was analysed.
        how: how steps are told apart.
    """
    made = _sums(log, data, how)
    return {
        "net": {f"{what}_{unit}": found.value for what, unit, found, _ in made},
        "own": {f"{what}_{unit}": own for what, unit, _, own in made},
        "apart": {
            f"{what}_{unit}": None if own is None else found.value - own for what, unit, found, own in made
        },
        "sums": {f"{what}_{unit}": asdict(found) for what, unit, found, _ in made},
    }  # fmt: skip


def as_lines(log: BatteryLog, data: Series, how: Segmentation) -> Iterator[str]:
    """Yield a table of both sums where the instrument has its own, and what its count stands for.

    Args:
        log: what was read.
        data: what was analysed.
        how: how steps are told apart.
    """
    made = [each for each in _sums(log, data, how) if each[3] is not None]
    if made:
        yield _HEAD
    for what, unit, found, own in made:
        if own is not None:
            part = f"{found.value / own - 1.0:+8.1e}" if own else ""
            yield (
                f"{what:6s} {unit}   {found.samples:12.6f}  {found.value:13.6f}  {own:12.6f}"
                f"  {found.value - own:+12.1e}  {part}"
            ).rstrip()
    if made and made[0][2].edges:
        told = ", ".join(
            f"{found.counted:.3g} {unit} (samples alone: ± {found.open:.2g} {unit})" for _, unit, found, _ in made
        )
        number = made[0][2].edges
        switches = "1 switch" if number == 1 else f"{number} switches"
        yield f"{switches} between rest and current as the instrument counted: {told}"


def _sums(log: BatteryLog, data: Series, how: Segmentation) -> list[tuple[str, str, Net, float | None]]:
    steps = segment(data, how)
    return [
        ("charge", "Ah", net(data, steps, energy=False), log.own_charge),
        ("energy", "Wh", net(data, steps, energy=True), log.own_energy),
    ]
