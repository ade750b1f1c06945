"""`artifact`: files that a case makes, kept with its evidence."""

from __future__ import annotations

import hashlib
from itertools import chain, count
from pathlib import Path

from hil.documents.text import name_problem
from hil.evidence import events
from hil.evidence.durable import read_plain, write_whole
from hil.evidence.events import EventSink
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import OfThisProcess
from hil.executive.cases.steps import Steps, file_part
from hil.model.errors import Misused

__all__ = ["Artifacts"]

_LARGEST = 50_000_000


class Artifacts(OfThisProcess):
    """The `artifact` fixture of one case.

    Each file is an effect with its hash: a replay has to produce the same bytes.

    Args:
        steps: knows the case.
        effects: where it is recorded.
        journal: where events are written.
        folder: the folder of attachments.
        made: the files that cases of this run have created; those created here are added.
    """

    said = "`artifact`"

    def __init__(self, steps: Steps, effects: Effects, journal: EventSink, folder: Path, made: set[Path]) -> None:
        self._steps = steps
        self._effects = effects
        self._journal = journal
        self._folder = folder
        self._made = made
        self._kept: set[str] = set()

    def __call__(self, name: str, content: str | bytes) -> None:
        """Keep a file, such as a calibration, a table or a drawing. Text is stored as UTF-8.

        Raises:
            Misused: for a name that is not a plain file name or is in use already, or content that is neither text nor
                bytes, or too large.
        """
        data = self._data(name, content)
        digest = hashlib.sha256(data).hexdigest()
        arguments = {"bytes": len(data), "sha256": digest}
        self._effects.perform(f"artifact.{name}", "records", arguments, lambda: self._keep(name, data, digest))

    def _data(self, name: object, content: object) -> bytes:
        if problem := name_problem(name, file=True):
            raise Misused(f"artifact {name!r}: not a valid file name: {problem}", "give it another name")
        if not isinstance(content, str | bytes):
            what = type(content).__name__
            raise Misused(f"artifact '{name}': the content is a {what}", "give text or bytes")
        data = content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
        if len(data) > _LARGEST:
            raise Misused(f"artifact '{name}': {len(data)} bytes are more than {_LARGEST}", "record large data instead")
        return data

    def _keep(self, name: str, data: bytes, digest: str) -> str:
        if name.casefold() in self._kept:
            problem = "this case already keeps a file of that name, whose letters may be larger or smaller"
            raise Misused(f"artifact '{name}': {problem}", "use another name")
        self._kept.add(name.casefold())
        path = self._free(name, data)
        write_whole(path, data)
        made = events.Attachment(file=path.name, sha256=digest, by=self._steps.case, text="made by the case")
        self._journal.write(made)
        return path.name

    def _free(self, name: str, data: bytes) -> Path:
        """Return a path that no earlier attempt and no case with a similar name has taken.

        A resumed run repeats the files that it created before it was interrupted.
        """
        stem = file_part(self._steps.case)
        names = chain([f"{stem}-{name}"], (f"{stem}-{number}-{name}" for number in count(2)))
        path = next(path for path in map(self._folder.joinpath, names) if self._is_free(path, data))
        self._made.add(path)
        return path

    def _is_free(self, path: Path, data: bytes) -> bool:
        """Return whether no other file has this name, ignoring case."""
        name = path.name.casefold()
        there = [each for each in self._folder.iterdir() if each.name.casefold() == name]
        made = any(each.name.casefold() == name for each in self._made)
        return not made and (not there or (there == [path] and read_plain(path) == data))
