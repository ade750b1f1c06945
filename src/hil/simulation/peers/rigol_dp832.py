"""A Rigol DP832 power supply as its remote interface shows it: three outputs, SCPI lines, and no hurry.

Facts: two outputs of 30 V 3 A and one of 5 V 3 A, lines that end with a line feed. Programs leave about ten
milliseconds between lines; assumed here: a line that comes earlier is lost without a word.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Identity
from hil.simulation.peers.alarm import Alarm
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.rigol_channel import RigolOutput, RigolRating
from hil.simulation.peers.rigol_commands import RigolCommands
from hil.simulation.peers.supply_output import OutputTruth, RefuseOff, read_outputs
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "RigolDp832", "build"]

_THIRTY = RigolRating(30.0, 3.0, 32.0, 3.2, 33.0, 3.3)
_FIVE = RigolRating(5.0, 3.0, 5.3, 3.2, 5.5, 3.3)
_RATINGS = {1: _THIRTY, 2: _THIRTY, 3: _FIVE}
_RESOLUTION = OutputTruth(voltage_resolution=0.01, current_resolution=0.001)
_LONGEST_LINE = 1024
_WATCH_NS = 10_000_000


class RigolDp832:
    """The supply: takes one line, works on it, answers, and needs a pause before the next.

    Args:
        commands: what the instrument knows.
        outputs: the three outputs by number.
        command_ns: how long a line takes.
        pause_ns: how long after a line's end the next one would be lost.
    """

    def __init__(
        self, commands: RigolCommands, outputs: Mapping[int, RigolOutput], *, command_ns: int, pause_ns: int
    ) -> None:
        self._commands = commands
        self._outputs = outputs
        self._command_ns = command_ns
        self._pause_ns = pause_ns
        self._inbox = b""
        self._working = ""
        self._ready_ns = 0
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
            output.listen(self._look)

    def receive(self, data: bytes) -> None:
        """Collect bytes into lines; one that comes too early is lost."""
        *lines, self._inbox = (self._inbox + data).split(b"\n")
        self._inbox = self._inbox[-_LONGEST_LINE:]
        for line in lines:
            text = line.decode("latin-1").strip()
            now_ns = self._clock.now_ns()
            if text and not self._working and now_ns >= self._ready_ns:
                self._working = text
                self._due.set(now_ns + self._command_ns)

    def state(self) -> Mapping[str, object]:
        """Return settings, error queue and what is being worked on."""
        return {
            "outputs": {str(number): output.state() for number, output in self._outputs.items()},
            "commands": dict(self._commands.state()),
            "inbox": self._inbox.hex(),
            "working": self._working,
            "due": self._due.state(),
            "ready_ns": self._ready_ns,
            "watching": self._watching.state(),
        }

    def restore(self, state: Mapping[str, object]) -> None:
        """Go on from what `state` returned."""
        for number, values in cast("dict[str, dict[str, object]]", state["outputs"]).items():
            self._outputs[int(number)].restore(values)
        self._commands.restore(cast("dict[str, object]", state["commands"]))
        self._inbox = bytes.fromhex(cast("str", state["inbox"]))
        self._working = cast("str", state["working"])
        self._ready_ns = cast("int", state["ready_ns"])
        self._due.restore(state["due"])
        self._watching.restore(state["watching"])

    def _work(self) -> None:
        now_ns = self._clock.now_ns()
        reply = self._commands.execute(self._working, now_ns)
        self._working, self._ready_ns = "", now_ns + self._pause_ns
        if reply:
            self._line.send(f"{reply}\n".encode("latin-1", "replace"))
        self._protect()

    def _look(self) -> None:
        """Look whether a contact that closed, or the like, brought an output above its protection."""
        if any(output.lifted for output in self._outputs.values()):
            self._watching.set(self._clock.now_ns())

    def _protect(self) -> None:
        """Trip what is due; an output that gives more than a protection allows is looked at every 10 ms."""
        now_ns = self._clock.now_ns()
        for output in self._outputs.values():
            output.protect(now_ns)
        if self._watching.due_ns is None and any(output.watched for output in self._outputs.values()):
            self._watching.set((now_ns // _WATCH_NS + 1) * _WATCH_NS)


def build(setup: PeerSetup) -> RigolDp832:
    """Build the supply; terminals `1`, `2`, `3` go to supply ports of plants.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    serial, firmware = truth.text("serial", "DP8C000000001"), truth.text("firmware", "00.01.16")
    times = [truth.number(key, usual_s, minimum=0) for key, usual_s in (("command_time", 5e-3), ("pause_time", 1e-2))]
    outputs = read_outputs(setup, _RATINGS, _RESOLUTION, RigolOutput)
    setup.finish()
    commands = RigolCommands(f"RIGOL TECHNOLOGIES,DP832,{serial},{firmware}", outputs, setup.faults)
    command_ns, pause_ns = (round(seconds * NANOSECONDS) for seconds in times)
    return RigolDp832(commands, outputs, command_ns=command_ns, pause_ns=pause_ns)


MODEL = PeerModel(link="serial", fault_kinds=(Identity, RefuseOff), build=build)
"""The model behind the driver `rigol-dp832`."""
