"""The guardian's plan as data: how bytes alone make each output safe."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from hil.model.serial_line import SerialLine

__all__ = ["CutOutput", "Exchange", "GuardPlan", "GuardedOutput", "GuardedPort", "SafeBytes"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """Bytes for one instrument, and the reply that acknowledges them.

    Attributes:
        send: the bytes; empty to only wait for silence or a reply.
        expect: a regular expression over bytes that the reply must contain (`re.search`, DOTALL); empty if there is
            no reply.
        within_s: reply timeout [s].
        quiet_s: silence required on the line before the bytes are sent [s].
        between: bounds of the number in the first group of `expect`; None if the match alone
            suffices.
    """

    send: bytes
    expect: bytes = b""
    within_s: float = 0.2
    quiet_s: float = 0.0
    between: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeBytes:
    """Bytes that bring one output to one safe state, from any state of the line.

    Attributes:
        resync: terminates a partial line left by another process; bytes received meanwhile are discarded.
        off: the commands; all are idempotent and may be repeated.
        proof: queries whether the output is safe, without changing anything, one at a time.
        owed_s: longest delay of a reply [s], by the instrument's limit. Earlier queries are unknown, so a proof begins
            only after this much silence; 0 if replies cannot be confused.
        talks: whether the instrument sends unsolicited bytes, so that silence cannot be awaited; `owed_s` then counts
            from the last query.
        who: queries the instrument's identity; None if its protocol cannot. The reply in the drill is compared with
            that of a reopened network port: the groups of its pattern, or the whole.
    """

    resync: tuple[Exchange, ...] = ()
    off: tuple[Exchange, ...]
    proof: tuple[Exchange, ...]
    owed_s: float = 0.5
    talks: bool = False
    who: Exchange | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardedPort:
    """One instrument's port, and how to reopen it if the descriptor passed is dead.

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
    """An output that bytes cannot reach: it is safe while another output, which cuts it off, is proven safe.

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
    """Everything that the guardian of one run needs.

    Attributes:
        bench: the bench's name.
        run: the run's folder.
        ports: in any order; the descriptors are passed beside.
        outputs: in the order of the safe-off.
        cut: outputs to which no bytes lead.
        hang_s: heartbeat timeout [s].
        latches: files that latch the bench, one per instrument that the run leased.
        journal: the guardian's log file.
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
