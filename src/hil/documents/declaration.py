"""What a model declares at a path: the keys of a section, the words that a value may be, a blank value."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hil.model.notation import UNREADABLE, UNWRITTEN, Path

__all__ = ["Declaration"]

_BLANK: dict[str, object] = {"str": "", "bool": False, "int": 0, "float": 0}
_LISTS = frozenset({"list", "tuple"})
_SECTIONS = frozenset({"dict", "dataclass-args", "model-fields"})


class Declaration:
    """A model as the validation library understood it.

    Args:
        schema: the core schema of the model's type adapter.
    """

    def __init__(self, schema: Mapping[str, Any]) -> None:
        self._shared = {each["ref"]: each for each in schema.get("definitions", ())}
        self._root = schema

    def keys(self, path: Path) -> tuple[str, ...]:
        """Return the keys that the section at a path may have; none if any is allowed, or it is not a section."""
        return tuple(_fields(self._at(path)))

    def is_named(self, path: Path) -> bool:
        """Return whether the part at a path is an entry under a free name."""
        return bool(path) and self._at(path[:-1]).get("type") == "dict"

    def choices(self, path: Path) -> tuple[str, ...]:
        """Return the allowed words for the value at a path; none if any value is allowed."""
        found = self._at(path)
        if found.get("type") == "enum":
            return tuple(str(member.value) for member in found["members"])
        return tuple(str(word) for word in found.get("expected", ()))

    def blank(self, path: Path) -> object:
        """Return a placeholder for a path that the model accepts."""
        found = self._at(path)
        if found.get("type") in _SECTIONS:
            return {}
        if found.get("type") in _LISTS:
            return []
        choices = self.choices(path)
        return choices[0] if choices else _BLANK.get(found.get("type", ""), UNREADABLE)

    def _at(self, path: Path) -> Mapping[str, Any]:
        found = self._inner(self._root)
        for part in path:
            kind = found.get("type")
            if kind == "dict":
                found = found.get("values_schema", {})
            elif kind == "list":
                found = found.get("items_schema", {})
            elif kind == "tuple":
                items = found["items_schema"]
                found = items[min(int(part), len(items) - 1)]
            else:
                found = _fields(found).get(str(part), {})
            found = self._inner(found)
        return found

    def _inner(self, schema: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return what stands inside defaults, references, and functions that look at a value before or after."""
        while "schema" in schema or "schema_ref" in schema:
            schema = schema["schema"] if "schema" in schema else self._shared[schema["schema_ref"]]
        return schema


def _fields(schema: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    fields = schema.get("fields", ())
    named = fields.items() if isinstance(fields, Mapping) else ((each["name"], each) for each in fields)
    keyed = {str(each.get("validation_alias", name)): each["schema"] for name, each in named}
    return {key: inner for key, inner in keyed.items() if not key.startswith(UNWRITTEN["alias"])}
