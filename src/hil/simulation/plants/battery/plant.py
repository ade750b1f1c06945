"""The battery plant: a cell with its wires, between a supply, a load and thermoelectric coolers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Annotated, ClassVar

from hil.model.notation import NotNegative, Positive, number, one_of
from hil.simulation.plants.battery.cell import Cell, CellTruth
from hil.simulation.plants.battery.housing import HEALTHY, STATES, Housing, HousingTruth, Thermistor
from hil.simulation.plants.battery.network import Flow, Network
from hil.simulation.plants.model import PlantModel
from hil.simulation.plants.plant import Inputs, Plant, Port, Value, Vector
from hil.simulation.truth import Truth

__all__ = ["MODEL", "PLACES", "Battery", "RoomTruth", "WiringTruth", "build"]

PLACES = ("container", "assembly")
"""Where a cell can lie: in the metal container alone, or between the halves of the assembly in it."""

_FUSES = ("fitted", "open")
_STATE = (
    *("charge", "fast", "slow", "passed"),
    *("temperature", "plate", "box"),
    *("supply.current", "voltage", "current"),
)
_PLACES = {name: place for place, name in enumerate(_STATE) if name not in {"fast", "slow", "passed"}}
_CELL, _BOX, _FLOWS = _STATE.index("temperature"), _STATE.index("box"), _STATE.index("supply.current")
_THERMISTOR = "ntc_temperature"
_OPEN_OHMS = 1e9
_METER_SIEMENS = 1e-6
_KEPT_SETTINGS, _KEPT_STEPS = 512, 64


@dataclass(frozen=True, slots=True, kw_only=True)
class WiringTruth:
    """Resistances [ohm] and load outside the cell; two-wire measurements see what is between tester and cell.

    Attributes:
        leads: both wires between tester and cell.
        fuse: with its holder.
        contact: of each relay, charge and discharge.
        supply_leads: both cables between supply and tester.
        load_current: what the load draws at the epoch, whatever the voltage [A].
        load_resistance: in parallel with the load [ohm], 0 for none.
    """

    leads: NotNegative = 0.06
    fuse: NotNegative = 0.04
    contact: NotNegative = 0.02
    supply_leads: Positive = 0.06
    load_current: NotNegative = 0.7
    load_resistance: NotNegative = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RoomTruth:
    """Where the battery is at the epoch: temperature of the room [degC], and one of `PLACES`."""

    ambient: Annotated[float, number(-60, 80)] = 24.5
    place: Annotated[str, one_of(*PLACES)] = PLACES[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Setting:
    """What follows from inputs alone, and the steps under them by their seconds."""

    network: Network
    solve: Callable[[float, float], Flow]
    share: float
    room: float
    assembled: bool
    steps: dict[float, Callable[[Vector], Vector]] = field(default_factory=dict)


class Battery(Plant):
    """A cell with leads and fuse at the tester's terminals, where relays connect supply and load.

    State: state of charge, voltages of both links, throughput [A.s], temperatures of cell, plates and box [degC], and
    what flows: out of the supply [A], at the tester's terminals [V], into the cell [A]. Steps are exact under the
    current that holds at their end: a supply in voltage mode holds its voltage at every grid point. What flows jumps
    with a command.

    Signals: `voltage` at the tester's terminals, `cell_voltage` at the tabs, `current` into the cell, `load.current`,
    `supply.voltage/current`, `open_circuit`; `temperature` of the cell, `plate`, `box`, `ambient` in degC; `ntc` and
    `ntc_box` in ohm, `ntc_temperature`: what the first one reads [degC]; `charge` [1], `capacity` [A.h], `cycles` and
    `resistance` [ohm, ohmic, of the cell].

    Args:
        name: the plant's name.
        grid_ns: distance of grid points.
        cell: what the cell is made of.
        wiring: what is between cell, tester and supply.
        housing: where it lies.
        thermistor: what is taped to the cell and hangs in the box.
        ambient: temperature of the room, and of everything at the epoch [degC].
        place: one of `PLACES`.
    """

    ports: ClassVar[Mapping[str, Port]] = MappingProxyType(
        {"supply": Port("supply_voltage", "supply_current", "supply.voltage", "supply.current")}
    )

    def __init__(
        self,
        name: str,
        grid_ns: int,
        *,
        cell: CellTruth,
        wiring: WiringTruth,
        housing: HousingTruth,
        thermistor: Thermistor,
        ambient: float = 24.5,
        place: str = "container",
    ) -> None:
        inputs: Inputs = {
            "supply_voltage": 0.0,
            "supply_current": 0.0,
            "charge_contact": False,
            "discharge_contact": False,
            "load_current": wiring.load_current,
            "load_resistance": wiring.load_resistance,
            "fuse": "fitted",
            "place": place,
            "ntc": "healthy",
            "tec": 0.0,
            "ambient": ambient,
        }
        self._cell = Cell(cell)
        self._still = self._cell.tabs(0.0)
        self._wiring = wiring
        self._housing = Housing(housing)
        self._thermistor = thermistor
        self._names = tuple(inputs)
        self._known = lru_cache(maxsize=_KEPT_SETTINGS)(self._setting)
        self._set = (inputs, self._known(tuple(inputs.values())))
        self._readers: Mapping[str, Callable[[Vector, Inputs], float]] = self._reading()
        empty = (cell.start, 0.0, 0.0, 0.0, ambient, ambient, ambient, 0.0, 0.0, 0.0)
        state = self.commanded(empty, inputs, inputs)
        super().__init__(name, grid_ns, state, inputs, frozenset((*_PLACES, *self._readers)))

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the values of the inputs that are texts."""
        return {"fuse": _FUSES, "ntc": STATES, "place": PLACES}.get(name, ())

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step cell and temperatures; age, temperature and the table's line are those of the step's start."""
        return self.stepping(inputs, dt)(state)

    def stepping(self, inputs: Inputs, dt: float) -> Callable[[Vector], Vector]:
        """Return a step of `dt` seconds as a function of the state alone."""
        here = self._of(inputs)
        step = here.steps.get(dt)
        if step is None:
            if len(here.steps) > _KEPT_STEPS:
                here.steps.clear()
            response = self._housing.response(here.share, here.room, dt, assembled=here.assembled)
            warmed = self._housing.step(here.room, response)
            step = here.steps[dt] = self._cell.step(dt, here.solve, warmed)
        return step

    def commanded(self, state: Vector, before: Inputs, after: Inputs) -> Vector:
        """Let other things flow at once."""
        del before
        base, ohms, _, _ = self._still(state)
        return (*state[:_FLOWS], *self._of(after).solve(base, ohms))

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        del at
        place = _PLACES.get(name)
        return self._readers[name](state, inputs) if place is None else state[place]

    def places(self, names: tuple[str, ...], inputs: Inputs) -> tuple[int, ...] | None:
        """Return the places of what is in the state; a healthy thermistor reads the temperature where it is."""
        told = _PLACES | ({_THERMISTOR: _CELL} if inputs["ntc"] == HEALTHY else {})
        return tuple([told[name] for name in names]) if told.keys() >= {*names} else None

    def _reading(self) -> Mapping[str, Callable[[Vector, Inputs], float]]:
        """Return how the signals are found that are not in the state."""
        cell, thermistor, of = self._cell, self._thermistor, self._of

        def at_tabs(state: Vector, inputs: Inputs) -> float:
            del inputs
            base, ohms, _, _ = self._still(state)
            return base + ohms * state[-1]

        def at_supply(state: Vector, inputs: Inputs) -> float:
            supply, volts, _ = state[_FLOWS:]
            held = float(inputs["supply_voltage"])
            return of(inputs).network.at_supply(held, supply, volts) if inputs["charge_contact"] else held

        return {
            "ambient": lambda _, inputs: float(inputs["ambient"]),
            "capacity": lambda state, _: cell.ageing.aged(state[3])[0] / 3600,
            "cell_voltage": at_tabs,
            "cycles": lambda state, _: cell.ageing.cycles(state[3]),
            "load.current": lambda state, _: state[_FLOWS] - state[-1],
            "ntc": lambda state, inputs: thermistor.seen(str(inputs["ntc"]), state[_CELL], state[_BOX]),
            "ntc_box": lambda state, _: thermistor.ohms(state[_BOX]),
            _THERMISTOR: lambda state, inputs: thermistor.read(str(inputs["ntc"]), state[_CELL], state[_BOX]),
            "open_circuit": lambda state, _: cell.table.volts(state[0]),
            "resistance": lambda state, _: self._still(state)[1],
            "supply.voltage": at_supply,
        }

    def _of(self, inputs: Inputs) -> _Setting:
        known = self._set
        if known[0] is inputs:
            return known[1]
        here = self._known(tuple(inputs.values()))
        self._set = (inputs, here)
        return here

    def _setting(self, values: tuple[Value, ...]) -> _Setting:
        inputs = dict(zip(self._names, values, strict=True))
        wiring = self._wiring
        charging, discharging, fitted = (
            inputs["charge_contact"],
            inputs["discharge_contact"],
            inputs["fuse"] == "fitted",
        )
        resistance = float(inputs["load_resistance"])
        siemens = 1 / (resistance + wiring.contact) if discharging and resistance > 0 else 0.0
        network = Network(
            volts=float(inputs["supply_voltage"]) if charging else 0.0,
            limit=float(inputs["supply_current"]) if charging else 0.0,
            path=wiring.supply_leads + wiring.contact,
            load=float(inputs["load_current"]) if discharging else 0.0,
            # Behind an open fuse only the tester's own input holds the terminals.
            siemens=siemens if fitted else siemens + _METER_SIEMENS,
        )
        wires = wiring.leads + wiring.fuse + (0.0 if fitted else _OPEN_OHMS)
        live = fitted and (network.limit > 0 or network.load > 0 or siemens > 0)
        return _Setting(
            network=network,
            solve=network.solver(wires) if live else network.idle(wires),
            share=min(max(float(inputs["tec"]), -1.0), 1.0),
            room=float(inputs["ambient"]),
            assembled=inputs["place"] == "assembly",
        )


def build(name: str, grid_ns: int, truth: Truth) -> Battery:
    """Build the plant from its truth.

    Raises:
        TruthError: with everything that is wrong.
    """
    cell, wiring, thermistor = truth.part(CellTruth), truth.part(WiringTruth), truth.part(Thermistor)
    housing, room = truth.part(HousingTruth), truth.part(RoomTruth)
    if housing.seebeck * housing.current >= housing.sink_ambient:
        truth.wrong("sink_ambient", "must be above seebeck * tec_current, or the sinks run away")
    truth.finish()
    return Battery(
        name,
        grid_ns,
        cell=cell,
        wiring=wiring,
        housing=housing,
        thermistor=thermistor,
        ambient=room.ambient,
        place=room.place,
    )


MODEL = PlantModel(build=build)
"""The plant model `battery`."""
