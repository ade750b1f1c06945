"""What people provided and were shown: documents with their digests, and pictures that the page embeds."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import PurePath

from hil.evidence.events import Answer, Question
from hil.evidence.folder import ATTACHMENTS
from hil.report.material import Material
from hil.report.numbers import bench_time
from hil.report.page.as_run import Placed
from hil.report.page.view import CaseName, GivenRow

__all__ = ["given_rows"]

_MOST_OF_ONE = 8_000_000
_MOST = 32_000_000
"""A page with all its pictures has to open in a browser."""

_IMAGES = {"png": "image/png", "jpeg": "image/jpeg"}
_STARTS = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpeg"}


def given_rows(events: Iterable[Placed], names: Mapping[str, CaseName], material: Material) -> tuple[GivenRow, ...]:
    """Return a row for each file that was given, and for each picture that a question showed, in order.

    Args:
        events: the journal's.
        names: how cases are named.
        material: where the files are. One that is no longer what the journal names is not shown.
    """
    pages = _Pages(material)
    asked: dict[tuple[str, str], Question] = {}
    shown: set[str] = set()
    rows: list[GivenRow] = []
    for each in events:
        event = each.event
        if isinstance(event, Question):
            asked[event.case, event.name] = event
            if event.picture and event.picture.file not in shown:
                shown.add(event.picture.file)
                rows.append(_shown(event, names, pages))
        elif isinstance(event, Answer) and event.file:
            question = asked.get((event.case, event.name))
            rows.append(_given(event, question.text if question else "", names, pages))
    return tuple(rows)


class _Pages:
    """Gives pictures until the page would be too large."""

    def __init__(self, material: Material) -> None:
        self.material = material
        self._left = _MOST

    def image(self, path: str, sha256: str) -> str:
        data = self.material.content(path, min(_MOST_OF_ONE, self._left))
        kind = next((name for start, name in _STARTS.items() if data.startswith(start)), "")
        if not kind or hashlib.sha256(data).hexdigest() != sha256:
            return ""
        self._left -= len(data)
        return f"data:{_IMAGES[kind]};base64,{base64.b64encode(data).decode()}"


def _shown(question: Question, names: Mapping[str, CaseName], pages: _Pages) -> GivenRow:
    picture = question.picture
    path, digest = (picture.file, picture.sha256) if picture else ("", "")
    return GivenRow(
        name=PurePath(path).name,
        file=path,
        what=f"shown with: {question.text}",
        kind="picture of the plan",
        sha256=digest,
        by="",
        witness="",
        when="",
        case=names.get(question.case),
        image=pages.image(path, digest),
    )


def _given(answer: Answer, text: str, names: Mapping[str, CaseName], pages: _Pages) -> GivenRow:
    file = answer.file
    if file is None:
        raise TypeError
    path, stamp = f"{ATTACHMENTS}/{file.file}", pages.material.stamp_of(answer.seq)
    return GivenRow(
        name=file.given,
        file=path,
        what=text,
        kind=f"{file.type.upper() if file.type != 'text' else 'text'}, {_size(file.size)}",
        sha256=file.sha256,
        by=answer.by,
        witness=answer.witness,
        when=", ".join(
            filter(None, (f"{stamp[:10]} {stamp[11:19]} UTC" if stamp else "", f"bench time {bench_time(answer.t)}"))
        ),
        case=names.get(answer.case),
        image=pages.image(path, file.sha256) if file.type in _IMAGES else "",
    )


def _size(size: int) -> str:
    for unit, value in (("MB", 1e6), ("kB", 1e3)):
        if size >= value:
            return f"{size / value:.3g} {unit}"
    return f"{size} bytes"
