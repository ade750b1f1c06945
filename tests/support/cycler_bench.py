"""A cycler for tests: its driver, the simulated device with a stand-in for the battery, and the clock."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass

from cycler_page import Battery
from facing import facing

from hil.instruments.cycler.tester import BatteryCycler
from hil.model.bench import Wire
from hil.simulation.peers.cycler.firmware import MODEL

__all__ = ["Bench", "Cell", "cycler", "wire"]

_CONNECTS = {name: f"battery.{name}" for name in ("voltage", "current", "temperature", "charge", "discharge")}


class Cell(Battery):
    """A battery that shows what it is told; between ends of half-cycles it changes by itself where `lines` says so.

    With `lines` a charge ends after that many data lines, and a discharge too.
    """

    lines = 0

    def follow(self, now_ns):
        """Let time pass: nothing happens in between."""

    def observe(self, name):
        """Return a signal; with `lines` it follows the half-cycle."""
        if not self.lines:
            return super().observe(name)
        charging, discharging = self.inputs["charge"], self.inputs["discharge"]
        closed_ns = self.history[-1][0] if self.history else 0
        due = (self.clock.now_ns() - closed_ns) / 1e9 > 5 * self.lines - 1
        if name == "current":
            return (0.04 if due else 0.7) * charging - 0.7 * discharging
        if name == "voltage":
            return 2.69 if discharging and due else 4.2 if charging else 3.6
        return 25.0


@dataclass
class Bench:
    """What a test of the driver needs."""

    role: object
    driver: BatteryCycler
    clock: object
    cell: Cell

    def drained(self, seconds, every=5.0):
        """Drain every few seconds, and return the rows as lists."""
        rows = []
        for _ in range(round(seconds / every)):
            self.clock.sleep(every)
            rows += self.role.drain().tolist()
        return rows


def wire(**settings):
    """Return a wire with settings."""
    return Wire(role="cycler", instance="", instrument="device", settings=settings)


@contextmanager
def cycler(*, truth=None, faults=(), settings=None, lines=0, baud=9600, transcript=None):
    """Yield a `Bench`; the port was opened at 0 s."""
    cell = Cell()
    cell.lines = lines
    with facing(
        MODEL,
        driver=BatteryCycler,
        truth=truth,
        faults=faults,
        connects=_CONNECTS,
        plants={"battery": cell},
        baud=baud,
        transcript=transcript,
    ) as (driver, clock):
        cell.clock = clock
        yield Bench(driver.role(wire(**(settings or {}))), driver, clock, cell)
