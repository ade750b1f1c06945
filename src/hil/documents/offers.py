"""What installed packages offer by entry point: found without being imported, and refused with the package's name."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import ClassVar, Generic, TypeVar, cast

from hil.documents.suggest import did_you_mean
from hil.model.errors import Refused

__all__ = ["Offers"]

_Offer = TypeVar("_Offer")


class Offers(Generic[_Offer]):
    """Everything that installed packages offer in one group of entry points, by name.

    Our own offers are entry points like any others. An offer is imported on demand, and at most once.

    Args:
        group: the group of entry points, such as `hil.drivers`.
        what: what its offers are, such as `driver`.
        problem: returns why an imported object of this name is none, empty if it is one.
        kind: what an entry point has to name, for the hint.
    """

    _all: ClassVar[list[Offers[object]]] = []

    def __init__(self, group: str, what: str, problem: Callable[[str, object], str], kind: str) -> None:
        self.group = group
        self.what = what
        self._problem = problem
        self._kind = kind
        self._loaded: dict[EntryPoint, _Offer] = {}
        self._all.append(cast("Offers[object]", self))

    @classmethod
    def in_use(cls) -> Iterator[tuple[str, EntryPoint]]:
        """Yield every offer of every group that was imported in this process, after what it is, such as `driver`."""
        for offers in cls._all:
            yield from ((offers.what, point) for point in offers.loaded)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all offers, sorted; none is imported."""
        return tuple(self._found())

    @property
    def loaded(self) -> tuple[EntryPoint, ...]:
        """The entry points of those offers that were imported."""
        return tuple(point for named in self._found().values() for point in named.values() if point in self._loaded)

    def __contains__(self, name: object) -> bool:
        return name in self._found()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> _Offer:
        """Return the offer of that name.

        Raises:
            Refused: there is none, two packages offer one, or it is not what it should be.
        """
        point = self._only(name)
        if point not in self._loaded:
            self._loaded[point] = self._load(point)
        return self._loaded[point]

    def find(self, name: str) -> _Offer | None:
        """Return the offer of that name, None if it would be refused."""
        try:
            return self[name] if name in self._found() else None
        except Refused:
            return None

    def _found(self) -> Mapping[str, Mapping[str, EntryPoint]]:
        return _installed().get(self.group, {})

    def _only(self, name: str) -> EntryPoint:
        points = self._found().get(name, {})
        if not points:
            installed = ", ".join(self.names)
            hint = f"installed are {installed}" if installed else "no package offers any: reinstall hil"
            raise Refused(f"unknown {self.what} '{name}'{did_you_mean(name, self.names)}", hint)
        if len(points) > 1:
            listed = ", ".join(f"{value}{_by(points[value])}" for value in sorted(points))
            raise Refused(f"there are several {self.what}s '{name}': {listed}", "uninstall the packages of all but one")
        return next(iter(points.values()))

    def _load(self, point: EntryPoint) -> _Offer:
        try:
            loaded = point.load()
        except Exception as error:  # importing a third-party module can raise anything
            why = str(error) if isinstance(error, ImportError | AttributeError) else f"{type(error).__name__}: {error}"
            what = f"{self.what} '{point.name}'{_by(point)} cannot be imported: {why}"
            raise Refused(what, "reinstall its package, or repair it") from error
        if problem := self._problem(point.name, loaded):
            raise Refused(
                f"{self.what} '{point.name}'{_by(point)} cannot be used: {point.value} {problem}",
                f"let its entry point in {self.group} name {self._kind}, or uninstall the package",
            )
        return cast("_Offer", loaded)


@cache
def _installed() -> Mapping[str, Mapping[str, Mapping[str, EntryPoint]]]:
    """Return all offers by group, name and value; looking through all packages takes some milliseconds."""
    found: dict[str, dict[str, dict[str, EntryPoint]]] = {}
    everything = entry_points()
    for group in everything.groups:
        for point in sorted(everything.select(group=group), key=_name):
            found.setdefault(group, {}).setdefault(point.name, {})[point.value] = point
    return found


def _name(point: EntryPoint) -> str:
    return point.name


def _by(point: EntryPoint) -> str:
    """Return which package offers it, empty if unknown; the look-up takes milliseconds."""
    return f" (package {point.dist.name} {point.dist.version})" if point.dist else ""
