"""Driver of a battery cycler: prepare, start, follow and stop its test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hil.instruments import settings
from hil.instruments.cycler.hearing import MOST_BYTES
from hil.instruments.cycler.lines import BANNER, LINE_S, Reading, Told, seal
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.preparing import SILENT_S, Attendance, Preparing
from hil.instruments.cycler.session import CyclerSession, Status
from hil.instruments.cycler.settings import Wiring
from hil.instruments.cycler.stream import CHANNELS, CyclerStream
from hil.instruments.driver import Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.roles import CYCLER
from hil.instruments.safing import NUMBER, must_be_state, own_bounds
from hil.instruments.sampled import Channel, StreamReport
from hil.model.bench import Proof, Wire
from hil.model.errors import NoReply, Refused
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.safing import Exchange, SafeBytes

__all__ = ["BatteryCycler", "BatteryTester", "stopped"]

_OVER = rb"(?:IDLE|ENDED|STOPPED|TRIPPED)"
_SEAL = rb"\*[0-9A-F]{4}\r\n"
_FIELDS = {"voltage": b"v", "current": b"i", "temperature": b"t"}
_RATE_HZ = 1 / LINE_S
_FRESH_S = 1.5 * LINE_S
_JUST_READ_S = 0.5
_LONGEST_LINE = 64
_FILLED_S = MOST_BYTES / _LONGEST_LINE * LINE_S
_TURNS_PER_BEAT = 6  # due after a third of the timeout, sent in the next turn, its loss noticed in the one after


def stopped(name: str, proof: Proof | None, within_s: float) -> SafeBytes:
    """Return the bytes that open both relays and end a test, and query state, relays and measurements.

    Tag 0 is for a sender that does not know the dialogue so far. A killed program may have left a START without its
    line end, and a line feed would then start charging a battery. So a query with no line feed before it is sent first:
    appended to half a line, it makes the checksum of the whole wrong, and the device discards both.

    The device also sends unsolicited lines, so waiting for silence is not possible: overdue replies are waited for from
    the last query on. Replies carry tags, but these bytes are the same each time, so no tag tells two attempts apart.

    Args:
        name: name of the role instance.
        proof: the bench file's proof; voltage, current and temperature of this cycler can be queried.
        within_s: reply timeout [s].
    """
    question, command = seal(":0 STATE"), seal(":0 STOP")
    fields = dict.fromkeys((b"v", b"i", b"e", b"t"), rb"\S+")
    between = None
    for quantity, field in _FIELDS.items():
        if bounds := own_bounds(name, proof, quantity):
            fields[field], between = NUMBER, bounds
    measured = b" ".join(field + b"=" + form for field, form in fields.items())
    told = rb"(?:\A|\n):0 OK state=" + _OVER + rb" run=\S+ cycle=\d+ relays=- lines=\d+ ms=\d+ " + measured + _SEAL
    done = rb"(?:\A|\n):0 OK state=" + _OVER + _SEAL
    device = rb"(?:\A|\n):0 OK [^\r\n]*\bname=(\S+) [^\r\n]*\bserial=(\S+)[^\r\n]*" + _SEAL
    return SafeBytes(
        resync=(Exchange(send=question),),
        off=(Exchange(send=b"\n" + command, expect=done, within_s=within_s),),
        proof=(Exchange(send=b"\n" + question, expect=told, within_s=within_s, between=between),),
        owed_s=within_s,
        talks=True,
        who=Exchange(send=seal(":0 ID"), expect=device, within_s=within_s),
    )


class BatteryTester:
    """One cycler; fills the role `cycler`.

    Args:
        name: the wire's dotted name.
        session: the session.
        wiring: protocol level, heartbeat, and number of cycles of a level 1 device.
    """

    def __init__(self, name: str, session: CyclerSession, wiring: Wiring) -> None:
        self._name = name
        self._session = session
        self._attendance = Attendance(session)
        self._beat_s = wiring.beat_s
        self._watchdog_s = 0.0 if wiring.level == "1" else wiring.beat_s
        self._preparing = Preparing(session, self._attendance, wiring)
        self._stream: CyclerStream | None = None

    @property
    def watchdog_s(self) -> float:
        """Heartbeat timeout in s after which the device opens its relays; see `hil.instruments.roles.Watched`."""
        return self._watchdog_s

    @drives
    def prepare(  # noqa: PLR0913 - see hil.instruments.cycler_role
        self,
        cycles: int,
        rest: float = 0.0,
        *,
        vfull: float | None = None,
        iend: float | None = None,
        vend: float | None = None,
        vmax: float | None = None,
        vmin: float | None = None,
        imax: float | None = None,
        tmax: float | None = None,
        tmin: float | None = None,
        time: float | None = None,
        charge: float | None = None,
    ) -> None:
        """Acknowledge the end of the last test, and configure the next one; every setting is read back.

        A level 1 device that is not waiting for its start is reset.

        Raises:
            Refused: a number cannot be sent.
            WrongIdentity: the device speaks a protocol level other than the wiring's.
            Rejected: it is running a test, or does not support a setting.
            DeviceFault: it does not answer, or answers nonsense.
        """
        limits = {"vfull": vfull, "iend": iend, "vend": vend, "vmax": vmax, "vmin": vmin, "imax": imax}
        limits |= {"tmax": tmax, "tmin": tmin, "time": time, "charge": charge}
        given = {name: value for name, value in limits.items() if value is not None}
        self._preparing.prepare({"cycles": cycles, "rest": rest, **given})

    @drives
    def start(self) -> None:
        """Start the prepared test.

        Raises:
            Refused: no test was prepared.
            Rejected: the device refuses, for example because a measured value is beyond a limit.
            DeviceFault: it does not answer, or answers nonsense.
        """
        self._preparing.start()

    @drives
    def stop(self) -> None:
        """Open both relays: by STOP, which is read back, or by a reset through DTR where STOP is not possible.

        Raises:
            NoReply: neither worked.
            DeviceFault: the device reports a closed relay.
        """
        self._preparing.stop()

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes of STOP; see `hil.instruments.roles.SafeByBytes`. Its measurements can be queried.

        Raises:
            Refused: there is no such state; or the device is level 1, or of unknown level, so any byte may start a
                test.
        """
        must_be_state(CYCLER, self._name, state)
        told = self._session.told
        if not isinstance(told, NumberedLines):
            why = "has not shown its level yet" if told is None else "speaks level 1"
            raise Refused(
                f"{self._name}: {self._session.device} {why}: no byte stops it, and any byte may start its test",
                "identify it first" if told is None else "only a reset stops it; let supply and load be its cut paths",
            )
        return stopped(self._name, proof, self._session.within_s)

    @reads
    def state(self) -> str:
        """Return `idle`, `charge`, `rest`, `discharge`, `ended`, `stopped`, or `tripped` and the reason.

        Raises:
            DeviceFault: the device restarted during its test, is silent, or talks nonsense.
        """
        told = self._followed()
        if isinstance(told, NumberedLines):
            if self._session.clock.now() - told.heard_s > _FRESH_S:
                Status.ask(self._session)
            if told.state == "tripped":
                self._session.listen(SILENT_S, lambda: told.state != "tripped")  # the reason is in the next line
        return told.state

    @reads
    def level(self) -> str:
        """Return the protocol level: `1` or `2.0`."""
        return self._session.meet().level

    @reads
    def voltage(self) -> Figure:
        """Return the newest voltage in V; its uncertainty is unknown.

        Raises:
            NoReply: there is no recent reading, as on a level 1 device without a running test.
            DeviceFault: as `state`.
        """
        return Figure(value=self._reading()[0], unit="V")

    @reads
    def current(self) -> Figure:
        """Return the newest current into the battery in A; see `voltage`."""
        return Figure(value=self._reading()[1], unit="A")

    @reads
    def temperature(self) -> Figure:
        """Return the newest temperature in degC; see `voltage`."""
        return Figure(value=self._reading()[3], unit="degC")

    @reads
    def time_uncertainty(self) -> Figure:
        """Return the standard uncertainty of the row times in s; NaN while nothing is streaming.

        Level 2: how well device time was known at `begin`; later deviations of its clock count as drift. Level 1: the
        largest uncertainty of any arrival so far.
        """
        known = self._stream.uncertainty if self._stream else None
        return Figure(value=float("nan") if known is None else known, unit="s")

    def channels(self) -> tuple[Channel, ...]:
        """Return voltage, current, energy, temperature, phase and cycle."""
        return tuple(Channel(name, unit) for name, unit in CHANNELS)

    @reads
    def sample(self) -> tuple[float, ...]:
        """Return the newest value of every channel."""
        reading = self._reading()
        told = self._session.meet()
        return (*reading, told.phase, told.cycle)

    def begin(self, rate: float) -> None:
        """Begin to stream; the device sends a row every 5 s in any case.

        Raises:
            Refused: the rate is not 0.2 Hz, or a stream is running.
            DeviceFault: the device is silent or talks nonsense.
        """
        if self._stream is not None:
            raise Refused(f"{self._session.device} is already streaming", "end the stream first")
        if rate != _RATE_HZ:
            raise Refused(f"{self._session.device} measures at {_RATE_HZ:g} Hz, not at {rate:g} Hz", "record at that")
        self._followed()
        self._stream = CyclerStream(self._session, self._attendance.attend)

    def drain(self) -> NDArray[np.float64]:
        """Return the rows since the last call, shape (n, 7): time in s since `begin`, and the channels.

        Raises:
            DeviceFault: the device restarted, is silent, or talks nonsense; earlier rows have been returned.
        """
        return self._streaming().drain()

    def end(self) -> StreamReport:
        """End the stream, and return its report; the test continues."""
        stream = self._streaming()
        self._stream = None
        return stream.end()

    @property
    def longest_pause(self) -> float:
        """Seconds between lines: a reader that drains this often sees every line as it arrives."""
        return LINE_S

    @property
    def patience(self) -> float:
        """Seconds that lines can wait: half of what 4096 bytes hold, and with two turns to spare for each heartbeat.

        Level 1 rows are dated by their arrival, so they are still read once per line.
        """
        if not isinstance(self._session.told, NumberedLines):
            return LINE_S
        return max(LINE_S, min(_FILLED_S / 2, self._beat_s / _TURNS_PER_BEAT))

    @property
    def over(self) -> bool:
        """Whether the lines read so far report the end of the test. See `hil.instruments.sampled.Ending`."""
        told = self._session.told
        return told is not None and not told.running and told.state != "idle"

    def _streaming(self) -> CyclerStream:
        if self._stream is None:
            raise Refused(f"{self._session.device} does not stream", "call begin() first")
        return self._stream

    def _followed(self) -> Told:
        """Return what the device has reported so far; a lost test is a fault until the next one is prepared."""
        self._session.meet()
        self._attendance.attend()
        if self._session.fault is not None:
            raise self._session.fault
        return self._session.meet()

    def _reading(self) -> Reading:
        told = self._followed()
        age = self._session.clock.now() - told.read_s
        if told.reading is not None and age <= (_FRESH_S if told.running else _JUST_READ_S):
            return told.reading
        if isinstance(told, NumberedLines):
            return Status.ask(self._session).reading
        raise NoReply(
            self._session.device,
            f"no data line for {age:.0f} s" if told.running else "it measures while its test runs only",
            "a device of level 1 cannot be asked; let other instruments watch the battery when it waits",
        )


class BatteryCycler:
    """Driver `cycler`: role `cycler`. A wire may set `level`, `beat` and `cycles`, see `Wiring`.

    Opening the port resets most devices; the driver waits for the banner, or for any line that shows the level.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"cycler"})
    resets_on_open: ClassVar[bool] = True

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a cycler is reached by a serial port", "give it `port:`")
        self._session = CyclerSession(connection.device, connection.port, connection.clock, timeout=connection.timeout)

    def reopened(self) -> None:
        """Discard all that was received: opening the port resets most devices, which ends a running test."""
        self._session.reopened()

    def identify(self) -> Identity:
        """Wait until a line shows the level; query a level 2 device's identity; a level 1 device has only its banner.

        Raises:
            NoReply: no line did.
            DeviceFault: the device does not answer, or answers nonsense.
        """
        if not isinstance(self._session.meet(), NumberedLines):
            return Identity(model=BANNER.decode("ascii"))
        found = self._session.identify()
        return Identity(model=found.name, serial=found.serial, firmware=found.firmware)

    def outlets(self) -> Sequence[Outlet]:
        """Return one outlet for both relays: on while either is closed, at level 1 while a test is running.

        Raises:
            DeviceFault: as `identify`.
        """
        told = self._session.meet()
        on = Status.ask(self._session).relays != "-" if isinstance(told, NumberedLines) else told.running
        return (Outlet(0, on=on),)

    def role(self, wire: Wire) -> BatteryTester:
        """Return the cycler with the wire's settings."""
        settings.fits(wire, "cycler", self.roles)
        return BatteryTester(wire.name, self._session, Wiring.read(wire))
