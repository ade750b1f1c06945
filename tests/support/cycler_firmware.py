"""The real firmware of the battery cycler under simavr, as a peer on the bench's clock."""

from __future__ import annotations

import functools
import math
import os
import shutil
import struct
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import pytest

from hil.model.errors import Refused
from hil.model.notation import AnyText, Flag, NotNegative, Number, whole
from hil.simulation.peers.model import PeerModel

__all__ = ["FIRMWARE", "OUT", "FirmwarePeer", "built", "close_all", "declared_in", "living", "size_of"]

FOLDER = Path(__file__).parents[2] / "firmware"
OUT = "CYCLER_FIRMWARE_OUT"
"""Variable of the environment: where firmware and simulator are built; else a folder that goes with the process."""
_HERTZ = 16_000_000
_UART_BITS = 11
"""What simavr takes for a byte of 8 data bits and 1 stop bit."""
_AHEAD_NS = 25_000_000
"""How far the device may be ahead of the bench, a measurement; bytes of the host come at most so late."""
_FAST_BYTE = 128
_BOOT_NS = 1_600_000_000
_POWER, _EXTERNAL = 0x01, 0x02
_ROOM_K, _BETA, _ZERO_K = 298.15, 3950.0, 273.15
_SCALE = 65472
_USUAL = (0.0, 10.0, -5.0, 10.0, 0.0)
_NEVER = 2**64 - 1
_COIL_VOLTS = 9.0
"""Below, relays for 12 V let go."""
_PARTS = 10**12
_LINE_NS = 5_000_000_000
_BEFORE_NS = 770_000_000
"""What a data line tells is measured within this time before it."""


def _needs():
    """Skip where the compiler or the simulator is missing."""
    for name, package in (("avr-gcc", "gcc-avr avr-libc"), ("cc", "gcc"), ("make", "make")):
        if not shutil.which(name):
            pytest.skip(f"{name} is missing: apt-get install {package}")
    if not Path("/usr/include/simavr/sim_avr.h").exists():
        pytest.skip("simavr is missing: apt-get install libsimavr-dev libelf-dev")


@functools.cache
def _out():
    if OUT in os.environ:
        return Path(os.environ[OUT]), None
    folder = tempfile.TemporaryDirectory(prefix="hil-firmware-")
    return Path(folder.name), folder


def _make(part, out, *arguments):
    subprocess.run(["make", "-s", "-C", FOLDER / part, f"OUT={out}", *arguments], check=True, capture_output=True)
    return out


@functools.cache
def built(level=2, cycles=10):
    """Build the firmware; return its folder, with `cycler.elf` in it."""
    _needs()
    return _make("cycler", _out()[0] / f"level_{level}_{cycles}", f"LEVEL={level}", f"CYCLES={cycles}")


@functools.cache
def _simulator():
    _needs()
    return _make("simulator", _out()[0] / "simulator") / "lockstep"


def size_of(level):
    """Return what the firmware of a level takes in bytes: flash, RAM without the stack."""
    lines = subprocess.run(["avr-size", built(level) / "cycler.elf"], check=True, capture_output=True, text=True).stdout
    text, data, bss = map(int, lines.splitlines()[1].split()[:3])
    return text + data, data + bss


def _sum_of(value, offset, factor):
    return min(_SCALE, max(0, round((value - offset) / factor * _SCALE)))


def _sum_of_temperature(degrees, offset):
    kelvin = max(0.1, degrees - offset + _ZERO_K)
    exponent = _BETA * (1 / kelvin - 1 / _ROOM_K)
    return round(_SCALE / (1 + math.exp(-min(exponent, 700.0))))


class FirmwarePeer:
    """The board: its bootloader in here, its firmware in a process with simavr.

    The device runs until it sleeps, and the bench's clock wakes it when it would wake by itself, so that nothing
    happens in between. A device that is awake is up to 25 ms ahead of the bench.

    Attributes:
        watchdog_resets: instants in ns.

    Args:
        elf: the firmware.
        signals: voltage, current and temperature.
        contacts: inputs of charge and discharge relay.
        feed: voltage of the rail for their coils; None where they are fed with the device.
        boots: what the EEPROM has counted.
        serial: what it has as the serial number.
        coefficients: a0, b0, a1, b1, a2; None leaves them erased.
        real_baud: whether bytes take the time that the firmware's own settings give them; else the line has a speed.
        powered: whether it runs from the bench's epoch on; else from the first opening of its port on.
        hangs_s: when its converter stops to answer, on the bench's clock, until the watchdog resets it; 0 is never.
        drift: rate of its resonator against the bench's clock, minus 1.
        noises: for each signal a stream and the standard deviation of a data line; it changes every 5 s of the bench.
    """

    def __init__(
        self,
        elf,
        signals,
        contacts,
        *,
        feed=None,
        boots=41,
        serial="C0001",
        coefficients=None,
        real_baud=False,
        powered=False,
        drift=0.0,
        hangs_s=0.0,
        noises=(),
    ):
        image = boots.to_bytes(4, "little") + serial.encode("ascii").ljust(8, b"\0")
        image += struct.pack("<5f", *coefficients) if coefficients else 20 * b"\xff"
        self._process = subprocess.Popen(
            [_simulator(), elf, "0" if real_baud else str(_FAST_BYTE), image.hex()],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
        )
        self._coefficients = coefficients or _USUAL
        self._signals = signals
        self._contacts = contacts
        self._feed = feed
        self._closed = 0
        self._hangs_s = hangs_s
        self._powered = powered
        self._rate = round((1 + drift) * _PARTS)
        self._noises = noises or ((None, 0.0),) * len(signals)
        self._running = False
        self._base_ns = self._base_cycle = 0
        self._pending = []
        self._wake = None
        self._pins = 0
        self.watchdog_resets = []

    def attach(self, line, clock):
        """Connect line and clock; a board with power starts at once."""
        self._line, self._clock = line, clock
        if self._feed:
            self._feed.plant.listen(self._follow)
        if self._hangs_s:
            clock.at(round(self._hangs_s * 1e9), self.break_converter)
        if self._powered:
            self._boot(_POWER)

    def opened(self):
        """Be reset by DTR: relays open, and the bootloader runs."""
        self._running = False
        for event in (*self._pending, *([self._wake] if self._wake else [])):
            event.cancel()
        self._pending.clear()
        self._drive(0)
        self._wake = self._clock.at(self._clock.now_ns() + _BOOT_NS, lambda: self._boot(_EXTERNAL))

    def receive(self, data):
        """Take bytes of the host; the bootloader swallows them."""
        if self._running and data:
            self._step(data)

    def state(self):
        """Return what can be seen of it; the processor's own state stays in it, so that no checkpoint can be used."""
        return {"closed": self._closed, "watchdog_resets": self.watchdog_resets}

    def restore(self, state):
        """Refuse, since `state` does not keep it.

        Raises:
            Refused: always.
        """
        raise Refused("the state of the real firmware was not kept", hint="start a new run")

    def close(self):
        """End the simulator."""
        self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()

    def break_converter(self, *, dead=True):
        """Let conversions never end, or end again."""
        self._write(b"D" + bytes([dead]))

    def examine(self):
        """Return baud, stack bytes used so far, RAM bytes never used, and the EEPROM."""
        self._write(b"M")
        cycles, stack, left = struct.unpack("<IHH", self._read(8))
        return _HERTZ * _UART_BITS / cycles, stack, left, self._read(32)

    def _boot(self, flags):
        self._write(b"B" + bytes([flags]))
        self._base_cycle = self._answer()[0]
        self._base_ns = self._clock.now_ns()
        self._running = True
        self._step()

    def _cycle(self, when_ns):
        return self._base_cycle + (when_ns - self._base_ns) * 2 * self._rate // (125 * _PARTS)

    def _instant(self, cycle):
        return self._base_ns + -(-(cycle - self._base_cycle) * 125 * _PARTS // (2 * self._rate))

    def _sums(self):
        voltage, current, temperature = map(self._shown, self._signals, self._noises)
        a0, b0, a1, b1, a2 = self._coefficients
        return _sum_of(voltage, a0, b0), _sum_of(current, a1, b1), _sum_of_temperature(temperature, a2)

    def _shown(self, signal, noise):
        stream, deviation = noise
        value = signal.plant.observe(signal.name)
        return value + deviation * stream.normal((self._clock.now_ns() + _BEFORE_NS) // _LINE_NS) if stream else value

    def _step(self, data=b""):
        now_ns = self._clock.now_ns()
        times = self._cycle(now_ns), self._cycle(now_ns + _AHEAD_NS)
        self._write(struct.pack("<cQQ3HH", b"R", *times, *self._sums(), len(data)) + data)
        _, wakes, events = self._answer()
        for kind, cycle, payload in events:
            self._happened(kind, self._instant(cycle), payload, now_ns)
        if self._wake:
            self._wake.cancel()
        self._wake = None if wakes == _NEVER else self._clock.at(max(self._instant(wakes), now_ns + 1), self._step)

    def _happened(self, kind, when_ns, payload, now_ns):
        if kind == "T":
            self._line.send(payload, max(0, when_ns - now_ns))
        elif kind == "W":
            self.watchdog_resets.append(when_ns)
            if self._hangs_s:
                self.break_converter(dead=False)
        elif when_ns <= now_ns:
            self._drive(payload[0])
        else:
            self._pending = [event for event in self._pending if not event.cancelled][-8:]
            self._pending.append(self._clock.at(when_ns, lambda: self._drive(payload[0])))

    def _drive(self, pins):
        self._pins = pins
        self._follow()

    def _follow(self):
        closed = self._pins if not self._feed or self._feed.observe() >= _COIL_VOLTS else 0
        changed, self._closed = closed ^ self._closed, closed
        for bit, contact in enumerate(self._contacts):
            if changed >> bit & 1:
                contact.command(bool(closed >> bit & 1))

    def _write(self, data):
        os.write(self._process.stdin.fileno(), data)

    def _read(self, size):
        data = b""
        while len(data) < size:
            data += os.read(self._process.stdout.fileno(), size - len(data)) or self._gone()
        return data

    def _gone(self):
        raise RuntimeError(f"the simulator ended with {self._process.wait(10)}")

    def _answer(self):
        cycle, wakes, size = struct.unpack("<QQH", self._read(18))
        data, events, place = self._read(size), [], 0
        while place < size:
            kind, when, length = struct.unpack_from("<cQB", data, place)
            events.append((kind.decode("ascii"), when, data[place + 10 : place + 10 + length]))
            place += 10 + length
        return cycle, wakes, events


_LIVING = []
_SIGNALS = ("voltage", "current", "temperature")


@dataclass(frozen=True, kw_only=True)
class FirmwareTruth:
    """What a bench file says of the device."""

    level: Annotated[int, whole(1, 2)] = 2
    cycles: Annotated[int, whole(1)] = 10
    boots: Annotated[int, whole(0)] = 41
    serial: AnyText = "C0001"
    real_baud: Flag = False
    powered: Flag = False
    clock_drift: Number = 0.0
    converter_hangs: NotNegative = 0.0
    voltage_noise: NotNegative = 0.0
    current_noise: NotNegative = 0.0
    temperature_noise: NotNegative = 0.0


def _build(setup):
    truth = setup.truth.part(FirmwareTruth)
    choices = {name: getattr(truth, name) for name in ("boots", "serial", "real_baud", "powered")}
    choices |= {"drift": truth.clock_drift, "hangs_s": truth.converter_hangs}
    choices["noises"] = [(setup.stream(name), getattr(truth, f"{name}_noise")) for name in _SIGNALS]
    signals = [setup.connections.signal(name) for name in _SIGNALS]
    contacts = [setup.connections.input(name) for name in ("charge", "discharge")]
    choices["feed"] = setup.connections.signal("power")
    setup.finish()
    peer = FirmwarePeer(built(truth.level, truth.cycles) / "cycler.elf", signals, contacts, **choices)
    _LIVING.append(peer)
    return peer


def living():
    """Return the firmware that was built last as a model."""
    return _LIVING[-1]


def close_all():
    """End every simulator that was built as a model."""
    while _LIVING:
        _LIVING.pop().close()


FIRMWARE = PeerModel(link="serial", fault_kinds=(), build=_build)
"""The firmware in the place of the simulated cycler's model; its five terminals must be connected."""


def declared_in(folder):
    """Declare the firmware as the peer `cycler-firmware`, as an installed package would, and build it.

    Args:
        folder: where the declaration is put.

    Returns:
        The variables of the environment with which a process finds it.
    """
    package = folder / "cycler_firmware-1.0.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: cycler-firmware\nVersion: 1.0\n", encoding="utf-8")
    (package / "entry_points.txt").write_text(
        "[hil.peers]\ncycler-firmware = cycler_firmware:FIRMWARE\n", encoding="utf-8"
    )
    built()
    _simulator()
    places = [str(folder), str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    return {OUT: str(_out()[0]), "PYTHONPATH": os.pathsep.join(filter(None, places))}
