"""The page about the battery cycler as data, and the simulated cycler to try it on."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from hil.clock.virtual import VirtualClock
from hil.model.bench import InstrumentSpec
from hil.simulation.faults import read_faults
from hil.simulation.peers.cycler.firmware import MODEL
from hil.simulation.peers.faulty import FaultySerialPeer
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.registry import fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

__all__ = ["SESSIONS", "Battery", "CyclerUnderTest", "sealed"]

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "cycler.md"
_SESSION = re.compile(r"^### (Level [12], [^\n]+)\n\n```text\n(.*?)```", re.MULTILINE | re.DOTALL)
_LINE = re.compile(r"([0-9.]+) (open|[<>=])(?: (.*))?")


def _line(text):
    seconds, kind, rest = _LINE.fullmatch(text).groups()
    return float(seconds), kind, (rest or "").replace("\\r", "\r").replace("\\n", "\n")


SESSIONS = {
    title: [_line(text) for text in body.splitlines()]
    for title, body in _SESSION.findall(PAGE.read_text(encoding="utf-8"))
}
"""Every session of the page by its title: seconds, `open`, `<`, `>` or `=`, and the bytes or readings as text."""


def sealed(text: str) -> bytes:
    """Return a line of the host with its CRC, computed bit by bit as the page tells it."""
    register = 0xFFFF
    for byte in text.encode("ascii"):
        register ^= byte << 8
        for _ in range(8):
            register = (register << 1 ^ (0x1021 if register & 0x8000 else 0)) & 0xFFFF
    return f"{text}*{register:04X}\n".encode("ascii")


@dataclass
class Battery:
    """A stand-in for the plant: it shows what it is told, and keeps what is commanded."""

    name: str = "battery"
    signals: frozenset = frozenset({"voltage", "current", "temperature"})
    inputs: dict = field(default_factory=lambda: {"charge": False, "discharge": False})
    shown: dict = field(default_factory=lambda: {"voltage": 3.6, "current": 0.0, "temperature": 25.0})
    history: list = field(default_factory=list)
    load: float = 0.0

    def observe(self, name):
        """Return a signal; with a load the current follows the relays."""
        if name == "current" and self.load:
            return self.load * (self.inputs["charge"] - self.inputs["discharge"])
        return self.shown[name]

    def observing(self, names):
        """Return a function that observes several signals; what is shown now is shown until somebody changes it."""
        return lambda times_ns: [tuple(self.observe(name) for name in names)] * len(times_ns)

    def command(self, **values):
        """Keep the inputs, and what changed."""
        for name, value in values.items():
            if self.inputs[name] != value:
                self.inputs[name] = value
                self.history.append((self.clock.now_ns(), name, value))

    def show(self, voltage, current, temperature):
        """Show these from now on."""
        self.shown = {"voltage": voltage, "current": current, "temperature": temperature}


class CyclerUnderTest:
    """A cycler with a battery, on a line without a speed; `sent` has every line and when it left."""

    def __init__(self, truth=None, faults=(), seed=1):
        self.clock = VirtualClock()
        self.battery = Battery()
        self.battery.clock = self.clock
        wrong = read_faults(faults, ("faults",), fault_kinds(MODEL))
        wiring = {name: f"battery.{name}" for name in (*self.battery.signals, *self.battery.inputs)}
        setup = PeerSetup(
            instrument=InstrumentSpec(name="cycler", driver="cycler"),
            truth=Truth(truth or {}, ("truth",)),
            connections=Connections(wiring, {"battery": self.battery}, set(), ("connects",)),
            faults=wrong,
            seeds=Seeds(seed),
        )
        self.cycler = MODEL.build(setup)
        self.peer = FaultySerialPeer(self.cycler, wrong, Seeds(seed).stream("cycler", "faults"))
        self.sent: list[tuple[int, bytes]] = []
        self.peer.attach(self, self.clock)

    def send(self, data, after_ns=0):
        """Take what the cycler sends, as its line."""
        self.sent.append((self.clock.now_ns() + after_ns, data))

    def fetch(self) -> list[str]:
        """Return the lines that were sent since the last time, without CRC and end."""
        lines = [data.decode("ascii").removesuffix("\r\n").rpartition("*") for _, data in self.sent]
        self.sent.clear()
        return [head or tail for head, _, tail in lines]

    def wait(self, seconds) -> list[str]:
        """Let time pass, and return the lines that came."""
        self.clock.sleep(seconds)
        return self.fetch()

    def ask(self, text) -> list[str]:
        """Give a line of the host, and return the lines that came at once."""
        self.peer.receive(sealed(text))
        return self.fetch()

    def opened(self) -> list[str]:
        """Open the port, and return the lines of the next two seconds."""
        self.peer.opened()
        return self.wait(2)

    def start(self, run="0007A3F2", **settings) -> list[str]:
        """Set settings, start a test, and return the lines that START caused."""
        for name, value in settings.items():
            (reply,) = self.ask(f":1 SET {name}={value}")
            assert reply == f":1 OK {name}={value}"
        return self.ask(f":2 START run={run} settings={self.cycler.settings.check()}")

    def relays(self) -> str:
        """Return which contacts are closed."""
        return "".join(name[0].upper() for name, closed in self.battery.inputs.items() if closed) or "-"
