"""A Keysight E36312A power supply as its remote interface shows it: three outputs, SCPI lines.

Facts: three isolated outputs (6 V 5 A, 25 V 1 A, 25 V 1 A), lines that end with a line feed, executed one after the
other and answered in order.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Identity
from hil.simulation.peers.alarm import Alarm
from hil.simulation.peers.keysight_commands import CommandSet
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.supply_output import NotANumber, OutputTruth, Rating, RefuseOff, SupplyOutput, read_outputs
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "KeysightE36312a", "build"]

_RATINGS = {1: Rating(6.0, 5.0), 2: Rating(25.0, 1.0), 3: Rating(25.0, 1.0)}
_LONGEST_LINE = 1024
_MOST_LINES = 256
_WATCH_NS = 10_000_000


class KeysightE36312a:
    """The supply: lines end with a line feed, are executed one after the other, and answer in order.

    Args:
        commands: what the instrument knows.
        outputs: the three outputs by number.
        command_ns: how long a line takes.
        measure_ns: how long a line with a measurement takes.
    """

    def __init__(
        self, commands: CommandSet, outputs: Mapping[int, SupplyOutput], *, command_ns: int, measure_ns: int
    ) -> None:
        self._commands = commands
        self._outputs = outputs
        self._command_ns = command_ns
        self._measure_ns = measure_ns
        self._inbox = b""
        self._lines: list[str] = []
        self._line: Line
        self._clock: PeerClock
        self._due: Alarm
        self._watching: Alarm

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; every output starts off."""
        self._line = line
        self._clock = clock
        self._due, self._watching = Alarm(clock, self._work), Alarm(clock, self._protect)
        for output in self._outputs.values():
            output.apply()

    def receive(self, data: bytes) -> None:
        """Collect bytes into lines."""
        *lines, self._inbox = (self._inbox + data).split(b"\n")
        if len(self._inbox) > _LONGEST_LINE:
            self._inbox = b""
            self._commands.errors.push(-363)
        for line in lines:
            if len(self._lines) == _MOST_LINES:  # what nobody waits for an answer to does not pile up for ever
                self._commands.errors.push(-363)
                break
            self._lines.append(line.decode("latin-1").strip())
            if len(self._lines) == 1:
                self._begin()

    def state(self) -> Mapping[str, object]:
        """Return settings, error queue and what is still to be executed."""
        return {
            "outputs": {str(number): output.state() for number, output in self._outputs.items()},
            "commands": dict(self._commands.state()),
            "inbox": self._inbox.hex(),
            "lines": list(self._lines),
            "due": self._due.state(),
            "watching": self._watching.state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        for number, values in cast("dict[str, dict[str, object]]", state["outputs"]).items():
            self._outputs[int(number)].restore(values)
        self._commands.restore(cast("dict[str, object]", state["commands"]))
        self._inbox = bytes.fromhex(cast("str", state["inbox"]))
        self._lines = list(cast("list[str]", state["lines"]))
        self._due.restore(state["due"])
        self._watching.restore(state["watching"])

    def _begin(self) -> None:
        takes_ns = self._measure_ns if "MEAS" in self._lines[0].upper() else self._command_ns
        self._due.set(self._clock.now_ns() + takes_ns)

    def _work(self) -> None:
        reply = self._commands.execute(self._lines.pop(0), self._clock.now_ns())
        if reply:
            self._line.send(f"{reply}\n".encode("latin-1", "replace"))
        self._protect()
        if self._lines:
            self._begin()

    def _protect(self) -> None:
        for output in self._outputs.values():
            output.protect(self._clock.now_ns())
        if self._watching.due_ns is None and any(output.watched for output in self._outputs.values()):
            self._watching.set((self._clock.now_ns() // _WATCH_NS + 1) * _WATCH_NS)


def build(setup: PeerSetup) -> KeysightE36312a:
    """Build the supply; terminals `1`, `2`, `3` go to supply ports of plants.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    serial, firmware = truth.text("serial", "MY00000001"), truth.text("firmware", "2.1.0-1.0.4-1.12")
    times = [truth.number(key, usual_s, minimum=0) for key, usual_s in (("command_time", 2e-3), ("measure_time", 1e-2))]
    outputs = read_outputs(setup, _RATINGS, OutputTruth(), SupplyOutput)
    setup.finish()
    identity = f"Keysight Technologies,E36312A,{serial},{firmware}"
    command_ns, measure_ns = (round(seconds * NANOSECONDS) for seconds in times)
    commands = CommandSet(identity, outputs, setup.faults)
    return KeysightE36312a(commands, outputs, command_ns=command_ns, measure_ns=measure_ns)


MODEL = PeerModel(link="serial", fault_kinds=(Identity, NotANumber, RefuseOff), build=build)
"""The model behind the driver `keysight-e36300`."""
