"""What SCPI instruments share: how a family talks, its session on a port, and how it is made safe by bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

from hil.instruments.driver import TERMINATED, Connection
from hil.instruments.pacing import PacedPort
from hil.instruments.scpi_session import ClosedSession, ScpiSession
from hil.model.errors import Refused
from hil.model.identity import Identity
from hil.model.safing import Exchange, SafeBytes

__all__ = ["OFF", "ScpiInstrument", "Speech", "switched_off"]

OFF = rb"\+?0|(?i:OFF)"
"""What a reply looks like that means off, as a regular expression; nothing that means on matches it."""

_GAP_S = 0.02
_IDENTIFY = "*IDN?"
_IDENTIFICATION = rb"[^,;\r\n]+(?:,[^,;\r\n]*){3,%d}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Speech:
    """How one family of instruments talks.

    Attributes:
        driver: the driver's name in bench files.
        error_query: takes the oldest entry out of the error queue.
        framed: whether a question may stand in a line with `*IDN?`.
        fields: the most fields of an identification.
        pause_s: what the instrument needs between lines [s].
    """

    driver: str
    error_query: str = "SYST:ERR?"
    framed: bool = False
    fields: int = 4
    pause_s: float = 0.0


class ScpiInstrument:
    """The session of a driver, and who answers in it. The instrument is never reset.

    `*RST` would switch outputs off in an order that nobody chose, and forget what a person had set.
    """

    capabilities: ClassVar[frozenset[str]] = frozenset({TERMINATED})
    speech: ClassVar[Speech]

    def __init__(self, connection: Connection) -> None:
        speech, port = self.speech, connection.port
        if port is None:
            raise Refused(f"{connection.device}: the driver {speech.driver} needs a port", "give it `port:`")
        self._connection = connection
        paced = PacedPort(port, connection.clock, speech.pause_s) if speech.pause_s else port
        session = ScpiSession if speech.framed else ClosedSession
        self._session = session(
            connection.device,
            paced,
            terminator=connection.terminator or b"\n",
            timeout=connection.timeout,
            error_query=speech.error_query,
            framed=speech.framed,
            fields=speech.fields,
        )

    def identify(self) -> Identity:
        """Ask `*IDN?`."""
        manufacturer, model, serial, firmware = self._session.identification()
        return Identity(manufacturer=manufacturer, model=model, serial=serial, firmware=firmware)


def switched_off(
    speech: Speech,
    off: str,
    questions: tuple[tuple[str, bytes, tuple[float, float] | None], ...],
    session: ScpiSession,
) -> SafeBytes:
    """Return how an output is made safe by bytes alone.

    A killed program may have left half a line, and a line feed would let the instrument execute it: `OUTP ON` without
    the channels that were to follow switches whichever is selected. So the first thing sent is `*IDN?`: after half a
    line it makes nonsense of it, which is refused whole; after nothing it is a question that changes nothing. The error
    queue is not emptied: what stands there shows the next program what happened.

    The proof begins with `*IDN?` too: when its reply has come, the instrument talks, and no older one is owed.

    A line may come back before its reply, blanks may surround a reply, and a carriage return may end it.

    Args:
        speech: whether a question may stand in a line with `*IDN?`, and what the instrument needs between lines.
        off: the command.
        questions: what is asked, what the reply must be, and the bounds of the number in it, if there is one.
        session: says what ends a line, and how long a reply may take.
    """
    quiet_s, within_s = _GAP_S + speech.pause_s, session.timeout
    begins, ends = (rb"(?:\A|\r)", rb" *\r") if session.terminator == b"\r" else (rb"(?:\A|\n)", rb" *\r?\n")
    identification = _IDENTIFICATION % (speech.fields - 1)

    def bytes_of(text: str) -> bytes:
        return text.encode("ascii") + session.terminator

    def asked(question: str, reply: bytes, bounds: tuple[float, float] | None) -> Exchange:
        separator = "" if question.startswith(":") else ":"
        line = f"{_IDENTIFY};{separator}{question}" if speech.framed else question
        echo = rb"(?:" + re.escape(line.encode("ascii")) + ends + rb")?"
        frame = identification + rb"; *" if speech.framed else rb" *"
        return Exchange(
            send=bytes_of(line),
            expect=rb"\A" + echo + frame + rb"(?:" + reply + rb")" + ends,
            within_s=within_s,
            quiet_s=quiet_s,
            between=bounds,
        )

    nothing_owed = Exchange(
        send=bytes_of(_IDENTIFY),
        expect=begins + identification + ends,
        within_s=within_s,
        quiet_s=quiet_s,
    )
    return SafeBytes(
        resync=(Exchange(send=bytes_of(_IDENTIFY), quiet_s=quiet_s),),
        off=(Exchange(send=bytes_of(off), quiet_s=quiet_s),),
        proof=(nothing_owed, *(asked(*each) for each in questions)),
        owed_s=within_s,
    )
