"""The simulated cycler as a peer: reset and bootloader, lines every five seconds, heartbeat, and how it is built."""

from __future__ import annotations

from dataclasses import dataclass

from hil.clock.port import NANOSECONDS
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.cycler.commands import Commands
from hil.simulation.peers.cycler.lines import Command, LineReader, LostLines, Output, TornLines
from hil.simulation.peers.cycler.make import LINE_S, CyclerTruth, Gauge, Make, Reading, Spike
from hil.simulation.peers.cycler.relays import CHARGE, DISCHARGE, Relays, StuckRelay
from hil.simulation.peers.cycler.sequence import RUNNING, Sequence, Settings
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.timing import Alarm, Alarms, BoardClock
from hil.simulation.plants.terminal import Power
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import Line, PeerClock

__all__ = ["MODEL", "Firmware", "Reset", "build"]

_US = 1_000_000
_LINE_US = LINE_S * _US
_MOST_AHEAD = 64
_CODES = {"CHARGE": b"C", "DISCHARGE": b"D", "REST": b"R"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reset(Fault):
    """A dip of its supply resets the device."""

    name = "reset"


class Firmware(Stateful):
    """The device. It has power from the epoch on, and its banner is long gone by then.

    Args:
        make: what it is.
        relays: its relays.
        output: what it says.
        device_clock: its time.
        faults: what goes wrong; a `reset` is a dip of its supply.
    """

    boots: Kept[int]
    reset_reason: Kept[str]
    _next_us: Kept[int]
    _beaten_us: Kept[int]
    settings: Kept[Settings]
    sequence: Kept[Sequence]
    relays: Kept[Relays]
    output: Kept[Output]
    _reader: Kept[LineReader]
    _device_clock: Kept[BoardClock]
    _boot: Kept[Alarm]
    _tick: Kept[Alarm]
    _silence: Kept[Alarm]
    _dips: Kept[Alarms]

    def __init__(self, make: Make, relays: Relays, output: Output, device_clock: BoardClock, faults: Faults) -> None:
        self.make = make
        self._measure = make.measuring()
        self.relays = relays
        self.output = output
        self.boots = make.truth.boots
        self.reset_reason = "POWER"
        truth = make.truth
        ends = {"iend": round(truth.charge_end * 1000), "vend": round(truth.discharge_end * 1000)}
        self.settings = Settings({"cycles": truth.cycles, **ends})
        self.sequence = Sequence(extended=make.extended, settings=self.settings, relays=relays)
        self._commands = Commands(self)
        self._reader = LineReader()
        self._device_clock = device_clock
        self._faults = faults
        self._marks: list[str] = []
        self._next_us = _LINE_US
        self._beaten_us = 0
        self._clock: PeerClock

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect the line, and start what comes unasked."""
        self._clock = clock
        self.output.attach(line, clock)
        self.relays.attach(clock)
        self._boot = Alarm(clock, self._booted)
        self._tick = Alarm(clock, self._lines)
        self._silence = Alarm(clock, self._silent)
        dips = self._faults.of(Reset)
        self._dips = Alarms(clock, [(fault.start_ns, lambda: self._reset("BROWNOUT")) for fault in dips])
        self._wait()

    def opened(self) -> None:
        """Be reset by the DTR line of a port that is opened, unless that is prevented."""
        if self.make.truth.reset_on_open:
            self._reset("EXTERNAL")

    def receive(self, data: bytes) -> None:
        """Take bytes of the host; the bootloader swallows them."""
        if self._boot.due_ns is not None or not data:
            return
        if not self.make.extended:
            if self.sequence.phase == "IDLE":
                self.start("-")
                self._tell()
            return
        for command in self._reader.take(data):
            if command is None:
                self.output.numbered("ERROR FRAME")
            else:
                self._execute(command)

    def measure(self) -> Reading:
        """Return what is measured now."""
        return self._measure([self._clock.now_ns()])[0]

    def start(self, run: str) -> None:
        """Begin a test; its first mark follows the reply."""
        self._marks.append(self.sequence.start(run))
        self._next_us = self._now_us() + _LINE_US
        self._tick.set(self._device_clock.instant(self._next_us))
        self.beat()
        if self.make.extended:
            self._listen()

    def stop(self) -> None:
        """Open the relays, and end a test; the mark follows the reply."""
        self.relays.open()
        if self.sequence.phase in RUNNING:
            self.sequence.stop()
            self._marks.append("TEST STOPPED")
            self._wait()

    def beat(self) -> None:
        """Take a heartbeat."""
        self._beaten_us = self._now_us()

    def _now_us(self) -> int:
        return self._device_clock.at(self._clock.now_ns())

    def _reset(self, reason: str) -> None:
        for alarm in (self._tick, self._silence):
            alarm.clear()
        self.relays.open()
        self.sequence.reset()
        self.settings.reset()
        self._reader.clear()
        self.boots += 1
        self.reset_reason = reason
        self._boot.set(self._clock.now_ns() + round(self.make.truth.boot_time * NANOSECONDS))

    def _booted(self) -> None:
        self._device_clock.reset(self._clock.now_ns())
        self.output.number = 0
        truth = self.make.truth
        self.output.numbered(
            "START ARDUINO", f";2.0;hil-cycler;{truth.marked_firmware};{truth.serial};{self.boots};{self.reset_reason}"
        )
        self._wait()

    def _execute(self, command: Command) -> None:
        self.output.reply(self._commands.execute(command))
        self._tell()

    def _tell(self) -> None:
        for mark in self._marks:
            self.output.numbered(mark)
        self._marks.clear()

    def _lines(self) -> None:
        """Tell the line that is due, and those that follow it before anything else happens."""
        state = self.sequence.phase
        if state not in RUNNING:
            self.output.numbered(f"{state} {self.sequence.reason}".rstrip())
            self._wait()
            return
        times_ns = self._times()
        readings = self._measure(times_ns)
        energies = self.sequence.take(readings)
        if energies:
            self._tell_data(readings, energies, times_ns, state)
        else:
            self._judge(readings[0], times_ns, state)

    def _times(self) -> list[int]:
        """Return the bench's time of the line that is due now, and of those after it while nothing else happens."""
        times_ns = [self._clock.now_ns()]
        if self._faults.faults:  # they look at the clock for every line
            return times_ns
        most = _MOST_AHEAD - 1
        return times_ns + self._device_clock.instants(self._next_us, _LINE_US, self._clock.calm_until_ns(), most)

    def _tell_data(self, readings: list[Reading], energies: list[int], times_ns: list[int], state: str) -> None:
        """Send data lines, each at its time, and let the next one come."""
        at_us, now_ns = self._next_us, times_ns[0]
        self._next_us = next_us = at_us + len(energies) * _LINE_US
        lines = zip(
            readings,
            energies,
            range(at_us, next_us, _LINE_US),
            [time_ns - now_ns for time_ns in times_ns],
            strict=False,
        )
        self.output.data(lines, _CODES[state])
        self._tick.set(self._device_clock.instant(next_us))

    def _judge(self, reading: Reading, times_ns: list[int], state: str) -> None:
        """Send a data line, and do what follows from it."""
        energy = self.sequence.add(reading)
        marks = self.sequence.judge(reading)
        self._tell_data([reading], [energy], times_ns, state)
        self._marks += marks
        if marks:
            self._tell()
            if self.sequence.phase not in RUNNING:
                self._wait()

    def _wait(self) -> None:
        """Let no test run: tell the state at every five seconds of device time, in level 2."""
        self._tick.clear()
        self._silence.clear()
        if self.make.extended:
            self._tick.set(self._device_clock.instant((self._now_us() // _LINE_US + 1) * _LINE_US))

    def _listen(self) -> None:
        """Look again when the last heartbeat is too old; heartbeats themselves only leave their time."""
        due_us = self._beaten_us + self.settings.values["beat"] * _US
        self._silence.set(self._device_clock.instant(due_us))

    def _silent(self) -> None:
        if self._now_us() < self._beaten_us + self.settings.values["beat"] * _US:
            self._listen()
            return
        self._marks.append(self.sequence.trip("HEARTBEAT"))
        self._tell()
        self._wait()


def build(setup: PeerSetup) -> Firmware:
    """Build the cycler.

    Terminals `voltage` [V], `current` [A, positive into the battery] and `temperature` [degC] go to signals, `charge`
    and `discharge` to inputs that are true where the relay is closed; `power` [V] to the signal of the rail that feeds
    the coils, where they are not fed with the device.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth.part(CyclerTruth)
    make = Make(
        truth=truth,
        voltage=_gauge(setup, truth, "voltage", 0.0, 1000),
        current=_gauge(setup, truth, "current", 0.0, 1000),
        temperature=_gauge(setup, truth, "temperature", 25.0, 10),
        spikes=setup.faults.of(Spike),
    )
    contacts = {relay: setup.connections.input(relay) for relay in (CHARGE, DISCHARGE)}
    power = Power(setup.connections.signal("power"))
    setup.finish()
    device_clock = BoardClock(truth.clock_drift, 0)
    relays = Relays({relay: point for relay, point in contacts.items() if point is not None}, setup.faults, power)
    output = Output(
        extended=make.extended, device_clock=device_clock, faults=setup.faults, chance=setup.stream("torn lines")
    )
    return Firmware(make, relays, output, device_clock, setup.faults)


def _gauge(setup: PeerSetup, truth: CyclerTruth, name: str, unconnected: float, scale: int) -> Gauge:
    gain, offset, noise = (getattr(truth, f"{name}_{each}") for each in ("gain", "offset", "noise"))
    return Gauge(
        signal=setup.connections.signal(name),
        unconnected=unconnected,
        factor=scale * gain,
        shift=scale * offset,
        noise=scale * noise,
        stream=setup.stream(name),
    )


MODEL = PeerModel(link="serial", fault_kinds=(LostLines, Reset, Spike, StuckRelay, TornLines), build=build)
"""The model of the battery test apparatus."""
