"""The battery plant: a cell with its wires, between a supply, a load and thermoelectric coolers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from operator import itemgetter
from types import MappingProxyType
from typing import ClassVar

from hil.simulation.plants.battery.cell import Cell, CellTruth
from hil.simulation.plants.battery.housing import Housing, HousingTruth
from hil.simulation.plants.battery.network import Flow, Network
from hil.simulation.plants.battery.sensor import STATES, Thermistor
from hil.simulation.plants.plant import Inputs, Plant, Port, Value, Vector

__all__ = ["PLACES", "Battery", "WiringTruth"]

PLACES = ("container", "assembly")
"""Where a cell can lie: in the metal container alone, or between the halves of the assembly in it."""

_FUSES = ("fitted", "open")
_FLOWS = {
    name: place
    for place, name in enumerate(
        ("voltage", "current", "cell_voltage", "supply.voltage", "supply.current", "load.current")
    )
}
_STATE = ("charge", "fast", "slow", "passed", "temperature", "plate", "box")
_STATES = {name: place for place, name in enumerate(_STATE) if name not in {"fast", "slow", "passed"}}
_SIGNALS = frozenset(
    (
        *_FLOWS,
        *_STATES,
        "ambient",
        "capacity",
        "cycles",
        "ntc",
        "ntc_box",
        "ntc_temperature",
        "open_circuit",
        "resistance",
    )
)
_OPEN_OHMS = 1e9
_METER_SIEMENS = 1e-6
_KEPT_SETTINGS, _KEPT_STEPS = 8192, 64

_Flows = Callable[[Vector], Vector]


@dataclass(frozen=True, slots=True, kw_only=True)
class WiringTruth:
    """Resistances [ohm] and load outside the cell; two-wire measurements see what is between tester and cell.

    Attributes:
        leads: both wires between tester and cell.
        fuse: with its holder.
        contact: of each relay, charge and discharge.
        supply_leads: both cables between supply and tester.
        load_current: what the load draws at the epoch, whatever the voltage [A].
        load_resistance: of the load besides [ohm], 0 for none.
    """

    leads: float = 0.06
    fuse: float = 0.04
    contact: float = 0.02
    supply_leads: float = 0.06
    load_current: float = 0.7
    load_resistance: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Setting:
    """What follows from inputs alone, and the steps under them by their seconds."""

    flows: _Flows
    solve: Callable[[float, float], Flow]
    live: bool
    share: float
    room: float
    assembled: bool
    steps: dict[float, Callable[[Vector], Vector]] = field(default_factory=dict)


class Battery(Plant):
    """A cell behind leads and fuse at the tester's terminals, where relays connect supply and load.

    State: state of charge, voltages of both links, throughput [A.s], temperatures of cell, plates and box [degC]. Steps
    are exact under the current that holds at their end: a supply in voltage mode holds its voltage at every grid point.

    Signals: `voltage` at the tester's terminals, `cell_voltage` at the tabs, `current` into the cell, `load.current`,
    `supply.voltage/current`, `open_circuit`; `temperature` of the cell, `plate`, `box`, `ambient` in degC; `ntc` and
    `ntc_box` in ohm, `ntc_temperature`: what the first one tells [degC]; `charge` [1], `capacity` [A.h], `cycles` and
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
        super().__init__(name, grid_ns, (cell.start, 0.0, 0.0, 0.0, ambient, ambient, ambient), inputs, _SIGNALS)
        self._cell = Cell(cell)
        self._still = self._cell.tabs(0.0)
        self._wiring = wiring
        self._housing = Housing(housing)
        self._thermistor = thermistor
        self._names = tuple(inputs)
        self._known = lru_cache(maxsize=_KEPT_SETTINGS)(self._setting)
        self._set = (self.inputs, self._known(tuple(inputs.values())))
        self._flowed: tuple[Vector, _Setting, Vector] | None = None  # what was solved last
        self._readers: Mapping[str, Callable[[Vector, Inputs], float]] = {
            "ambient": lambda _, inputs: float(inputs["ambient"]),
            "capacity": lambda state, _: self._cell.ageing.aged(state[3])[0] / 3600,
            "cycles": lambda state, _: self._cell.ageing.cycles(state[3]),
            "ntc": lambda state, inputs: self._thermistor.seen(str(inputs["ntc"]), state[4], state[6]),
            "ntc_temperature": lambda state, inputs: self._thermistor.read(str(inputs["ntc"]), state[4], state[6]),
            "ntc_box": lambda state, _: self._thermistor.ohms(state[6]),
            "open_circuit": lambda state, _: self._cell.table.volts(state[0]),
            "resistance": lambda state, _: self._still(state)[1],
        }

    def choices(self, name: str) -> tuple[str, ...]:
        """Return the values of the inputs that are texts."""
        return {"fuse": _FUSES, "ntc": STATES, "place": PLACES}.get(name, ())

    def step(self, state: Vector, inputs: Inputs, dt: float) -> Vector:
        """Step cell and temperatures; age, temperature and the table's line are those of the step's start."""
        here = self._of(inputs)
        step = here.steps.get(dt)
        if step is None:
            if len(here.steps) > _KEPT_STEPS:
                here.steps.clear()
            step = here.steps[dt] = self._step(here, dt)
        return step(state)

    def signal(self, name: str, state: Vector, inputs: Inputs, at: float) -> float:
        """Return one of the signals of this plant."""
        del at
        place = _STATES.get(name)
        if place is not None:
            return state[place]
        place = _FLOWS.get(name)
        if place is not None:
            return self._flows(state, inputs)[place]
        return self._readers[name](state, inputs)

    def reading(self, names: tuple[str, ...]) -> Callable[[Vector, Inputs, float], Vector]:
        """Return `signal` for several names at once: one look for all of them."""
        if len(names) < 2:
            return super().reading(names)
        others = [self._readers[name] for name in names if name in self._readers]
        order = [*_FLOWS, *_STATE, *(name for name in names if name in self._readers)]
        pick: Callable[[Vector], Vector] = itemgetter(*(order.index(name) for name in names))
        of = self._of

        def read(state: Vector, inputs: Inputs, at: float) -> Vector:
            del at
            return pick((*of(inputs).flows(state), *state, *[other(state, inputs) for other in others]))

        return read

    def between(self, state: Vector, ahead: Vector, share: float) -> Vector:
        """Return the state at a share of the way from one to the other, as every plant does, without a loop."""
        a, b, c, d, e, f, g = state
        p, q, r, s, t, u, v = ahead
        return (
            a + (p - a) * share,
            b + (q - b) * share,
            c + (r - c) * share,
            d + (s - d) * share,
            e + (t - e) * share,
            f + (u - f) * share,
            g + (v - g) * share,
        )

    def _flows(self, state: Vector, inputs: Inputs) -> Vector:
        """Return the signals of `_FLOWS`; those of one instant are solved once."""
        here, known = self._of(inputs), self._flowed
        if known is not None and known[0] is state and known[1] is here:
            return known[2]
        flows = here.flows(state)
        self._flowed = (state, here, flows)
        return flows

    def _of(self, inputs: Inputs) -> _Setting:
        known = self._set
        if known[0] is inputs:
            return known[1]
        here = self._known(tuple(inputs.values()))
        self._set = (inputs, here)
        return here

    def _solved(self, network: Network, wires: float, held: float, *, live: bool, charging: bool) -> _Flows:
        """Return the signals of `_FLOWS` as a function of the state alone, for what hangs on the terminals.

        The cell lifts the terminals of a supply that gives nothing above the voltage that it would hold.
        """
        still, solve, limit, path = self._still, network.solver(wires), network.limit, network.path

        def flows(state: Vector) -> Vector:
            base, ohms, _, _ = still(state)
            supply, volts, current = solve(base, ohms)
            if not live:
                current = 0.0
            at_supply = held
            if charging:
                at_supply = volts + path * supply if supply >= limit else max(held, volts)
            return volts, current, base + ohms * current, at_supply, supply, supply - current

        return flows

    def _step(self, here: _Setting, dt: float) -> Callable[[Vector], Vector]:
        """Return a step of `dt` seconds as a function of the state alone."""
        response = self._housing.response(here.share, here.room, dt, assembled=here.assembled)
        warmed = self._housing.step(here.room, response)
        return self._cell.step(dt, here.solve if here.live else None, warmed)

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
        held = float(inputs["supply_voltage"])
        return _Setting(
            flows=self._solved(network, wires, held, live=live, charging=bool(charging)),
            solve=network.solver(wires),
            live=live,
            share=min(max(float(inputs["tec"]), -1.0), 1.0),
            room=float(inputs["ambient"]),
            assembled=inputs["place"] == "assembly",
        )
