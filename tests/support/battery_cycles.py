"""A battery plant that is charged and discharged as on its tester, seen every grid step."""

from __future__ import annotations

from types import SimpleNamespace

from hil.simulation.plants.battery.plant import build
from hil.simulation.truth import Truth

__all__ = ["GRID_S", "SECOND_NS", "Cycles", "battery"]

SECOND_NS = 1_000_000_000
GRID_S = 5
_CHARGED_A = 0.05
_EMPTY_V = 2.7


def battery(grid_s=GRID_S, **truth):
    """Return a plant with what differs from the usual truth."""
    return build("cell", round(grid_s * SECOND_NS), Truth(truth, ("truth",)))


class Cycles:
    """Charges at 0.7 A to 4.2 V and 50 mA, discharges at 0.7 A to 2.7 V, and adds up what the tester sees."""

    def __init__(self, plant, grid_s=GRID_S) -> None:
        self.plant = plant
        self._grid_s = grid_s
        self._now_s = 0

    def charge(self):
        """Charge until the current has fallen; return seconds, watt hours and kelvins."""
        self.plant.command(charge_contact=True, discharge_contact=False, supply_voltage=4.2, supply_current=0.7)
        return self._until(lambda _, amperes: amperes < _CHARGED_A)

    def discharge(self):
        """Discharge until the voltage has fallen; return seconds, watt hours and kelvins."""
        self.plant.command(charge_contact=False, discharge_contact=True)
        return self._until(lambda volts, _: volts < _EMPTY_V)

    def rest(self, seconds=2 * 3600):
        """Open both contacts for a while."""
        self.plant.command(charge_contact=False, discharge_contact=False)
        self._now_s += seconds
        self.plant.advance(self._now_s * SECOND_NS)

    def _until(self, done):
        began, energy, warmth = self._now_s, 0.0, [self.plant.observe("temperature")]
        volts, amperes = 4.0, 1.0
        while not done(volts, amperes):
            self._now_s += self._grid_s
            self.plant.advance(self._now_s * SECOND_NS)
            volts, amperes = self.plant.observe("voltage"), self.plant.observe("current")
            warmth.append(self.plant.observe("temperature"))
            energy += abs(volts * amperes) * self._grid_s / 3600
        return SimpleNamespace(seconds=self._now_s - began, energy=energy, rise=max(warmth) - min(warmth))
