"""The kinds and fields in the reference of the evidence package: `python tests/support/events_page.py` writes them."""

from __future__ import annotations

import re
import types
from collections.abc import Iterator, Mapping
from enum import Enum
from inspect import cleandoc
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from hil.evidence.events import Event, Origin, Part
from hil.evidence.events.codec import KINDS

__all__ = ["PAGE", "reference", "with_reference"]

PAGE = Path(__file__).parents[2] / "docs/reference/evidence-package.md"

_BEGIN, _END = "<!-- kinds and fields: from the types of the events -->", "<!-- end of kinds and fields -->"
_HEAD = "| kind, field | JSON | meaning |\n|---|---|---|"
_WORDS = {str: "text", int: "whole number", float: "number", bool: "true, false", Any: "anything"}
_CAUSES = {Origin.COURSE: "", Origin.OUTSIDE: "from outside", Origin.PERSON: "from a person"}


def reference() -> str:
    """Return the tables: one of kinds with their fields, one of the objects inside them."""
    inner: dict[str, type[Part]] = {}
    kinds = [line for name in sorted(KINDS) for line in _lines(KINDS[name], f"**`{name}`**", inner)]
    parts = [line for name in sorted(inner) for line in _lines(inner[name], f"**{name}**", inner)]
    return "\n".join([_HEAD, *kinds, "", "The objects inside them:", "", _HEAD.replace("kind", "object"), *parts])


def with_reference(page: str) -> str:
    """Return the page with the tables as the types have them."""
    before, _, rest = page.partition(_BEGIN)
    _, _, after = rest.partition(_END)
    return f"{before}{_BEGIN}\n{reference()}\n{_END}{after}"


def _lines(kind: type[Part], name: str, inner: dict[str, type[Part]]) -> Iterator[str]:
    summary, told = _documented(kind)
    yield f"| {name} | {_marks(kind)} | {summary} |"
    hints = get_type_hints(kind)
    for field in msgspec.structs.fields(kind):
        if not issubclass(kind, Event) or field.name not in {"seq", "t"}:
            optional = "" if field.required else ", optional"
            yield f"| `{field.name}` | {_json(hints[field.name], inner)}{optional} | {told[field.name]} |"


def _marks(kind: type[Part]) -> str:
    if not issubclass(kind, Event):
        return ""
    return ", ".join(filter(None, [_CAUSES[kind.origin], "synced" if kind.synced else ""]))


def _documented(kind: type[Part]) -> tuple[str, dict[str, str]]:
    """Return the first line of a docstring, and what it says of each attribute."""
    text = cleandoc(kind.__doc__ or "")
    summary, _, attributes = text.partition("\n\nAttributes:\n")
    told = re.findall(r"^    (\w+): (.+(?:\n     .+)*)", attributes, re.MULTILINE)
    lines = {name: re.sub(r"\s+", " ", said) for name, said in told}
    return summary.replace("\n", " "), {name: said[0].upper() + said[1:] for name, said in lines.items()}


def _json(hint: Any, inner: dict[str, type[Part]]) -> str:  # noqa: PLR0911 - one return per kind of type
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in {Union, types.UnionType}:
        found = [_json(each, inner) for each in arguments if each is not types.NoneType]
        return " or ".join(dict.fromkeys([*found, *(["null"] if types.NoneType in arguments else [])]))
    if origin is tuple:
        return f"list of {_json(arguments[0], inner)}"
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return f"object of {_json(arguments[1], inner)}"
    if origin is Literal:
        return ", ".join(f"`{each}`" for each in arguments)
    if isinstance(hint, type) and issubclass(hint, Part):
        inner[hint.__name__] = hint
        return hint.__name__
    if isinstance(hint, type) and issubclass(hint, Enum):
        return ", ".join(f"`{each.value}`" for each in hint)
    return _WORDS[hint]


if __name__ == "__main__":
    PAGE.write_text(with_reference(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
