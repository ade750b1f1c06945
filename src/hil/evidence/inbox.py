"""The inbox of a run: requests from other terminals to the executive, one file per message."""

from __future__ import annotations

import os
import re
import secrets
import shutil
from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from hil.clock import wall
from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.evidence.durable import PART, read_plain, sha256_of, sync_file, write_whole
from hil.evidence.folder import ATTACHMENTS, INBOX, INBOX_FILES, is_sealed
from hil.model.errors import EvidenceError, Refused

__all__ = ["KINDS", "LARGEST_ATTACHMENT", "Message", "asks_for_end", "peek", "poll", "post", "waiting"]

KINDS = frozenset({"ack", "interrupt", "answer", "attachment", "hold", "note", "reached", "release", "stop"})
LARGEST_ATTACHMENT = 200_000_000

_ENDS = frozenset({"interrupt", "stop"})
_FOR_THIS_PROCESS = frozenset({"hold", "release"}) | _ENDS
"""Requests to the process that runs now; they do not carry over to the next one."""

_UNHEARD = "unheard"
_LONGEST_TEXT = 100_000
_LARGEST_MESSAGE = 2_000_000
_UNREADABLE = "unreadable"
_ENDING = ".message"


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """One message, as the executive receives it.

    Attributes:
        kind: one of `KINDS`, or `unreadable` with the reason as text, or `unheard` with the request as text.
        by: who sent it, empty if not given.
        text: a note's text, the reason for a stop, an answer, the code with which somebody confirms being reached.
        utc: when it was sent, by the sender's clock.
        urgent: whether a stop must not wait for the end of the step.
        file: an attachment's name in `data/attachments`.
        sha256: its hash; for an acknowledgement, that of the guardian's journal that was seen.
        name: the name of the question that is answered.
        witness: who witnessed an answer.
    """

    kind: str
    by: str = ""
    text: str = ""
    utc: str = ""
    urgent: bool = False
    file: str = ""
    sha256: str = ""
    name: str = ""
    witness: str = ""

    @property
    def beside(self) -> dict[str, str]:
        """Facts beside its event: when it was sent, which may be long before it is taken."""
        return {"sent": self.utc} if self.utc else {}


def post(
    folder: Path,
    kind: str,
    *,
    by: str = "",
    text: str = "",
    urgent: bool = False,
    attach: Path | None = None,
    seen: str = "",
    answers: tuple[str, str] = ("", ""),
) -> str:
    """Put a message into a run's inbox, atomically, and return its name.

    Args:
        folder: the run's folder.
        kind: one of `KINDS`.
        by: who sends it.
        text: the text of the message.
        urgent: whether a stop must not wait for the end of the step.
        attach: a file to be copied.
        seen: SHA-256 of what an acknowledgement acknowledges.
        answers: the name of the question that is answered, and who witnessed the answer.

    Raises:
        Refused: if the run is sealed, the kind unknown, or the text or attachment too large.
        EvidenceError: if the attachment cannot be read or the inbox cannot be written.
    """
    if is_sealed(folder):
        raise Refused(f"{folder.name} is sealed", "what comes after the seal lives in reports/.ledger")
    if kind not in KINDS:
        raise Refused(f"{kind!r} is not a message to a run", f"one of {', '.join(sorted(KINDS))}")
    if len(text) > _LONGEST_TEXT:
        raise Refused(f"a text of {len(text)} characters is too long", "attach it as a file")
    moment = wall.utc_now()
    name = f"{re.sub('[^0-9]', '', moment)}-{secrets.token_hex(4)}"
    try:
        file, sha256 = _copy_in(attach, folder / INBOX_FILES, name) if attach else ("", seen)
        message = Message(
            kind=kind,
            by=by,
            text=text,
            utc=moment,
            urgent=urgent,
            file=file,
            sha256=sha256,
            name=answers[0],
            witness=answers[1],
        )
        write_whole(folder / INBOX / f"{name}{_ENDING}", canonical(asdict(message)))
    except OSError as error:
        raise EvidenceError(
            f"{folder / INBOX}: the message cannot be left: {error}", "is the run still in progress?"
        ) from error
    return name


def waiting(folder: Path) -> tuple[str, ...]:
    """Return the names of the pending messages, in the order in which they were sent."""
    try:
        found = os.listdir(f"{folder}/{INBOX}")  # noqa: PTH208 - called at every scheduling point, and nearly always empty
    except FileNotFoundError:
        return ()
    return tuple(sorted(name for name in found if name.endswith(_ENDING)))


def asks_for_end(folder: Path, left: Collection[str]) -> bool:
    """Return whether a pending message that is not one of `left` asks the run to stop; the message stays."""
    return any(_read(folder / INBOX / name).kind in _ENDS for name in waiting(folder) if name not in left)


def poll(folder: Path, left: Collection[str] = ()) -> Iterator[Message]:
    """Yield the messages in the order in which they were sent; each leaves the inbox when the next is requested.

    So a message whose event is written in the loop's body is never lost: whatever ends the process, it is either in
    the journal or still in the inbox. Attachments are in `data/attachments` when their message is yielded.

    Args:
        folder: the run's folder.
        left: the names of messages left for an earlier process. Requests to that process become `unheard`.
    """
    for name in waiting(folder):
        path = folder / INBOX / name
        message = _taken(folder, path)
        if name in left and message.kind in _FOR_THIS_PROCESS:
            text = f"{message.kind}, before the run was resumed: {message.text}".rstrip(": ")
            message = replace(message, kind=_UNHEARD, text=text)
        yield message
        _remove(path)


def peek(folder: Path) -> Iterator[Message]:
    """Yield the pending messages, in the order in which they were sent; they stay pending."""
    for name in waiting(folder):
        yield _read(folder / INBOX / name)


def _remove(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError:  # there is a folder of this name
        shutil.rmtree(path, ignore_errors=True)


def _copy_in(attach: Path, files: Path, name: str) -> tuple[str, str]:
    if not attach.is_file():
        raise Refused(f"{attach}: this is not a file", "attach one file at a time")
    if attach.stat().st_size > LARGEST_ATTACHMENT:
        raise Refused(f"{attach}: larger than {LARGEST_ATTACHMENT / 1e6:.0f} MB", "attach a part of it")
    file = f"{name}-{re.sub(r'[^A-Za-z0-9._-]+', '_', attach.name).strip('._-')[-80:] or 'file'}"
    part = files / f"{file}{PART}"
    shutil.copyfile(attach, part)
    sync_file(part)
    part.replace(files / file)
    return file, sha256_of(files / file)


def _taken(folder: Path, path: Path) -> Message:
    message = _read(path)
    try:
        if message.file:
            _move(folder, message)
    except (OSError, EvidenceError) as error:
        return Message(kind=_UNREADABLE, text=f"{path.name}: {error}")
    return message


def _read(path: Path) -> Message:
    try:
        value = parse_strict(read_plain(path, _LARGEST_MESSAGE))
        message = Message(**value) if isinstance(value, dict) else None
        if message is None or message.kind not in KINDS or not all(_is_plain(message)):
            return Message(kind=_UNREADABLE, text=f"{path.name}: not a message")
    except (OSError, TypeError, JsonError) as error:
        return Message(kind=_UNREADABLE, text=f"{path.name}: {error}")
    return message


def _is_plain(message: Message) -> Iterator[bool]:
    texts = (message.by, message.text, message.utc, message.file, message.sha256, message.name, message.witness)
    yield all(isinstance(text, str) for text in texts)
    yield isinstance(message.urgent, bool)
    yield re.fullmatch(r"([A-Za-z0-9][A-Za-z0-9._-]*)?", str(message.file)) is not None


def _move(folder: Path, message: Message) -> None:
    left, kept = folder / INBOX_FILES / message.file, folder / ATTACHMENTS / message.file
    kept.parent.mkdir(parents=True, exist_ok=True)
    if left.exists():
        left.replace(kept)
    if sha256_of(kept) != message.sha256:
        raise EvidenceError(f"{message.file}: the attachment is not the one that was sent", "attach it again")
