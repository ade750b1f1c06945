"""The battery plant from the truth section of a bench file."""

from __future__ import annotations

from hil.simulation.plants.battery.cell import CellTruth
from hil.simulation.plants.battery.housing import HousingTruth
from hil.simulation.plants.battery.plant import PLACES, Battery, WiringTruth
from hil.simulation.plants.battery.sensor import Thermistor
from hil.simulation.plants.model import PlantModel
from hil.simulation.truth import Truth

__all__ = ["MODEL", "build"]


def build(name: str, grid_ns: int, truth: Truth) -> Battery:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    cell, wiring, thermistor = truth.part(CellTruth), truth.part(WiringTruth), truth.part(Thermistor)
    housing = truth.part(HousingTruth)
    if housing.seebeck * housing.current >= housing.sink_ambient:
        truth.wrong("sink_ambient", "must be above seebeck * tec_current, or the sinks run away")
    ambient = truth.number("ambient", 24.5, minimum=-60, maximum=80)
    place = truth.text("place", PLACES[0], choices=PLACES)
    truth.finish()
    return Battery(
        name,
        grid_ns,
        cell=cell,
        wiring=wiring,
        housing=housing,
        thermistor=thermistor,
        ambient=ambient,
        place=place,
    )


MODEL = PlantModel(build=build)
"""The plant model `battery`."""
