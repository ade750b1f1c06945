"""Events of the files and the code that a run uses: what was frozen, and what was executed."""

from collections.abc import Mapping
from typing import ClassVar

from hil.evidence.events.event import Event, Origin

__all__ = ["Executed", "Frozen", "FrozenLater"]


class Frozen(Event, frozen=True, kw_only=True):
    """Files were frozen before the first step; the second event.

    Attributes:
        files: path and SHA-256 of every frozen file that is the same in equal runs.
    """

    files: Mapping[str, str]


class FrozenLater(Event, frozen=True, kw_only=True):
    """A file of the workspace was frozen when code of the run first imported or opened it, after the run had begun.

    Attributes:
        file: its path in the package.
        sha256: its hash.
        case: the case that used it, empty between cases.
        reaches: what its code reaches for beyond what cases are given, a sentence each.
    """

    file: str
    sha256: str
    case: str
    reaches: tuple[str, ...] = ()

    synced: ClassVar[bool] = True


class Executed(Event, frozen=True, kw_only=True):
    """The code that a run on hardware has executed so far was compared with what was installed.

    Attributes:
        packages: the packages whose code was executed, with their versions, except hil and its dependencies.
        problems: why some of it is unknown, a sentence each.
        last: whether this is the comparison of everything, at the end of the run.
    """

    packages: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    last: bool = False

    origin: ClassVar[Origin] = Origin.OUTSIDE
    synced: ClassVar[bool] = True
