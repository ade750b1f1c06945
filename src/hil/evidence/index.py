"""Index of a folder of reports: a disposable cache of what was seen of unchanged runs."""

from __future__ import annotations

import hashlib
import os
from contextlib import suppress
from pathlib import Path

import msgspec

from hil.evidence.unchanged import cache_folder, folder_key, product_key

__all__ = ["Index", "Seen"]


class Seen(msgspec.Struct, frozen=True, kw_only=True):
    """What was seen of a run that no process holds, and in which nothing was wrong.

    Attributes:
        key: the key by which its unchanged folder is recognised.
        began: when it began, as ISO 8601.
        state: its state.
        checked: what was checked of it.
        problem: what to do, in a sentence, or empty.
        plans: the plans it was asked for.
        bench: the bench's name.
        dut: the serial number of the device under test.
        source: where its bytes come from.
        purpose: why it was made.
        planned: how many cases were planned.
        ended: how many of them ended.
        verdict: the sealed verdict; empty before.
        deviates: whether it differs from its plan.
        run: its name at the seal; empty before the seal, as are the following two.
        evidence: its evidence digest.
        before: the head that the ledger had before its seal.
    """

    key: str
    began: str
    state: str
    checked: str
    problem: str
    plans: tuple[str, ...]
    bench: str
    dut: str
    source: str
    purpose: str
    planned: int
    ended: int
    verdict: str
    deviates: bool
    run: str = ""
    evidence: str = ""
    before: str = ""


class Index:
    """Cache of what is known of the runs in a folder of reports.

    It holds nothing that is not in the runs themselves: if it is missing or cannot be read, they are read again.
    What the ledger says of a package is not part of it, and is looked up each time.

    Args:
        file: where it is stored; None disables it.
        version: what identifies the product that wrote it.
    """

    def __init__(self, file: Path | None, version: str) -> None:
        self._file = file
        self._version = version
        self._before = self._read()
        self._now: dict[str, Seen] = {}

    @classmethod
    def of(cls, reports: Path) -> Index:
        """Return the user's index of a folder of reports."""
        name = hashlib.sha256(os.fsencode(reports.resolve())).hexdigest()
        return cls(cache_folder("runs") / name, product_key())

    def key(self, folder: Path) -> str:
        """Return the key of a run's folder; empty if the index is disabled, or the folder has none."""
        return folder_key(folder, self._version) if self._file is not None else ""

    def get(self, folder: Path, key: str) -> Seen | None:
        """Return what was seen of a run, None if anything in its folder has changed since."""
        found = self._before.get(folder.name)
        return found if found is not None and key and found.key == key else None

    def keep(self, folder: Path, seen: Seen) -> None:
        """Keep what was seen of a run, if its folder is unchanged; runs with odd names are read every time."""
        if (
            seen.key
            and folder.name.isascii()
            and (self._before.get(folder.name) is seen or self.key(folder) == seen.key)
        ):
            self._now[folder.name] = seen

    def save(self) -> None:
        """Write what was kept, without runs that are gone."""
        if self._file is None or self._now == self._before:
            return
        part = self._file.with_name(f"{self._file.name}.{os.getpid()}")
        with suppress(OSError):  # it is a convenience: without it the next list takes as long as this one
            self._file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            part.write_bytes(msgspec.msgpack.encode(self._now))
            part.replace(self._file)

    def _read(self) -> dict[str, Seen]:
        if self._file is None:
            return {}
        try:
            return msgspec.msgpack.decode(self._file.read_bytes(), type=dict[str, Seen])
        except (OSError, msgspec.MsgspecError, UnicodeError):
            return {}
