"""One session with a cycler: commands of level 2, each with a tag, and their replies."""

from __future__ import annotations

from collections.abc import Mapping

from hil.clock.port import Clock
from hil.instruments.cycler.hearing import FIRMWARE, Hearing
from hil.instruments.cycler.lines import Banner, fields_of, seal
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.cycler.refusals import refusal
from hil.model.errors import Garbled, NoReply
from hil.wire.port import Port

__all__ = ["Session"]

_WAIT_S = 1.0
_ATTEMPTS = 3
_LAST_TAG = 65_535
_SEAL_AND_END = 7


class Session(Hearing):
    """The host's end of the line, with one command outstanding at a time. See `Hearing`.

    Attributes:
        tag: of the last command.
        sent_bytes: of the last command.
        reply_bytes: of its reply.
    """

    def __init__(self, device: str, port: Port, clock: Clock) -> None:
        super().__init__(device, port, clock)
        self.tag = 0
        self.sent_bytes = 0
        self.reply_bytes = 0
        self._line = b""
        self._prefix = b""  # of the reply that is outstanding
        self._words: str | None = None

    def opened_anew(self) -> None:
        """Forget what the line has told, and the reply that is outstanding."""
        super().opened_anew()
        self._prefix, self._words = b"", None

    def ask(self, command: str) -> str:
        """Send a command, and return what stands behind OK; the same bytes again where no reply comes.

        Raises:
            Rejected: it answers with an error.
            NoReply, Garbled: it does not answer, or damaged.
        """
        damaged = self.numbered().damaged
        if self._prefix:
            self.listen(_WAIT_S, lambda: self.answer() is not None)
        self.send(command)
        for attempt in range(_ATTEMPTS):
            if attempt:
                self.send_again()
            self.listen(_WAIT_S, lambda: self.answer() is not None)
            if (words := self.answer()) is not None:
                return self.judged(command, words)
        self.in_step = False
        self._prefix = b""
        if self.numbered().damaged > damaged:
            raise Garbled(
                self.device,
                f"asked {command}, and what came is damaged",
                "look at the line's speed, 9600, and at the USB cable",
            )
        raise NoReply(self.device, f"asked {command}, and no reply came", "look at its power and its USB cable")

    def send(self, command: str) -> int:
        """Send a command, do not wait, and return its tag; where a rest may stand before it, an end comes first."""
        self.tag = self.tag % _LAST_TAG + 1
        self._prefix, self._words = b":%d " % self.tag, None
        self._line = (b"" if self.in_step else b"\n") + seal(f":{self.tag} {command}")
        self.in_step = True
        self.sent_bytes = len(self._line)
        self.write(self._line)
        return self.tag

    def send_again(self) -> None:
        """Send the same bytes again."""
        self.write(self._line)

    def answer(self) -> str | None:
        """Return what stands behind the tag of the last command, if the reply has come; others were late copies."""
        if self._prefix and isinstance(self.told, NumberedLines):
            replies, self.told.replies = self.told.replies, []
            for reply in replies:
                if reply.startswith(self._prefix):
                    self._words = reply[len(self._prefix) :].decode("ascii", "replace")
                    self._prefix = b""
                    self.reply_bytes = len(reply) + _SEAL_AND_END
                    break
        return self._words

    def fields(self, command: str) -> Mapping[str, str]:
        """Ask, and return the fields of the reply.

        Raises:
            DeviceFault: as `ask`; Garbled where something else than fields came.
        """
        words = self.ask(command)
        try:
            return fields_of(words)
        except ValueError as error:
            raise self.nonsense(words) from error

    def identify(self) -> Banner:
        """Ask a device of level 2 who it is.

        Raises:
            DeviceFault: as `fields`.
        """
        told = self.fields("ID")
        try:
            found = Banner.of_reply(told)
        except (KeyError, ValueError) as error:
            raise self.nonsense(str(dict(told))) from error
        if self.banner is not None and self.banner.boots != found.boots:
            self.went_back(self.numbered(), running=self.numbered().running)
        self.banner = found
        return found

    def judged(self, command: str, words: str) -> str:
        """Return what stands behind OK; Rejected where it is an error, Garbled where it is neither."""
        result, _, rest = words.partition(" ")
        if result == "ERROR":
            raise refusal(self.device, command, rest)
        if result != "OK":
            raise self.nonsense(words)
        return rest

    def numbered(self) -> NumberedLines:
        """Return what a device of level 2 has told; Garbled where it is none any more."""
        told = self.meet()
        if not isinstance(told, NumberedLines):
            raise Garbled(self.device, "it speaks level 1", FIRMWARE)
        return told
