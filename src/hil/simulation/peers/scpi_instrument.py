"""Simulated SCPI instrument on its line: command lines in, answers out, and protections that trip meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict

from hil.clock.port import NANOSECONDS
from hil.simulation.peers.manner import Manner
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.scpi_commands import Commands
from hil.simulation.peers.scpi_manual import Channel, Manual
from hil.simulation.peers.timing import Alarm
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["ScpiInstrument", "instrument_of"]

_LONGEST_LINE = 1024
_MOST_LINES = 256
_WATCH_NS = 10_000_000


class ScpiInstrument(Stateful):
    """The instrument: lines end with a line feed, are executed one after the other, and are answered in order.

    Args:
        manual: what its programming guide says.
        commands: what it executes.
        channels: what its headers concern, by number.
        times_ns: those of its truth.
        manner: how its firmware writes lines.
    """

    _commands: Kept[Commands]
    _channels: Kept[dict[int, Channel]]
    _inbox: Kept[bytes]
    _lines: Kept[list[str]]
    _ready_ns: Kept[int]
    _due: Kept[Alarm]
    _watching: Kept[Alarm]

    def __init__(
        self,
        manual: Manual,
        commands: Commands,
        channels: dict[int, Channel],
        times_ns: Mapping[str, int],
        manner: Manner,
    ) -> None:
        self._manual = manual
        self._manner = manner
        self._end = manner.end
        self._commands = commands
        self._channels = channels
        self._command_ns = times_ns["command_time"]
        self._measure_ns = times_ns.get("measure_time", self._command_ns)
        self._pause_ns = times_ns.get("pause_time")
        self._slow = [channel for channel in channels.values() if type(channel).takes_ns is not Channel.takes_ns]
        self._inbox = b""
        self._lines = []
        self._ready_ns = 0
        self._line: Line
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line; every channel starts as after power-on."""
        self._line = line
        self._clock = clock
        self._due, self._watching = Alarm(clock, self._work), Alarm(clock, self._protect)
        for channel in self._channels.values():
            channel.attach(clock)
            channel.apply()
            if self._manual.watches:
                channel.listen(self._look)

    def opened(self) -> None:
        """Send the firmware's banner, if any, when the port is opened."""
        if self._manner.banner:
            self._line.send(f"{self._manner.banner}{self._end}".encode("latin-1", "replace"))

    def receive(self, data: bytes) -> None:
        """Collect bytes into lines; a line that arrives before a required pause is lost."""
        if self._end == "\r":
            data = data.replace(b"\r", b"\n")
        *lines, self._inbox = (self._inbox + data).split(b"\n")
        if len(self._inbox) > _LONGEST_LINE:
            self._inbox = b""
            self._commands.errors.push(-363)
        for line in lines:
            text = line.decode("latin-1").strip()
            if self._pause_ns is not None and (not text or self._lines or self._clock.now_ns() < self._ready_ns):
                continue
            if len(self._lines) == _MOST_LINES:  # bounds the backlog of lines without a waiting reader
                self._commands.errors.push(-363)
                break
            self._lines.append(text)
            if len(self._lines) == 1:
                self._begin()

    def _begin(self) -> None:
        line, now_ns = self._lines[0].upper(), self._clock.now_ns()
        takes_ns = self._measure_ns if "MEAS" in line else self._command_ns
        for channel in self._slow:
            takes_ns += channel.takes_ns(line, now_ns)
        self._due.set(now_ns + takes_ns)

    def _work(self) -> None:
        now_ns = self._clock.now_ns()
        line = self._lines.pop(0)
        reply = self._commands.execute(line, now_ns)
        self._ready_ns = now_ns + (self._pause_ns or 0)
        if self._manner.echo:
            self._line.send(f"{line}{self._end}".encode("latin-1", "replace"))
        if reply:
            self._line.send(reply + self._end.encode("ascii"))
        self._protect()
        if self._lines:
            self._begin()

    def _look(self) -> None:
        """Check whether an external change, such as a closed contact, put a channel above its protection level."""
        if any(channel.lifted for channel in self._channels.values()):
            self._watching.set(self._clock.now_ns())

    def _protect(self) -> None:
        """Trip due protections; a channel above a protection level is polled every 10 ms."""
        now_ns = self._clock.now_ns()
        for channel in self._channels.values():
            channel.protect(now_ns)
        if self._watching.due_ns is None and any(channel.watched for channel in self._channels.values()):
            self._watching.set((now_ns // _WATCH_NS + 1) * _WATCH_NS)


def instrument_of(
    manual: Manual, channels: Callable[[PeerSetup, Mapping[str, object]], dict[int, Channel]]
) -> PeerModel:
    """Return the model of a manual.

    Args:
        manual: what the programming guide says.
        channels: makes what its headers concern, by number, from the setup and what the truth says of the device.
    """

    def build(setup: PeerSetup) -> ScpiInstrument:
        truth = setup.truth
        article = asdict(truth.part(manual.truth))
        article["serial"] = f"SIM-{article['serial']}"
        manner = truth.part(manual.manner)
        made = channels(setup, article)
        setup.finish()
        commands = Commands(manual, manual.identity.format(**article), made, setup.faults, manner)
        times_ns = {key: round(each * NANOSECONDS) for key, each in article.items() if key.endswith("_time")}
        return ScpiInstrument(manual, commands, made, times_ns, manner)

    return PeerModel(link="serial", fault_kinds=manual.faults, build=build)
