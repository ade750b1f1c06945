"""Results that know where they come from: what goes into a function of the library stands behind what comes out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hil.model.provenance import Number, Provenance, provenance_of, stamped, within_library

__all__ = ["Samples", "samples", "traced"]

_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")


def traced(function: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """Let a function's results have the provenance of its arguments, however deep that lies in them.

    Without any provenance, as in a notebook with numbers of its own, nothing changes. Inside, numbers and arrays
    compute as plain ones; of nested calls the outermost counts.
    """
    name = function.__name__

    @wraps(function)
    def call(*args: _Given.args, **kwargs: _Given.kwargs) -> _Result:
        if within_library.active():
            return function(*args, **kwargs)
        provenance = provenance_of(args, kwargs)
        if provenance is None:
            return function(*args, **kwargs)
        with within_library():
            result = function(*(_bare(each) for each in args), **{key: _bare(each) for key, each in kwargs.items()})
        return cast("_Result", stamped(result, provenance.through(name), _stamped_array))

    return call


class Samples(np.ndarray[Any, np.dtype[Any]]):
    """An array with its provenance, which parts of it and what NumPy computes of it have, too."""

    provenance: Provenance | None

    def __array_finalize__(self, source: object) -> None:
        self.provenance = getattr(source, "provenance", None)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Compute with plain arrays; the result has the provenance of all that went in."""
        result = getattr(ufunc, method)(*_bare(inputs), **_bare(kwargs))
        return _of(result, (inputs, kwargs), computed=True)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Compute with plain arrays; the result has the provenance of all that went in."""
        return _of(func(*_bare(args), **_bare(kwargs)), (args, kwargs), computed=True)

    def __getitem__(self, key: Any) -> Any:
        """Return a part, or one number, with the provenance of the whole."""
        return _of(self.view(np.ndarray)[_bare(key)], self)

    def __iter__(self) -> Iterator[Any]:
        """Give one number or part after the other, each with the provenance of the whole."""
        return (_of(each, self) for each in self.view(np.ndarray))


def _reduction(name: str) -> Callable[..., Any]:
    """Return a method of arrays that computes as NumPy does, on the plain array."""
    operation = getattr(np.ndarray, name)

    def method(self: Samples, *args: Any, **kwargs: Any) -> Any:
        return _of(operation(self.view(np.ndarray), *_bare(args), **_bare(kwargs)), (self, args, kwargs), computed=True)

    method.__name__, method.__doc__ = name, operation.__doc__
    return method


for _name in ("max", "mean", "min", "prod", "std", "sum", "var"):
    setattr(Samples, _name, _reduction(_name))


def samples(array: NDArray[Any], provenance: Provenance) -> Samples:
    """Return a view of an array that knows where it is from."""
    view = array.view(Samples)
    view.provenance = provenance
    return view


def _of(result: Any, given: object, *, computed: bool = False) -> Any:
    """Return a result of NumPy with the provenance of what went in; plain inside the library."""
    provenance = None if within_library.active() else provenance_of(given)
    if provenance is None:
        return _bare(result)
    if computed:
        provenance = provenance.through("arithmetic of the plan")
    if isinstance(result, tuple):
        return tuple(_of(each, given, computed=computed) for each in result)
    if isinstance(result, float):
        return Number(result, provenance)
    return _stamped_array(result, provenance)


def _stamped_array(thing: Any, provenance: Provenance) -> Any:
    return samples(thing, provenance) if isinstance(thing, np.ndarray) and thing.dtype.kind in "fc" else thing


def _bare(thing: Any) -> Any:
    """Return arguments with plain arrays in place of those with provenance, also in tuples, lists and mappings."""
    kind = type(thing)
    if kind is Samples:
        return thing.view(np.ndarray)
    if kind is tuple or kind is list:
        return kind(_bare(each) for each in thing)
    if isinstance(thing, Mapping) and kind is dict:
        return {key: _bare(each) for key, each in thing.items()}
    return thing
