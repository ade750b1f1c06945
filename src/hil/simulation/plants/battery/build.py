"""The battery plant from the truth section of a bench file."""

from __future__ import annotations

from itertools import pairwise

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
    cell, wiring, housing, thermistor = _cell(truth), _wiring(truth), _housing(truth), _thermistor(truth)
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


def _cell(truth: Truth) -> CellTruth:
    usual = CellTruth()
    volts = truth.vector("open_circuit", len(usual.charge), usual.open_circuit)
    if any(after <= before for before, after in pairwise(volts)):
        truth.wrong("open_circuit", "expected voltages that rise with the state of charge")
    return CellTruth(
        open_circuit=volts,
        capacity=truth.number("capacity", usual.capacity, above=0),
        resistance=truth.number("resistance", usual.resistance, above=0),
        fast_resistance=truth.number("fast_resistance", usual.fast_resistance, above=0),
        fast_time=truth.number("fast_time", usual.fast_time, above=0),
        slow_resistance=truth.number("slow_resistance", usual.slow_resistance, above=0),
        slow_time=truth.number("slow_time", usual.slow_time, above=0),
        activation=truth.number("activation", usual.activation, minimum=0, maximum=10_000),
        entropic=truth.number("entropic", usual.entropic, minimum=-0.01, maximum=0.01),
        fade=truth.number("fade", usual.fade, minimum=0, maximum=1),
        growth=truth.number("growth", usual.growth, minimum=0, maximum=1),
        start=truth.number("charge", usual.start, minimum=0, maximum=1),
    )


def _wiring(truth: Truth) -> WiringTruth:
    usual = WiringTruth()
    return WiringTruth(
        leads=truth.number("leads", usual.leads, minimum=0),
        fuse=truth.number("fuse", usual.fuse, minimum=0),
        contact=truth.number("contact", usual.contact, minimum=0),
        supply_leads=truth.number("supply_leads", usual.supply_leads, above=0),
        load_current=truth.number("load_current", usual.load_current, minimum=0),
        load_resistance=truth.number("load_resistance", usual.load_resistance, minimum=0),
    )


def _thermistor(truth: Truth) -> Thermistor:
    usual = Thermistor()
    return Thermistor(
        nominal=truth.number("ntc_nominal", usual.nominal, above=0),
        beta=truth.number("ntc_beta", usual.beta, above=0),
    )


def _housing(truth: Truth) -> HousingTruth:
    usual = HousingTruth()
    housing = HousingTruth(
        cell_capacity=truth.number("cell_capacity", usual.cell_capacity, above=0),
        plate_capacity=truth.number("plate_capacity", usual.plate_capacity, above=0),
        box_capacity=truth.number("box_capacity", usual.box_capacity, above=0),
        cell_box=truth.number("cell_box", usual.cell_box, above=0),
        cell_plate=truth.number("cell_plate", usual.cell_plate, above=0),
        plate_box=truth.number("plate_box", usual.plate_box, above=0),
        box_ambient=truth.number("box_ambient", usual.box_ambient, above=0),
        seebeck=truth.number("seebeck", usual.seebeck, above=0),
        resistance=truth.number("tec_resistance", usual.resistance, above=0),
        conductance=truth.number("tec_conductance", usual.conductance, above=0),
        sink_ambient=truth.number("sink_ambient", usual.sink_ambient, above=0),
        current=truth.number("tec_current", usual.current, above=0),
    )
    if housing.seebeck * housing.current >= housing.sink_ambient:
        truth.wrong("sink_ambient", "expected a conductance above seebeck * tec_current, or the sinks run away")
    return housing


MODEL = PlantModel(build=build)
"""The plant model `battery`."""
