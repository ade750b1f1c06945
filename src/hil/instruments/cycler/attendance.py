"""What a running test needs of the host: heartbeats, and that its silence is noticed."""

from __future__ import annotations

from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.session import Session
from hil.instruments.cycler.status import Status
from hil.model.errors import NoReply, Rejected

__all__ = ["SILENT_S", "Attendance"]

SILENT_S = 12.0
"""Two lines and a bit: then something is wrong."""

_SILENT_UNASKED_S = 22.0  # a level 1 device cannot be asked; three lines in a row may be lost
_AGAIN_S = 1.0
_SHARE = 3


class Attendance:
    """Takes what has come, and does what is due. Whatever the role is asked to do begins with it.

    A heartbeat is sent and not waited for: its reply is looked at by the next call, which sends it again if need be.

    Args:
        session: the session.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._run = ""
        self._every_s = 0.0
        self._beaten_s = 0.0  # when the last heartbeat that was answered was sent
        self._beating = False
        self._tag = 0
        self._first_s = 0.0
        self._sent_s = 0.0

    def begin(self, run: str, beat_s: float, sent_s: float) -> None:
        """Keep a run alive whose START was sent at that time."""
        self._run, self._every_s, self._beaten_s, self._beating = run, beat_s / _SHARE, sent_s, False

    def attend(self) -> None:
        """Take what has come, send a heartbeat if one is due, and find out why nothing comes, if nothing does.

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
                "look at its power and its USB cable; a level 1 device cannot be asked",
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
        if self._session.tag != self._tag:  # something else was asked meanwhile, and its answer took the place
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
            told.unsure = True  # its test is over, and the mark that told of it was lost
            return
        try:
            self._session.judged("BEAT", words)
        except Rejected:
            self._run = ""
            raise
        self._beaten_s = self._first_s
