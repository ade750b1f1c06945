"""Datasets and attributes of HDF5 files by h5py's lower interface, which takes a third of the time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Dataset", "add_dataset", "describe", "listed_words", "open_dataset", "read_part", "write_part"]

Dataset = Any
"""An open dataset of one dimension; h5py publishes no types."""

_CHUNK = 16_384
_SMALL = 1_024
"""Up to this many rows a dataset is stored as it is: chunks and compression would make it larger."""


def add_dataset(group: Any, name: str, rows: int) -> Dataset:  # noqa: ANN401 - h5py publishes no types
    """Add a dataset of little-endian float64, shape (rows,), to an open file or group; a large one is compressed."""
    from h5py import h5d, h5s, h5t  # noqa: PLC0415 - slow to import

    chunk = min(rows, _CHUNK) if rows > _SMALL else 0
    space = h5s.create_simple((rows,))
    return h5d.create(group.id, name.encode(), h5t.IEEE_F64LE, space, _made(chunk), dapl=_access())


def open_dataset(group: Any, name: str) -> Dataset:  # noqa: ANN401 - h5py publishes no types
    """Open a dataset of an open file or group.

    Raises:
        KeyError: if there is no such dataset.
    """
    from h5py import h5d  # noqa: PLC0415 - slow to import

    return h5d.open(group.id, name.encode(), _access())


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
    """Give an open file or dataset attributes: words, numbers, flags, lists of words; None is left out.

    Args:
        thing: the lower identifier of h5py.
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
    """Return the words of an attribute that lists some.

    Args:
        thing: the lower identifier of h5py.
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
    return [word.decode() for word in array]


@cache
def _made(chunk: int) -> Any:  # noqa: ANN401 - h5py publishes no types
    """Return how a dataset is stored: in compressed chunks of so many rows, or as it is where that is 0."""
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
    """Return how a dataset is read and written: two chunks are kept, so that a long one takes no more memory."""
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
    """Return the types of an attribute in the file and in memory; looking them up takes longer than writing it."""
    from h5py import h5t  # noqa: PLC0415 - slow to import

    return h5t.py_create(dtype, logical=True), h5t.py_create(dtype)


def _spaces(dataset: Dataset, start: int, rows: int) -> tuple[Any, Any]:
    """Return what to take in memory and in the file: everything, or a stretch of rows.

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
