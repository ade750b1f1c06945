"""What a report is made from: a run's events, results, texts and recordings, read without surprises."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from hil.model.errors import EvidenceError
from hil.model.verdict import Verdict

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Body", "Material", "Trace", "flag", "flat", "inner", "inners", "text", "texts", "verdict"]

Body = Mapping[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One channel of a recording: seconds since the bench's epoch and values, both of shape (n,)."""

    name: str
    unit: str
    times: NDArray[np.float64]
    values: NDArray[np.float64]


class Material(Protocol):
    """A run that can be read: a sealed package, or one that is about to be sealed."""

    def run(self) -> str:
        """Return the name of the run."""
        ...

    def stamps(self) -> tuple[str, str]:
        """Return the UTC of the first and of the last event, as ISO 8601; empty where there is none."""
        ...

    def sent(self) -> Mapping[int, str]:
        """Return the UTC at which what came from other terminals was sent, by the sequence number of its event."""
        ...

    def events(self) -> Sequence[Body]:
        """Return the bodies of the journal in order."""
        ...

    def results(self) -> Body:
        """Return what was derived from them."""
        ...

    def text(self, relative: str) -> str:
        """Return a file under `data/`, or an empty text where there is none."""
        ...

    def names(self, folder: str) -> Sequence[str]:
        """Return the sorted names directly within a folder under `data/`."""
        ...

    def traces(self, recording: str) -> Sequence[Trace]:
        """Return the channels of a recording, none where it holds no rows."""
        ...


def text(body: Body, key: str) -> str:
    """Return a field as text, empty where it is absent or null."""
    value = body.get(key)
    return "" if value is None else str(value)


def flag(body: Body, key: str) -> bool:
    """Return whether a field is there and true."""
    return body.get(key) is True


def inner(body: Body, key: str) -> Body:
    """Return a field that is an object, empty where it is absent or null."""
    value = body.get(key)
    return value if isinstance(value, Mapping) else {}


def inners(body: Body, key: str) -> tuple[Body, ...]:
    """Return a field that is a list of objects."""
    value = body.get(key)
    return tuple(item for item in value if isinstance(item, Mapping)) if isinstance(value, list | tuple) else ()


def texts(body: Body, key: str) -> tuple[str, ...]:
    """Return a field that is a list of texts."""
    value = body.get(key)
    return tuple(str(item) for item in value) if isinstance(value, list | tuple) else ()


def verdict(body: Body, key: str = "verdict") -> Verdict:
    """Return a field that is a verdict.

    Raises:
        EvidenceError: where it is none of ours.
    """
    word = text(body, key)
    try:
        return Verdict(word)
    except ValueError:
        raise EvidenceError(
            f"results.json holds the verdict {word!r}, which is none of {', '.join(Verdict)}",
            "read the package with the version of hil that wrote it",
        ) from None


def flat(body: Body, before: str = "") -> Iterable[tuple[str, str]]:
    """Yield every leaf of an object as a dotted name and its text, sorted by name."""
    for key in sorted(body):
        value, name = body[key], f"{before}{key}"
        if isinstance(value, Mapping):
            yield from flat(value, f"{name}.")
        elif isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
            yield from flat({f"{place:03d}": item for place, item in enumerate(value, 1)}, f"{name}.")
        elif isinstance(value, list | tuple):
            yield name, ", ".join(str(item) for item in value)
        else:
            yield name, "" if value is None else str(value)
