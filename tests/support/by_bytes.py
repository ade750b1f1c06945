"""Instruments that are made safe by bytes alone: each with its driver, its peer, and what is really on."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import rotation
from chamber_bench import chamber
from cycler_bench import Cell
from facing import facing

from hil.instruments.cycler.tester import BatteryCycler
from hil.instruments.eurotherm_3216 import Eurotherm3216
from hil.instruments.keysight_33500 import Keysight33500
from hil.instruments.keysight_e36300 import KeysightE36300
from hil.instruments.keysight_single import KeysightE3632a, KeysightE36100
from hil.instruments.korad_ka3005p import KoradKa3005p
from hil.instruments.newport_esp301 import NewportEsp301
from hil.instruments.omron_e5cc import OmronE5cc
from hil.instruments.rigol_dl3021 import RigolDl3021
from hil.instruments.rigol_dp832 import RigolDp832
from hil.instruments.rohde_schwarz_hmp import RohdeSchwarzHmp, RohdeSchwarzNge100
from hil.instruments.safing import LONGEST_REPLY_S
from hil.instruments.siglent_spd3303x import SiglentSpd3303x
from hil.instruments.waveshare_relay import WaveshareRelay
from hil.model.bench import Clamp, Proof, Wire
from hil.simulation.peers.cycler.firmware import MODEL as CYCLER
from hil.simulation.peers.esp301.controller import MODEL as ESP301
from hil.simulation.peers.eurotherm.controller import MODEL as EUROTHERM
from hil.simulation.peers.keysight_33500 import MODEL as GENERATOR
from hil.simulation.peers.keysight_e36312a import MODEL as KEYSIGHT
from hil.simulation.peers.keysight_single import E3632A, E36103B
from hil.simulation.peers.korad_ka3005p import MODEL as KORAD
from hil.simulation.peers.omron_e5cc import MODEL as OMRON
from hil.simulation.peers.rigol_dl3021 import MODEL as LOAD
from hil.simulation.peers.rigol_dp832 import MODEL as RIGOL
from hil.simulation.peers.rohde_schwarz_hmp import HMP, NGE100
from hil.simulation.peers.siglent_spd3303x import MODEL as SIGLENT
from hil.simulation.peers.waveshare_relay import MODEL as WAVESHARE
from hil.simulation.plants.power_feed import build as rail
from hil.simulation.plants.signal_node import SignalNode
from hil.simulation.truth import Truth
from hil.wire.exchange import find_stream

__all__ = ["BY_BYTES", "SCPI", "Kind", "Rig", "rig"]

_MOST_LISTENED_S = 1.0
_ATTEMPTS = 40
_PAUSE_S = 0.1


@dataclass
class Rig:
    """One instrument on its line, with whoever drives it and whoever has nothing but bytes.

    `sent` has what was written so far, each with the instant at which it began to leave.
    """

    kind: Kind
    driver: object
    role: object
    clock: object
    line: object
    peer: object
    plant: object
    sent: list = field(default_factory=list)

    def code(self, proof=None):
        """Return the bytes of the safe state."""
        return self.role.safe_bytes(self.kind.state, proof)

    def on(self):
        """Return what is really on."""
        return self.kind.on(self)

    def exchange(self, exchange):
        """Make one exchange: wait for silence and throw away what came, send, and look at the reply."""
        until = self.clock.now() + _MOST_LISTENED_S
        while self.line.read(4096, exchange.quiet_s) and self.clock.now() < until:
            pass
        if exchange.send:
            self.line.write(exchange.send)
        return not exchange.expect or self._shown(exchange)

    def _shown(self, exchange):
        heard, until_ns = b"", self.clock.now_ns() + round(exchange.within_s * 1e9)
        while (left_ns := until_ns - self.clock.now_ns()) > 0:
            heard += self.line.read(1, left_ns / 1e9)
            if match := re.search(exchange.expect, heard, re.DOTALL):
                low, high = exchange.between or (0, 0)
                return exchange.between is None or low <= float(match[1]) <= high
        return False

    def switch_off(self, code):
        """Bring the line into step and send the commands, whatever comes of them."""
        for exchange in (*code.resync, *code.off):
            self.exchange(exchange)

    def proven(self, code):
        """Return whether all of the proof holds at once."""
        return all(self.exchange(exchange) for exchange in code.proof)

    def make_safe(self, code):
        """Do all of it, and prove it for a while, as what turns runs out and what flows dies away."""
        self.switch_off(code)
        for _ in range(_ATTEMPTS):
            if self.proven(code):
                return True
            self.clock.sleep(_PAUSE_S)
        return False


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of instrument.

    Attributes:
        model: the peer's.
        driver: the driver's class.
        wire: the role.
        state: its safe state.
        drive: lets the driver do what it does in a case; something is on at the end.
        on: what is really on.
        proof: as a bench file would have it.
        baud: of its line.
        truth, connects, make_plant: of the peer.
        clamps: of its outputs, by channel.
    """

    model: object
    driver: type
    wire: Wire
    state: str
    drive: Callable
    on: Callable
    proof: Proof | None
    baud: int = 0
    truth: dict = field(default_factory=dict)
    connects: dict = field(default_factory=dict)
    make_plant: Callable = lambda: None
    clamps: dict = field(default_factory=dict)


@contextmanager
def rig(kind, *, faults=(), truth=None, timeout=LONGEST_REPLY_S, terminator=b""):
    """Yield a `Rig` of that kind; the port was opened at 0 s."""
    built = []

    def watched(setup):
        built.append(kind.model.build(setup))
        return built[0]

    plant = kind.make_plant()
    plants = {next(iter(kind.connects.values())).partition(".")[0]: plant} if plant else {}
    with facing(
        replace(kind.model, build=watched),
        driver=kind.driver,
        truth={**kind.truth, **(truth or {})},
        faults=faults,
        connects=kind.connects,
        plants=plants,
        baud=kind.baud,
        clamps=kind.clamps,
        terminator=terminator,
        timeout=timeout,
    ) as (driver, clock):
        line = find_stream("sim://contract/device")
        role = driver.role(kind.wire)
        found = Rig(kind, driver, role, clock, line, built[0], plant)
        if isinstance(plant, Cell):
            plant.clock = clock
        write = line.write

        def noted(data):
            found.sent.append((clock.now_ns(), bytes(data)))
            write(data)

        line.write = noted
        yield found


def _drive_supply(rig):
    rig.role.configure(4.2, 0.7)
    rig.role.enable()
    rig.role.disable()
    rig.role.enable()
    rig.role.current()


def _drive_relays(rig):
    rig.role.close("heater")
    rig.role.close("valve")
    rig.role.open("heater")
    rig.role.release_all()
    rig.role.close("lamp")


def _drive_thermal(rig):
    rig.role.hold(30.0)
    rig.role.temperature()
    rig.clock.sleep(3)
    rig.role.output()


def _drive_table(rig):
    rig.role.set_rate(10.0)
    rig.role.stop()
    rig.role.set_rate(-25.5)


def _drive_generator(rig):
    rig.role.configure("sine", 100.0, 2.0, 0.5)
    rig.role.enable()


def _drive_load(rig):
    rig.role.constant_current(1.0)
    rig.role.enable()
    rig.role.disable()
    rig.role.enable()
    rig.role.current()


def _load_on(rig):
    return {"input"} if rig.plant.observe("load.current") else set()


def _fed_rail():
    plant = rail("rail", 10**7, Truth({}, ()))
    plant.command(given=12.0, limit=5.0)
    return plant


def _drive_cycler(rig):
    rig.role.prepare(3, vmax=4.2)
    rig.role.start()
    rig.clock.sleep(21)
    rig.role.current()
    rig.clock.sleep(1)


def _outputs_on(rig):
    outputs = rig.peer.state()["channels"]
    return {number for number, output in outputs.items() if output["on"] or output["stuck_on"]}


def _korad_on(rig):
    output = rig.peer.state()["output"]
    return {"1"} if output["on"] or output["stuck_on"] else set()


def _table_on(rig):
    turning = {"turning"} if abs(rig.plant.observe("table_rate")) > 1e-3 else set()
    return turning | ({"powered"} if rig.peer.state()["axis"]["powered"] else set())


def _cycler_on(rig):
    return {name for name, closed in rig.plant.inputs.items() if closed}


def _proof(output, quantity, unit, bound):
    return Proof(output=output, quantity=quantity, unit=unit, minimum=-bound, maximum=bound)


_LOAD = {"voltage_noise": "0", "current_noise": "0", "load": "10"}
_NO_CURRENT = _proof("supply.coil", "current", "A", 0.005)


def _supply(channel):
    return Wire(role="supply", instance="coil", instrument="device", channel=channel)


def _scpi(model, driver, channel):
    return Kind(
        model=model,
        driver=driver,
        wire=_supply(channel),
        state="off",
        drive=_drive_supply,
        on=_outputs_on,
        proof=_NO_CURRENT,
        truth=_LOAD,
    )


SCPI = {
    "keysight-e36100": _scpi(E36103B, KeysightE36100, 1),
    "keysight-e36300": _scpi(KEYSIGHT, KeysightE36300, 2),
    "keysight-e3632a": _scpi(E3632A, KeysightE3632a, 1),
    "rigol-dp832": _scpi(RIGOL, RigolDp832, 1),
    "rohde-schwarz-hmp": _scpi(HMP, RohdeSchwarzHmp, 3),
    "rohde-schwarz-nge100": _scpi(NGE100, RohdeSchwarzNge100, 3),
    "siglent-spd3303x": _scpi(SIGLENT, SiglentSpd3303x, 2),
}
"""Every supply that speaks SCPI, by the name of its driver."""

BY_BYTES = {
    **SCPI,
    "korad-ka3005p": Kind(
        model=KORAD,
        driver=KoradKa3005p,
        wire=_supply(1),
        state="off",
        drive=_drive_supply,
        on=_korad_on,
        proof=_NO_CURRENT,
        baud=9600,
        truth=_LOAD,
    ),
    "waveshare-relay": Kind(
        model=WAVESHARE,
        driver=WaveshareRelay,
        wire=Wire(role="relays", instance="", instrument="device", contacts={"heater": 1, "lamp": 4, "valve": 8}),
        state="released",
        drive=_drive_relays,
        on=lambda rig: {int(n) for n, closed in rig.peer.state()["closed"].items() if closed},
        proof=None,
        baud=9600,
    ),
    "eurotherm-3216": Kind(
        model=EUROTHERM,
        driver=Eurotherm3216,
        wire=Wire(role="thermal", instance="", instrument="device"),
        state="standby",
        drive=_drive_thermal,
        on=lambda rig: {"tec"} if rig.plant.inputs["tec"] else set(),
        proof=_proof("thermal", "output", "%", 0.05),
        baud=9600,
        truth={"sensor_noise": "0"},
        connects={"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"},
        make_plant=chamber,
    ),
    "omron-e5cc": Kind(
        model=OMRON,
        driver=OmronE5cc,
        wire=Wire(role="thermal", instance="", instrument="device"),
        state="standby",
        drive=_drive_thermal,
        on=lambda rig: {"tec"} if rig.plant.inputs["tec"] else set(),
        proof=_proof("thermal", "output", "%", 0.05),
        baud=9600,
        truth={"sensor_noise": "0"},
        connects={"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"},
        make_plant=chamber,
    ),
    "keysight-33500": Kind(
        model=GENERATOR,
        driver=Keysight33500,
        wire=Wire(role="function_generator", instance="", instrument="device", channel=1),
        state="off",
        drive=_drive_generator,
        on=lambda rig: {"output"} if rig.plant.inputs["drive"] else set(),
        proof=_proof("supply.coil", "voltage", "V", 0.2),
        connects={"1": "node.drive"},
        make_plant=lambda: SignalNode("node", 10**7),
    ),
    "rigol-dl3021": Kind(
        model=LOAD,
        driver=RigolDl3021,
        wire=Wire(role="electronic_load", instance="", instrument="device"),
        state="off",
        drive=_drive_load,
        on=_load_on,
        proof=_proof("electronic_load", "current", "A", 0.005),
        truth={"voltage_noise": "0", "current_noise": "0"},
        connects={"input": "rail.load"},
        make_plant=_fed_rail,
        clamps={0: (Clamp(output="electronic_load", quantity="current", unit="A", minimum=0.0, maximum=2.0),)},
    ),
    "newport-esp301": Kind(
        model=ESP301,
        driver=NewportEsp301,
        wire=rotation.WIRE,
        state="stopped",
        drive=_drive_table,
        on=_table_on,
        proof=_proof("rotation_table", "rate", "deg/s", 0.05),
        baud=rotation.BAUD,
        connects=rotation.CONNECTS,
        make_plant=rotation.plant,
    ),
    "cycler": Kind(
        model=CYCLER,
        driver=BatteryCycler,
        wire=Wire(role="cycler", instance="", instrument="device"),
        state="stopped",
        drive=_drive_cycler,
        on=_cycler_on,
        proof=_proof("cycler", "current", "A", 0.02),
        baud=9600,
        connects={name: f"battery.{name}" for name in ("voltage", "current", "temperature", "charge", "discharge")},
        make_plant=Cell,
    ),
}
"""Every instrument with a byte stream whose role has a safe state, by the name of its driver."""
