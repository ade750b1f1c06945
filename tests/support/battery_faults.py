"""What goes wrong behind the ports of the battery bench while a plan runs on it, and what is true there at the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from hil.executive.ending.stop import StopFlags
from hil.simulation import world as ends
from hil.simulation.world import World

__all__ = ["Scene", "loses_its_output", "overshoots", "plant"]

HOUR_NS = 3_600_000_000_000

Act = Callable[[World], None]


@dataclass
class Scene:
    """Acts that happen in the simulated world at instants of its clock, and the world of the newest bench.

    Attributes:
        acts: hours of bench time, and what happens then.
        world: what was built last.
    """

    acts: list[tuple[float, Act]] = field(default_factory=list)
    world: World | None = None
    _flags: list[StopFlags] = field(default_factory=list)

    def watch(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Let every world that is built have these acts."""
        build, init = ends.build_world, StopFlags.__init__

        def built(*arguments):
            world = self.world = build(*arguments)
            for hours, act in self.acts:
                world.clock.at(round(hours * HOUR_NS), lambda act=act: act(world))
            return world

        def noted(flags):
            init(flags)
            self._flags.append(flags)

        monkeypatch.setattr(ends, "build_world", built)
        monkeypatch.setattr(StopFlags, "__init__", noted)

    def stops_to_be_resumed(self, world: World) -> None:
        """Do what `hil stop --to-resume` asks for, at an instant of bench time."""
        self._flags[-1].leave_open = True
        self._flags[-1].request("Ada: bench needed")

    def still_on(self) -> dict[str, float]:
        """Return what is on in truth, by name; empty where nothing is."""
        assert self.world is not None
        battery = self.world.plants["battery"]
        found = {
            "current of the cell": battery.observe("current"),
            "current of the supply": battery.observe("supply.current"),
            "voltage of the supply": float(battery.inputs["supply_voltage"]),
            "coolers": float(battery.inputs["tec"]),
        }
        return {name: value for name, value in found.items() if value}


def plant(**values) -> Act:
    """Return an act that sets inputs of the plant."""
    return lambda world: world.plants["battery"].command(**values)


def _supply(world):
    return world.by_device["psu1"]._peer


def overshoots(volts: float) -> Act:
    """Return an act that lets the charger give so much more than it was told."""

    def act(world):
        output = _supply(world)._channels[1]
        output._truth = replace(output._truth, output_voltage_offset=volts)
        output.apply()
        _supply(world)._protect()

    return act


def loses_its_output(world) -> None:
    """Switch the charger off without anybody having asked for it."""
    _supply(world)._channels[1].switch(on=False, now_ns=world.clock.now_ns())
