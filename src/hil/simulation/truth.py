"""Truth sections of a bench file, the true properties of a simulated article, read strictly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from types import MappingProxyType
from typing import TypeVar

from hil.documents.declared import Invalid, validated
from hil.documents.suggest import did_you_mean

__all__ = ["Path", "Truth", "TruthError", "UnknownPlant", "declared", "suggestion", "together"]

Path = tuple[str | int, ...]
_Model = TypeVar("_Model")


class TruthError(ValueError):
    """An error in the simulated part of a bench file.

    Args:
        path: its location, as keys and list positions below `simulated`.
        message: description, in one sentence without a full stop.
        others: further errors of the same section, so that all can be reported at once.
    """

    def __init__(self, path: Path, message: str, others: tuple[TruthError, ...] = ()) -> None:
        super().__init__(f"{'.'.join(str(part) for part in path)}: {message}")
        self.path = path
        self.message = message
        self.others = others


class UnknownPlant(TruthError):
    """A terminal, or the simulated operator's knowledge, refers to an unknown plant.

    Attributes:
        plant: its name; if that plant has errors itself, only those are reported.
    """

    def __init__(self, path: Path, plant: str, known: Sequence[str]) -> None:
        super().__init__(path, f"unknown plant '{plant}'{suggestion(plant, known)}")
        self.plant = plant


def declared(model: type[_Model], values: Mapping[str, object], what: str, path: Path) -> _Model:
    """Parse a section into its model; see `hil.model.notation`.

    Args:
        model: a frozen dataclass.
        values: the section as read.
        what: name of the section, for messages.
        path: its location.

    Raises:
        TruthError: with every error.
    """
    try:
        return validated(model, values, what, path)
    except Invalid as error:
        raise together([TruthError(each.path, each.message) for each in error.problems]) from error


def suggestion(word: str, known: Sequence[str]) -> str:
    """Return `, did you mean 'x'?` for the nearest known word, or the list of known words."""
    return did_you_mean(word, known) or (f"; known are {', '.join(sorted(known))}" if known else "")


class Truth:
    """One truth section. `part` and `wrong` collect errors; `finish` raises them all.

    Args:
        values: the section as read.
        path: its location, for messages.
        usual: defaults inherited from the enclosing section.
        errors: error list of the enclosing section.
    """

    def __init__(
        self,
        values: object,
        path: Path,
        usual: Mapping[str, object] = MappingProxyType({}),
        errors: list[TruthError] | None = None,
    ) -> None:
        self.path = path
        self._usual = usual
        self._errors: list[TruthError] = [] if errors is None else errors
        self._asked: list[str] = []
        self._children: list[Truth] = []
        self._values: Mapping[str, object] = {}
        if isinstance(values, Mapping):
            self._values = values
        else:
            self._errors.append(TruthError(path, f"must be a mapping, found {_described(values)}"))

    def part(self, model: type[_Model]) -> _Model:
        """Parse one part of a section, by the keys that its model declares; see `hil.model.notation`.

        Other keys are left to other readers. Invalid values are collected as errors, and blank in the result.

        Args:
            model: a frozen dataclass.

        Raises:
            TruthError: if nothing usable can be returned.
        """
        keys = [str(each.metadata.get("alias", each.name)) for each in fields(model)]  # type: ignore[arg-type]  # a dataclass
        self._asked += keys
        values = {key: value for key, value in {**self._usual, **self._values}.items() if key in keys}
        try:
            return validated(model, values, str(self.path[-1]) if self.path else "truth", self.path)
        except Invalid as error:
            self._errors += [TruthError(each.path, each.message) for each in error.problems if self._says(each.path)]
            if not isinstance(error.repaired, model):
                raise together(self._errors) from error
            return error.repaired

    def sections(self, key: str) -> dict[str, Truth]:
        """Return the named sections below a key, empty if it is absent; they inherit defaults from this section."""
        self._asked.append(key)
        value = self._values.get(key, {})
        if not isinstance(value, Mapping):
            self.wrong(key, f"must be a mapping, found {_described(value)}")
            return {}
        children = {
            str(name): Truth(item, (*self.path, key, str(name)), self._values, self._errors)
            for name, item in value.items()
        }
        self._children += children.values()
        return children

    def wrong(self, key: str, message: str) -> None:
        """Add an error for a key that only its reader can detect."""
        self._errors.append(TruthError((*self.path, key), message))

    def finish(self) -> None:
        """Refuse unknown keys.

        Raises:
            TruthError: if anything was wrong in this section or below.
        """
        for section in (self, *self._children):
            section.refuse_unknown()
        if self._errors:
            raise together(self._errors)

    def refuse_unknown(self) -> None:
        """Add errors for unknown keys; `finish` does so for the whole section."""
        for key in self._values:
            if key not in self._asked:
                self.wrong(key, f"unknown key '{key}'{suggestion(str(key), self._asked)}")

    def _says(self, path: Path) -> bool:
        """Return whether an error belongs to this section: inherited defaults are reported where they are written."""
        return not self._usual or path[len(self.path) :][:1] in {(key,) for key in self._values}


def _described(value: object) -> str:
    return "a list" if isinstance(value, list | tuple) else repr(value)


def together(errors: Sequence[TruthError]) -> TruthError:
    """Return the first of several errors, with the others attached."""
    first, *others = errors
    first.others = tuple(others)
    return first
