"""Datasets and attributes of HDF5 files through h5py's low-level API, which takes a third of the time."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Dataset",
    "add_dataset",
    "describe",
    "have_room",
    "listed_words",
    "open_dataset",
    "read_part",
    "require_own",
    "told_by_number",
    "told_of",
    "write_part",
]

Dataset = Any
"""An open one-dimensional dataset; h5py publishes no types."""

_CHUNK = 16_384
_SMALL = 1_024
"""Up to this many rows a dataset is stored contiguously: chunks and compression would make it larger."""

_HEAD_BYTES = 64_000
"""Upper bound of a file's size without its datasets."""
_COLUMN_BYTES = 8 * _CHUNK + 16_000
"""Upper bound of a dataset's overhead: the rest of its last chunk, its index and its attributes."""


def have_room(path: Path, rows: int, columns: int) -> None:
    """Check that the disk has room for all that the file may take: HDF5 without space may end the process.

    Raises:
        OSError: if it has not.
    """
    with path.open("wb") as stream:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(stream.fileno(), 0, _HEAD_BYTES + columns * (_COLUMN_BYTES + 8 * rows))


@contextmanager
def told_by_number() -> Iterator[None]:
    """Raise errors of the disk as OSError; h5py raises them as RuntimeError when it closes a file."""
    try:
        yield
    except RuntimeError as error:
        if number := re.search(r"errno = (\d+)", str(error)):
            raise OSError(int(number[1]), os.strerror(int(number[1]))) from error
        raise


def add_dataset(group: Any, name: str, rows: int) -> Dataset:  # noqa: ANN401 - h5py publishes no types
    """Add a dataset of little-endian float64, shape (rows,), to an open file or group; a large one is compressed."""
    from h5py import h5d, h5s, h5t  # noqa: PLC0415 - slow to import

    chunk = min(rows, _CHUNK) if rows > _SMALL else 0
    space = h5s.create_simple((rows,))
    return h5d.create(group.id, name.encode(), h5t.IEEE_F64LE, space, _made(chunk), dapl=_access())


def open_dataset(group: Any, name: str) -> Dataset:  # noqa: ANN401 - h5py publishes no types
    """Open a dataset of an open file or group; all its numbers must be in that file itself.

    Raises:
        KeyError: if there is no such dataset.
        ValueError: if its numbers are elsewhere, or need a third-party filter.
    """
    from h5py import h5d, h5t  # noqa: PLC0415 - slow to import

    require_own(group, name)
    dataset = h5d.open(group.id, name.encode(), _access())
    made = dataset.get_create_plist()
    if made.get_external_count():
        raise ValueError(f"the numbers of '{name}' are in another file")
    if made.get_layout() == h5d.VIRTUAL:
        raise ValueError(f"'{name}' is a view of other datasets")
    if foreign := {made.get_filter(place)[0] for place in range(made.get_nfilters())} - _filters():
        raise ValueError(f"'{name}' is stored with a filter that no recording has: {min(foreign)}")
    if dataset.get_type() != h5t.IEEE_F64LE:
        raise ValueError(f"'{name}' does not hold numbers of 64 bits, little-endian")
    return dataset


def require_own(group: Any, name: str) -> None:  # noqa: ANN401 - h5py publishes no types
    """Require that a name in an open file or group is an object of this file, and not a link.

    Raises:
        KeyError: if there is no such name.
        ValueError: if it is a link to another place or file; it is not followed.
    """
    from h5py import h5l  # noqa: PLC0415 - slow to import

    if group.id.links.get_info(name.encode()).type != h5l.TYPE_HARD:
        raise ValueError(f"'{name}' is a link to another place")


def told_of(thing: Any) -> dict[str, Any]:  # noqa: ANN401 - h5py publishes no types
    """Return the attributes of an open file or dataset: words, numbers, flags, lists of words.

    Raises:
        ValueError: for one of another type, such as a reference to an object.
    """
    from h5py import h5a, h5t  # noqa: PLC0415 - slow to import

    found: dict[str, Any] = {}
    for place in range(h5a.get_num_attrs(thing)):
        attribute = h5a.open(thing, index=place)
        name, kind = attribute.name.decode(), attribute.get_type().get_class()
        if kind not in {h5t.INTEGER, h5t.FLOAT, h5t.STRING, h5t.ENUM}:
            raise ValueError(f"attribute '{name}' is neither a word nor a number")
        if kind == h5t.STRING:
            words = listed_words(thing, name)
            found[name] = words if attribute.shape else words[0]
        else:
            found[name] = _number(attribute)
    return found


def _number(attribute: Any) -> Any:  # noqa: ANN401 - h5py publishes no types
    import numpy as np  # noqa: PLC0415 - slow to import

    values = np.empty(attribute.shape, attribute.dtype)
    attribute.read(values)
    return values.item() if not attribute.shape else values.tolist()


@cache
def _filters() -> frozenset[int]:
    """Return the filters that every HDF5 library has built in."""
    from h5py import h5z  # noqa: PLC0415 - slow to import

    return frozenset({h5z.FILTER_DEFLATE, h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32})


def write_part(dataset: Dataset, start: int, values: NDArray[np.float64]) -> None:
    """Write values of shape (n,) into a dataset, the first of them at row `start`."""
    import numpy as np  # noqa: PLC0415 - slow to import
    from h5py import h5t  # noqa: PLC0415 - slow to import

    if len(values):
        dataset.write(*_spaces(dataset, start, len(values)), np.ascontiguousarray(values, "<f8"), h5t.IEEE_F64LE)


def read_part(dataset: Dataset, start: int, stop: int) -> NDArray[np.float64]:
    """Return the rows from `start` to before `stop` of a dataset, shape (stop - start,)."""
    import numpy as np  # noqa: PLC0415 - slow to import
    from h5py import h5t  # noqa: PLC0415 - slow to import

    values = np.empty(stop - start, "<f8")
    if len(values):
        dataset.read(*_spaces(dataset, start, len(values)), values, h5t.IEEE_F64LE)
    return values


def describe(thing: Any, facts: Mapping[str, Any]) -> None:  # noqa: ANN401 - h5py publishes no types
    """Add attributes to an open file or dataset: words, numbers, flags, lists of words; None is left out.

    Args:
        thing: the low-level identifier of h5py.
        facts: the attributes by name.
    """
    import numpy as np  # noqa: PLC0415 - slow to import
    from h5py import h5a, h5s  # noqa: PLC0415 - slow to import

    one, words = _one(), _words()
    for name, value in facts.items():
        if value is not None:
            array = np.array(value, dtype=words if isinstance(value, str | list) else None)
            stored, held = _kinds(array.dtype)
            space = h5s.create_simple(array.shape) if array.shape else one
            h5a.create(thing, name.encode(), stored, space).write(array, held)


def listed_words(thing: Any, name: str) -> list[str]:  # noqa: ANN401 - h5py publishes no types
    """Return the words of an attribute that is a list of words.

    Args:
        thing: the low-level identifier of h5py.
        name: the attribute's name.

    Raises:
        KeyError: if there is no such attribute.
        OSError: if it holds something else.
    """
    import numpy as np  # noqa: PLC0415 - slow to import
    from h5py import h5a  # noqa: PLC0415 - slow to import

    attribute = h5a.open(thing, name.encode())
    array = np.empty(attribute.shape, dtype=_words())
    attribute.read(array, _kinds(array.dtype)[1])
    return [word.decode() for word in array.ravel()]


@cache
def _made(chunk: int) -> Any:  # noqa: ANN401 - h5py publishes no types
    """Return the creation properties of a dataset: compressed chunks of this many rows, contiguous if 0."""
    from h5py import h5p  # noqa: PLC0415 - slow to import

    made = h5p.create(h5p.DATASET_CREATE)
    made.set_obj_track_times(False)
    if chunk:
        made.set_chunk((chunk,))
        made.set_shuffle()
        made.set_deflate(4)
    return made


@cache
def _access() -> Any:  # noqa: ANN401 - h5py publishes no types
    """Return the access properties of a dataset: two chunks are cached, so that a long one takes no more memory."""
    from h5py import h5p  # noqa: PLC0415 - slow to import

    access = h5p.create(h5p.DATASET_ACCESS)
    access.set_chunk_cache(3, 2 * _CHUNK * 8, 1.0)
    return access


@cache
def _one() -> Any:  # noqa: ANN401 - h5py publishes no types
    from h5py import h5s  # noqa: PLC0415 - slow to import

    return h5s.create(h5s.SCALAR)


@cache
def _words() -> Any:  # noqa: ANN401 - h5py publishes no types
    """Return the type of UTF-8 words of any length."""
    import h5py  # noqa: PLC0415 - slow to import

    return h5py.string_dtype()


@cache
def _kinds(dtype: Any) -> tuple[Any, Any]:  # noqa: ANN401 - h5py publishes no types
    """Return the types of an attribute in the file and in memory; cached, as the lookup takes longer than the write."""
    from h5py import h5t  # noqa: PLC0415 - slow to import

    return h5t.py_create(dtype, logical=True), h5t.py_create(dtype)


def _spaces(dataset: Dataset, start: int, rows: int) -> tuple[Any, Any]:
    """Return the selections in memory and in the file: everything, or a range of rows.

    Raises:
        ValueError: if the dataset has another shape.
    """
    from h5py import h5s  # noqa: PLC0415 - slow to import

    whole = dataset.shape
    if len(whole) != 1 or start + rows > whole[0]:
        raise ValueError(f"a dataset has shape {whole}, and {start + rows} rows were expected")
    if rows == whole[0]:
        return h5s.ALL, h5s.ALL
    stretch = dataset.get_space()
    stretch.select_hyperslab((start,), (rows,))
    return h5s.create_simple((rows,)), stretch
