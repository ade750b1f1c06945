"""A Newport ESP301 as its serial line shows it: command lines in, answers of one line each out.

Facts, from the user's manuals of ESP300 and ESP301: lines end with a carriage return, answers with carriage return and
line feed; a command is an axis number, two letters and a parameter, blanks do not count, several stand in a line
between semicolons, 80 characters at most; errors are kept ten deep, those of axis n are n * 100 and more; `TB?` gives
code, time in ticks of 0.4 ms, and text.

Assumed: a line feed after the carriage return is ignored; each question of a line is answered in a line of its own;
`TB?` without an error gives the present time; a full error buffer loses its oldest entry; an axis without a stage
answers `MO?` with 0 and `MD?` with 1; a velocity takes effect in a motion at once; software limits are kept and not
watched; `TV?` gives what the controller commands.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hil.clock.port import NANOSECONDS
from hil.model.notation import AnyText, NotNegative, whole
from hil.simulation.faults import Identity
from hil.simulation.peers.esp301.axis import Axis, Drive, NoStop, Slipping, StageTruth, Stalled
from hil.simulation.peers.esp301.commands import CommandSet
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.timing import Alarm, Alarms
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "ControllerTruth", "Esp301", "build"]

_LONGEST_INBOX = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerTruth:
    """One controller: its name, its version, its axes, and how long a command takes [s]."""

    controller: AnyText = "ESP301"
    firmware: AnyText = "3.0.1 6/1/99"
    axes: Annotated[int, whole(1, 3)] = 3
    command_time: NotNegative = 1e-3


class Esp301(Stateful):
    """The controller.

    Args:
        commands: what it knows.
        axis: its first axis.
        command_ns: how long a line takes.
    """

    _axis: Kept[Axis]
    _commands: Kept[CommandSet]
    _inbox: Kept[bytes]
    _lines: Kept[list[str]]
    _due: Kept[Alarm]
    _changes: Kept[Alarms]

    def __init__(self, commands: CommandSet, axis: Axis, command_ns: int) -> None:
        self._commands = commands
        self._axis = axis
        self._command_ns = command_ns
        self._inbox = b""
        self._lines = []
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; the motor starts off."""
        self._line = line
        self._clock = clock
        self._due = Alarm(clock, self._work)
        self._changes = Alarms(
            clock, [(at_ns, lambda: self._axis.apply(clock.now_ns())) for at_ns in self._axis.changes_ns()]
        )
        self._axis.apply(clock.now_ns())

    def receive(self, data: bytes) -> None:
        """Collect bytes into lines."""
        *lines, self._inbox = (self._inbox + data.replace(b"\n", b"")).split(b"\r")
        self._inbox = self._inbox[-_LONGEST_INBOX:]
        for line in lines:
            self._lines.append(line.decode("latin-1"))
            if len(self._lines) == 1:
                self._begin()

    def _begin(self) -> None:
        self._due.set(self._clock.now_ns() + self._command_ns)

    def _work(self) -> None:
        for answer in self._commands.execute(self._lines.pop(0), self._clock.now_ns()):
            self._line.send(f"{answer}\r\n".encode("latin-1", "replace"))
        if self._lines:
            self._begin()


def build(setup: PeerSetup) -> Esp301:
    """Build the controller; its first axis drives the terminals `rate`, `acceleration` and `grip`, and sees `angle`.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth, connections = setup.truth, setup.connections
    stage, own = truth.part(StageTruth), truth.part(ControllerTruth)
    drive = Drive(
        rate=connections.input("rate"),
        acceleration=connections.input("acceleration"),
        grip=connections.input("grip"),
        angle=connections.signal("angle"),
    )
    if drive.grip is None and any(setup.faults.of(kind) for kind in (Slipping, Stalled)):
        truth.wrong("connects", "slipping and stalled need the terminal 'grip'")
    setup.finish()
    axis = Axis(1, stage, drive, setup.faults)
    commands = CommandSet(f"{own.controller} Version {own.firmware}", axis, own.axes, setup.faults)
    return Esp301(commands, axis, round(own.command_time * NANOSECONDS))


MODEL = PeerModel(link="serial", fault_kinds=(Identity, NoStop, Slipping, Stalled), build=build)
"""The model for the driver `newport-esp301`."""
