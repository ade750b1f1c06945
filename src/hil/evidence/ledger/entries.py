"""Entries of the ledger, each kind a frozen type, and the strict codec of their lines."""

import hashlib
import re
from collections.abc import Iterable, Mapping
from typing import TypeVar, get_args

import msgspec

from hil.clock import wall
from hil.documents.canonical import JsonError, parse_strict
from hil.documents.suggest import did_you_mean
from hil.evidence.events.codec import convert, quick_canonical
from hil.evidence.events.event import Part

__all__ = [
    "FORMAT",
    "KINDS",
    "ZERO",
    "Acknowledged",
    "Approved",
    "Baseline",
    "Entry",
    "Explained",
    "Head",
    "Opened",
    "Reason",
    "Repaired",
    "Replayed",
    "Sealed",
    "Signed",
    "Status",
    "decode",
    "encode",
    "line_hash",
    "set_back",
    "stamped",
]

FORMAT = 1
ZERO = "0" * 64
"""The predecessor's hash in the first line."""

_APART_S = 300.0
"""Tolerance between the clocks of machines that write to one ledger; smaller steps back go unnoticed."""

_TO_MINUTES = len("2026-11-22T10:00")

_OWN = re.compile(rb'"own":"([0-9a-f]{64})",')


class Entry(Part, frozen=True, kw_only=True, tag_field="kind", tag=str.lower):
    """One line of the ledger.

    Attributes:
        seq: the number of the line, from 0; -1 until it is written.
        prev: the SHA-256 of the line before it, its newline included; 64 zeros in the first.
        utc: when it was written, ISO 8601.
        own: the SHA-256 of the line without this member, so that a changed last line is found as well.
    """

    seq: int = -1
    prev: str = ""
    utc: str = ""
    own: str = ""

    @classmethod
    def kind(cls) -> str:
        """Return the name of this type of entry in the ledger."""
        return str(cls.__struct_config__.tag)


class Opened(Entry, frozen=True, kw_only=True):
    """The first line of every ledger.

    Attributes:
        format: the format of the ledger.
    """

    format: int


class Repaired(Entry, frozen=True, kw_only=True):
    """An incomplete line at the end was cut off: its writer had been killed.

    Attributes:
        bytes: how many bytes were cut off.
        object: the object that keeps them.
    """

    bytes: int
    object: str


class Head(Entry, frozen=True, kw_only=True):
    """The head of a run's journal at one moment.

    Attributes:
        run: the name of the run.
        events: how many lines the journal had.
        sha256: the SHA-256 of the last of them, as the next line would name it.
        state: the state of the run, such as RUNNING or INTERRUPTED.
        source: where its bytes come from; empty in entries of older versions.
    """

    run: str
    events: int
    sha256: str
    state: str
    source: str = ""


class Sealed(Entry, frozen=True, kw_only=True):
    """A package was sealed.

    Attributes:
        run: the name of the run.
        evidence: its evidence digest.
        content: its content digest.
        verdict: its verdict.
        source: where its bytes came from.
        bench: the bench's name.
        dut: the serial number of the device under test.
    """

    run: str
    evidence: str
    content: str
    verdict: str
    source: str
    bench: str
    dut: str


class Acknowledged(Entry, frozen=True, kw_only=True):
    """A named person checked a latched bench when its run could no longer record that.

    Attributes:
        run: the name of the run.
        by: who looked.
        text: what was seen and done.
        why: why the benches were latched.
    """

    run: str
    by: str
    text: str
    why: tuple[str, ...] = ()


class Signed(Entry, frozen=True, kw_only=True):
    """A package was signed.

    Attributes:
        run: the name of the run.
        evidence: the evidence digest that was signed.
        principal: whose key it is.
        statement: the object that holds the signed statement.
        signature: the object that holds the signature.
    """

    run: str
    evidence: str
    principal: str
    statement: str
    signature: str


class Approved(Entry, frozen=True, kw_only=True):
    """A person approved a package.

    Attributes:
        run: the name of the run.
        evidence: the evidence digest that was approved.
        role: the role in which it was approved, such as `quality`.
        principal: whose key it is.
        meaning: what the approval means, in the person's words.
        statement: the object that holds the signed statement.
        signature: the object that holds the signature.
    """

    run: str
    evidence: str
    role: str
    principal: str
    meaning: str
    statement: str
    signature: str


class Replayed(Entry, frozen=True, kw_only=True):
    """A package was replayed on its recorded bytes.

    Attributes:
        run: the name of the run.
        evidence: the evidence digest of the package.
        analysis: SHA-256 over the code that analysed and judged the replay.
        same: whether they came to the same verdicts.
        differences: how many differences there were.
    """

    run: str
    evidence: str
    analysis: str
    same: bool
    differences: int = 0


class Baseline(Entry, frozen=True, kw_only=True):
    """The content of a document of the workspace from this moment on.

    Attributes:
        subject: which one: `catalogue`, `units`, `instruments` or `signers`.
        object: the object that holds it.
    """

    subject: str
    object: str


class Explained(Entry, frozen=True, kw_only=True):
    """A named person explained why an entry of the catalogue or a register was removed or changed.

    Attributes:
        entry: what identifies the entry.
        name: the entry in words.
        by: who says so.
        text: why.
    """

    entry: str
    name: str
    by: str
    text: str


class Reason(Part, frozen=True, kw_only=True):
    """Why a requirement has its status.

    Attributes:
        code: the reason's code.
        text: the same in a sentence.
    """

    code: str
    text: str = ""


class Status(Entry, frozen=True, kw_only=True):
    """The status of a requirement changed.

    Attributes:
        requirement: its id.
        status: `open` or `closed`.
        compliance: `yes`, `no` or `partial`.
        reasons: why, each with its code.
        fingerprint: the requirement's fingerprint.
        evidence: the evidence digests of the packages that it is based on.
    """

    requirement: str
    status: str
    compliance: str = ""
    reasons: tuple[Reason, ...] = ()
    fingerprint: str = ""
    evidence: tuple[str, ...] = ()


_Any = Acknowledged | Approved | Baseline | Explained | Head | Opened | Repaired | Replayed | Sealed | Signed | Status

KINDS: Mapping[str, type[Entry]] = {each.kind(): each for each in get_args(_Any)}
"""The type of every kind of entry, by its name in the ledger."""

_DECODER = msgspec.json.Decoder(_Any)

_Entry = TypeVar("_Entry", bound=Entry)


def stamped(entry: _Entry, *, seq: int, prev: str, utc: str) -> _Entry:
    """Return an entry with its place in the chain and its own hash."""
    placed = msgspec.structs.replace(entry, seq=seq, prev=prev, utc=utc, own="")
    return msgspec.structs.replace(placed, own=hashlib.sha256(quick_canonical(placed)).hexdigest())


def set_back(entries: Iterable[Entry]) -> dict[int, str]:
    """Return why the times of entries cannot be believed, a sentence each, by entry number.

    If an entry is older than one before it, either its clock had been set back, or the other one's was ahead: which
    is unknown. All entries are reported until time has caught up.

    Args:
        entries: of a ledger, in order.
    """
    found: dict[int, str] = {}
    latest, latest_s = Entry(), 0.0
    for each in entries:
        now = _seconds(each)
        if now is None:
            found[each.seq] = f"line {each.seq + 1} of the ledger does not say when it was written"
        elif now >= latest_s:
            latest, latest_s = each, now
        elif latest_s - now > _APART_S:
            then, before = each.utc[:_TO_MINUTES], latest.utc[:_TO_MINUTES]
            found[each.seq] = (
                f"line {each.seq + 1} of the ledger is of {then}, and line {latest.seq + 1} before it of {before}: "
                "a clock was set back, or had been ahead"
            )
    return found


def encode(entry: Entry) -> bytes:
    """Return the line of a stamped entry, with its newline.

    Raises:
        JsonError: for values that have no canonical JSON.
    """
    return quick_canonical(entry) + b"\n"


def line_hash(line: bytes) -> str:
    """Return the SHA-256 of a line, with its newline: the next line names it, and that of the last one is the head."""
    return hashlib.sha256(line).hexdigest()


def decode(line: bytes) -> Entry:
    """Return the entry in a line, which ends with a newline.

    Raises:
        JsonError: for what is not a line as `encode` writes it, byte for byte, with its own hash.
    """
    text = line.removesuffix(b"\n")
    entry: Entry
    try:
        entry = _DECODER.decode(text)
    except (msgspec.DecodeError, UnicodeDecodeError):
        entry = _strictly_read(text)
    if quick_canonical(entry) != text or hashlib.sha256(_OWN.sub(b"", text, count=1)).hexdigest() != entry.own:
        raise JsonError("the line was changed: its own hash is another one")
    return entry


def _seconds(entry: Entry) -> float | None:
    """Return when an entry was written in s since 1970, None if it does not say."""
    try:
        return wall.seconds_of(entry.utc)
    except ValueError:
        return None


def _strictly_read(text: bytes) -> Entry:
    """Return the entry in a line that the fast path did not accept, or raise what is wrong with it."""
    parsed = parse_strict(text)
    if not isinstance(parsed, dict):
        raise JsonError("expected an object")
    kind = parsed.get("kind")
    found = KINDS.get(kind) if isinstance(kind, str) else None
    if found is None:
        raise JsonError(f"there are no entries of kind {kind!r}{did_you_mean(str(kind), KINDS)}")
    return convert(parsed, found, str(kind))
