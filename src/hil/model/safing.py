"""How outputs are made safe with nothing but bytes: what the guardian is given, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from hil.model.serial_line import SerialLine

__all__ = ["CutOutput", "Exchange", "GuardPlan", "GuardedOutput", "GuardedPort", "SafeBytes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """Bytes for one instrument, and the reply that shows they were taken.

    Attributes:
        send: the bytes; empty if only silence or a reply is waited for.
        expect: a regular expression over bytes, of which the reply must hold a match (`re.search`, DOTALL); empty
            where no reply comes.
        within_s: how long the reply may take [s].
        quiet_s: how long the line must have been silent before the bytes are sent [s].
        between: the least and the most that the number in the first group of `expect` may be; None if the match
            alone says it all.
    """

    send: bytes
    expect: bytes = b""
    within_s: float = 0.2
    quiet_s: float = 0.0
    between: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeBytes:
    """How to bring one output to one safe state, by bytes alone, whatever the line was in the middle of.

    Attributes:
        resync: ends what another process may have left half sent on the line; what is heard in this time is discarded.
        off: the commands; each may be sent again, and sending one to an output that is safe already does no harm.
        proof: asks whether it is safe; sends nothing that changes anything. Its questions go out one at a time.
        owed_s: how long a reply may be on its way [s], the instrument's limit. Nobody knows what was asked before, so
            a proof begins once the line has been silent for so long; 0 where no reply can be taken for another's.
        talks: whether the instrument talks unasked, so that its silence cannot be waited for; then `owed_s` counts from
            the last question.
        who: asks who the instrument is; None where its protocol has no question for that. What is replied in the drill
            is compared with what answers when a port of a network is reopened: the groups of its pattern, or all of it.
    """

    resync: tuple[Exchange, ...] = ()
    off: tuple[Exchange, ...]
    proof: tuple[Exchange, ...]
    owed_s: float = 0.5
    talks: bool = False
    who: Exchange | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardedPort:
    """One instrument's port, and how to reopen it if the descriptor that was passed is dead.

    Attributes:
        device: the instrument's name.
        url: a path of a device, `socket://host:port`, `rfc2217://host:port`, `hislip://host:port/name`,
            `vxi11://host/name`, `usbtmc://vendor:product:serial`, or `hosted://module:name/place`, which starts a
            vendor's driver; empty if it must not be reopened, such as that of a board which a rising DTR resets.
        baud: of a serial device.
        line: how a serial device is set.
        speaks: what its bytes are wrapped in: Telnet at `rfc2217://`, one of three ways to carry messages, or calls of
            a vendor's driver.
        apart: whether the descriptor that is passed carries no byte of it, because a library of others has opened the
            port for the run. The guardian opens it by itself then, beside the run.
    """

    device: str
    url: str = ""
    baud: int = 0
    line: SerialLine = field(default_factory=SerialLine)
    speaks: Literal["", "telnet", "usbtmc", "hislip", "vxi11", "hosted"] = ""
    apart: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardedOutput:
    """One line of the safe-off for the guardian.

    Attributes:
        output: dotted name of the role instance.
        state: the safe state's name.
        device: the instrument whose port it is.
        within_s: how long it may take [s].
        code: the bytes.
        cut_by: other outputs of the plan whose safe state cuts this one off where its own port is gone.
    """

    output: str
    state: str
    device: str
    within_s: float
    code: SafeBytes
    cut_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CutOutput:
    """An output to which no bytes lead: it is safe while another one, which cuts it off, is proven safe.

    Attributes:
        output: dotted name of the role instance.
        cut_by: outputs of the plan whose safe state cuts it off.
        why: why there are no bytes, such as `gives no safe_bytes`.
    """

    output: str
    cut_by: tuple[str, ...]
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardPlan:
    """All that the guardian of one run knows.

    Attributes:
        bench: the bench's name.
        run: the run's folder.
        ports: in any order; the descriptors are passed beside.
        outputs: in the order of the safe-off.
        cut: outputs to which no bytes lead.
        hang_s: how long the heartbeat may be silent [s].
        latches: files that latch the bench, one per instrument that the run leased.
        journal: the file in which the guardian writes down what it did.
    """

    bench: str
    run: str
    ports: tuple[GuardedPort, ...]
    outputs: tuple[GuardedOutput, ...]
    cut: tuple[CutOutput, ...] = ()
    hang_s: float = 1.0
    latches: tuple[str, ...] = ()
    journal: str

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all outputs."""
        return (*(each.output for each in self.outputs), *(each.output for each in self.cut))
