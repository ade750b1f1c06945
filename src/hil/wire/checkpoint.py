"""Checkpoints: the saved state of a simulated bench, from which another process can continue."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import GenericAlias, UnionType
from typing import Annotated, Any, Protocol, TypeVar, cast, get_args, get_origin, get_type_hints, runtime_checkable

import msgspec

__all__ = ["Checkpoint", "Kept", "Part", "StateError", "Stateful"]

_Type = TypeVar("_Type")
_KEPT = "kept"

Kept = Annotated[_Type, _KEPT]
"""Marks an attribute as part of an object's state: `_inbox: Kept[bytes]`.

It is a value that msgspec can encode (numbers, text, bytes, tuples, lists, dictionaries, dataclasses), a deque or an
array, or a part: an object with its own state, or a list or dictionary of such parts, which must already exist when it
is restored.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checkpoint:
    """State of a simulated bench at a scheduling point.

    Attributes:
        at_ns: bench time in ns.
        operations: number of operations in its transcript.
        state: state of world and lines, as JSON values.
    """

    at_ns: int
    operations: int
    state: Mapping[str, Any]


class StateError(ValueError):
    """A state does not match the object to restore.

    Args:
        message: description of the mismatch.
        path: names of the parts, from the outermost inwards.
    """

    def __init__(self, message: str, path: tuple[str, ...] = ()) -> None:
        super().__init__(f"{'.'.join(path)}: {message}" if path else message)
        self.message = message
        self.path = path


@runtime_checkable
class Part(Protocol):
    """Anything with a state that can be saved and restored."""

    def state(self) -> Any:  # noqa: ANN401 - JSON values of any shape
        """Return the state needed to continue, as JSON values."""
        ...

    def restore(self, state: Any, /) -> None:  # noqa: ANN401 - as above
        """Continue from what `state` returned."""
        ...


class Stateful:
    """Base class of objects whose state is exactly the attributes that the class marks as `Kept`."""

    def state(self) -> Mapping[str, object]:
        """Return everything needed to continue, as JSON values."""
        return {field.name: field.written(getattr(self, field.attribute)) for field in _fields(type(self))}

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned.

        Raises:
            StateError: if a part is missing, unknown, or not of its type.
        """
        fields = _fields(type(self))
        _same_names(state, [field.name for field in fields])
        for field in fields:
            with _at(field.name):
                field.restore(self, state[field.name])
        self.restored()

    def restored(self) -> None:
        """Recompute derived state after a restore."""


@dataclass(frozen=True, slots=True)
class _Value:
    """An attribute saved and restored as a single value."""

    name: str
    attribute: str
    type: Any

    def written(self, value: object) -> object:
        """Return the value as JSON values."""
        return msgspec.to_builtins(value, str_keys=True, enc_hook=_listed)

    def restore(self, owner: object, written: object) -> None:
        """Set the attribute."""
        value = msgspec.convert(written, self.type, str_keys=True, dec_hook=_container)
        # Whatever msgspec ignores or fills in, such as a field unknown to the class, no longer compares equal.
        if _json(self.written(value)) != _json(written):
            raise StateError(f"{written!r:.200} is not what was written")
        setattr(owner, self.attribute, value)


@dataclass(frozen=True, slots=True)
class _Parts:
    """An attribute that holds a part, or a list or dictionary of parts."""

    name: str
    attribute: str

    def written(self, value: object) -> object:
        """Return the states of the parts."""
        if isinstance(value, dict):
            return {str(key): part.state() for key, part in value.items()}
        return [part.state() for part in value] if isinstance(value, list) else cast("Part", value).state()

    def restore(self, owner: object, written: Any) -> None:  # noqa: ANN401 - JSON values of any shape
        """Restore the existing parts."""
        there = getattr(owner, self.attribute)
        if not isinstance(there, dict | list):
            there.restore(written)
            return
        parts = {str(key): part for key, part in (there.items() if isinstance(there, dict) else enumerate(there))}
        states = written if isinstance(there, dict) else {str(place): state for place, state in enumerate(written)}
        _same_names(states, parts)
        for key, part in parts.items():
            with _at(key):
                part.restore(states[key])


def _fields(kind: type) -> tuple[_Value | _Parts, ...]:
    """Return the kept attributes of a class in order of declaration, base classes first."""
    if kind not in _KNOWN:
        hints = get_type_hints(kind, include_extras=True)
        kept = {name: get_args(hint)[0] for name, hint in hints.items() if _KEPT in getattr(hint, "__metadata__", ())}
        _KNOWN[kind] = tuple(
            _Parts(name.lstrip("_"), name) if _is_part(hint) else _Value(name.lstrip("_"), name, hint)
            for name, hint in kept.items()
        )
    return _KNOWN[kind]


_KNOWN: dict[type, tuple[_Value | _Parts, ...]] = {}


def _is_part(hint: Any) -> bool:  # noqa: ANN401 - whatever can be annotated
    if isinstance(hint, type) and get_origin(hint) is None:
        return issubclass(hint, Part)
    if get_origin(hint) is UnionType:
        return all(map(_is_part, get_args(hint)))
    return get_origin(hint) in {dict, list} and _is_part(get_args(hint)[-1])


def _json(value: object) -> object:
    return msgspec.json.decode(msgspec.json.encode(value))


def _listed(value: Any) -> list[Any]:  # noqa: ANN401 - a deque or an array, which msgspec does not know
    return value.tolist() if hasattr(value, "tolist") else list(value)


def _container(hint: Any, written: object) -> object:  # noqa: ANN401 - the type of a deque or an array
    kind, arguments = get_origin(hint), get_args(hint)
    if kind is deque:
        rows: list[Any] = msgspec.convert(written, GenericAlias(list, arguments), str_keys=True)
        return deque(rows)
    from numpy import array, ndarray  # noqa: PLC0415 - most benches keep no array

    if kind is ndarray:
        return array(msgspec.convert(written, list[float]))
    raise TypeError(f"a state cannot be a {hint}: keep plain values, deques, arrays or parts")


def _same_names(state: Mapping[str, object], names: Iterable[str]) -> None:
    known = set(names)
    for name in sorted(known ^ state.keys()):
        raise StateError(f"'{name}' is {'missing' if name in known else 'unknown'}")


@contextmanager
def _at(name: str) -> Iterator[None]:
    """Add the location to a mismatch."""
    try:
        yield
    except StateError as error:
        raise StateError(error.message, (name, *error.path)) from error
    except (ValueError, TypeError, AttributeError) as error:
        raise StateError(str(error), (name,)) from error
