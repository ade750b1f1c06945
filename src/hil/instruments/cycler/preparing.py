"""Preparing, starting and stopping a cycler's test, and keeping it alive, at both protocol levels."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from hil.instruments.cycler.bare import BareLines
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.session import CyclerSession, Status
from hil.instruments.cycler.settings import SETTINGS, Wiring, checked, crc_of
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected, WrongIdentity

__all__ = ["SILENT_S", "Attendance", "Preparing"]

SILENT_S = 12.0
"""Silence that counts as a fault: two line periods and a margin."""

_SILENT_UNASKED_S = 22.0  # a level 1 device cannot be queried; three lines in a row may be lost
_AGAIN_S = 1.0
_SHARE = 3
_START = b"\n"  # the one byte for level 1; a level 2 device ignores it as an empty line
_LEVEL_1 = {"rest": 0.0, "iend": 0.05, "vend": 2.7}
_DIGITS = 4


class Attendance:
    """Line servicing that every call of the role begins with: read what has arrived, send heartbeats.

    A heartbeat is sent without waiting: the next call checks its reply, and resends it if need be.

    Args:
        session: the session.
    """

    def __init__(self, session: CyclerSession) -> None:
        self._session = session
        self._run = ""
        self._every_s = 0.0
        self._beaten_s = 0.0  # when the last acknowledged heartbeat was sent
        self._beating = False
        self._tag = 0
        self._first_s = 0.0
        self._sent_s = 0.0

    def begin(self, run: str, beat_s: float, sent_s: float) -> None:
        """Begin to keep alive a run whose START was sent at `sent_s`."""
        self._run, self._every_s, self._beaten_s, self._beating = run, beat_s / _SHARE, sent_s, False

    def attend(self) -> None:
        """Take what has arrived, send a heartbeat if one is due, and diagnose silence.

        Raises:
            DeviceFault: it is silent, talks nonsense, or tests another run.
        """
        session = self._session
        now = session.poll()
        told = session.told
        if isinstance(told, NumberedLines):
            if self._run:
                self._keep_alive(told, now)
            if told.unsure or now - told.heard_s > SILENT_S:
                Status.ask(session)
        elif told is not None and told.running and now - told.heard_s > _SILENT_UNASKED_S:
            raise NoReply(
                session.device,
                f"no line for {now - told.heard_s:.0f} s, and its test has not ended",
                "check its power and its USB cable; a level 1 device cannot be asked",
            )

    def _keep_alive(self, told: NumberedLines, now: float) -> None:
        if not told.running:
            self._run, self._beating = "", False
        elif self._beating:
            self._look_for_reply(told, now)
        elif now - self._beaten_s >= self._every_s:
            self._tag = self._session.send(f"BEAT run={self._run}")
            self._beating, self._first_s, self._sent_s = True, now, now

    def _look_for_reply(self, told: NumberedLines, now: float) -> None:
        if self._session.tag != self._tag:  # another command has been sent since, and its reply took the place
            self._beating = False
            return
        words = self._session.answer()
        if words is None:
            if now - self._sent_s >= _AGAIN_S:
                self._session.send_again()
                self._sent_s = now
            return
        self._beating = False
        if words.startswith("ERROR STATE"):
            told.unsure = True  # its test is over, and the mark that reported it was lost
            return
        try:
            self._session.judged("BEAT", words)
        except Rejected:
            self._run = ""
            raise
        self._beaten_s = self._first_s


class Preparing:
    """Preparation, start and stop of one device's test.

    Args:
        session: the session.
        attendance: keeps a test alive.
        wiring: the wire's settings.
    """

    def __init__(self, session: CyclerSession, attendance: Attendance, wiring: Wiring) -> None:
        self._session = session
        self._attendance = attendance
        self._wiring = wiring
        self._settings = ""  # CRC of the prepared settings
        self._prepared_at = -1  # number of device starts at that time

    def prepare(self, given: Mapping[str, float]) -> None:
        """Configure a test.

        Args:
            given: settings by name; missing ones take their defaults.

        Raises:
            Refused, WrongIdentity, Rejected, DeviceFault: see `BatteryTester.prepare`.
        """
        session = self._session
        settings = checked(session.device, {**given, "beat": self._wiring.beat_s})
        session.fault = None
        self._prepared_at = -1
        told = self._expected()
        if isinstance(told, BareLines):
            self._must_match_fixed_settings(given)
            if told.running:
                raise Rejected(session.device, "its test runs, and a level 1 device has one only", "stop() it first")
            if not told.waiting:
                session.reset()
        else:
            session.ask("CLEAR")
            self._set(settings)
            told.rests = settings["rest"] != "0"
        told.over("idle")
        self._settings = crc_of(settings)
        self._prepared_at = session.starts

    def start(self) -> None:
        """Start the prepared test.

        Raises:
            Refused, Rejected, DeviceFault: see `BatteryTester.start`.
        """
        session = self._session
        told = self._expected()
        self._attendance.attend()
        if self._prepared_at != session.starts:
            raise Refused(
                f"{session.device}: no test is prepared, or it has restarted since then", "call prepare() first"
            )
        self._prepared_at = -1
        before = session.clock.now()
        if isinstance(told, BareLines):
            session.write(_START)
            told.begin_test(before, session.clock.now())
            return
        run = self._next_run()
        before = session.clock.now()
        told.reading = None
        session.ask(f"START run={run} settings={self._settings}")
        told.charging(1.0)
        self._attendance.begin(run, self._wiring.beat_s, before)

    def stop(self) -> None:
        """Open both relays.

        Raises:
            NoReply, DeviceFault: see `BatteryTester.stop`.
        """
        session = self._session
        session.fault = None
        self._prepared_at = -1
        with suppress(Garbled):
            session.poll()
        told = session.told
        if isinstance(told, NumberedLines):
            try:
                self._stop_by_command()
            except (NoReply, Garbled):
                session.reset()
            return
        running = told is not None and told.running
        try:
            session.reset()
        except NoReply as no_banner:
            if told is not None or not self._is_level_2():
                raise no_banner from None
            self._stop_by_command()
        if running and session.told is not None:
            session.told.state = "stopped"

    def _is_level_2(self) -> bool:
        """Return whether it turns out to be a level 2 device, which can be stopped by command."""
        try:
            return isinstance(self._session.meet(), NumberedLines)
        except NoReply:
            return False

    def _stop_by_command(self) -> None:
        """Send STOP, and query the outcome.

        Raises:
            DeviceFault: a relay is reported closed.
        """
        self._session.ask("STOP")
        status = Status.ask(self._session)
        if status.relays != "-":
            raise DeviceFault(
                self._session.device,
                f"STOP was answered, and its relays are {status.relays}",
                "cut its supply and its load by hand",
            )

    def _expected(self) -> NumberedLines | BareLines:
        told = self._session.meet()
        if told.level != self._wiring.level:
            raise WrongIdentity(
                self._session.device,
                f"it speaks level {told.level}, the wiring says level {self._wiring.level}",
                "compare its firmware with `level` in the wiring",
            )
        return told

    def _must_match_fixed_settings(self, given: Mapping[str, float]) -> None:
        does = {"cycles": float(self._wiring.cycles), **_LEVEL_1}
        for name, value in given.items():
            if name not in does:
                raise Rejected(
                    self._session.device,
                    f"a level 1 device has no {name}: its charge ends at 0.050 A, its discharge at 2.700 V,"
                    " and it knows no limits",
                    f"leave {name} out, and give the envelope limits",
                )
            if value != does[name]:
                raise Rejected(
                    self._session.device,
                    f"a level 1 device has {name} {does[name]:g}, not {value:g}, and cannot be set",
                    f"prepare it with {name} {does[name]:g}" + ("" if name != "cycles" else ", or correct the wiring"),
                )

    def _set(self, settings: Mapping[str, str]) -> None:
        """Send every setting: after a restart, any that is not sent would be at its default."""
        for setting in SETTINGS:
            wanted = f"{setting.name}={settings[setting.name]}"
            found = self._session.ask(f"SET {wanted}")
            if found != wanted:
                raise Rejected(self._session.device, f"{wanted} was set, it reads {found}", "check its firmware")

    def _next_run(self) -> str:
        """Return a run identifier that the device has not used: boot counter and count since boot, four digits each.

        The count continues from the device's last run, so that no other session since this boot reuses one.
        """
        session = self._session
        last = Status.ask(session).run
        banner = session.banner or session.identify()
        boot = f"{banner.boots % 16**_DIGITS:04X}"
        count = int(last[_DIGITS:], 16) if last.startswith(boot) else 0
        return f"{boot}{(count + 1) % 16**_DIGITS:04X}"
