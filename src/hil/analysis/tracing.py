"""Provenance tracing: results of the library's functions carry the provenance of their arguments."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hil.model.provenance import (
    BY_ITSELF,
    TIMES_ZERO,
    Number,
    Provenance,
    merged,
    provenance_of,
    provenances_in,
    stamped,
    within_library,
)

__all__ = ["Samples", "samples", "traced"]

_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")
_Found = tuple[str, tuple[Provenance, ...]]
"""The name of an argument, and every provenance within it."""


def traced(function: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """Decorate a function so that its results carry the provenance of its arguments, however deeply nested.

    Without any provenance, as for plain numbers in a notebook, nothing changes. Inside the function, numbers and arrays
    are plain ones; of nested calls the outermost counts.
    """
    name, stated_unit = function.__name__, _unit_argument(function)

    @wraps(function)
    def call(*args: _Given.args, **kwargs: _Given.kwargs) -> _Result:
        if within_library.active():
            return function(*args, **kwargs)
        found = [*zip(stated_unit.names, map(provenances_in, args), strict=False)]  # nothing traced takes `*args`
        found += [(key, provenances_in(each)) for key, each in kwargs.items()]
        provenance = merged(*dict.fromkeys(each for _, several in found for each in several))
        if provenance is None:
            return function(*args, **kwargs)
        stated_unit.require(found, args, kwargs)
        data = [each for each in (*args, *kwargs.values()) if type(each) in {tuple, list} and provenance_of(each)]
        provenance = _with_written(provenance, _operands(data, whole=False))
        with within_library():
            result = function(*(_bare(each) for each in args), **{key: _bare(each) for key, each in kwargs.items()})
        return cast("_Result", stamped(result, provenance.without_unit().through(name), _stamped_array))

    return call


_IN_UNIT = frozenset(
    {"base", "baseline", "data", "level", "minus", "plus", "resolution", "samples", "systematic", "top"}
    | {"uncertainty", "value", "values", "zero"}
)
"""Arguments of the library's functions in the unit of the argument `unit`, or else of `values`."""
_OF_LEVELS = frozenset({"mean", "observed", "peak", "rest_mean"})
"""Functions with a unit whose results depend on levels; all others depend only on differences between samples."""


@dataclass(frozen=True, slots=True)
class _UnitArgument:
    """Unit argument of a library function, checked against the unit of the recording."""

    names: tuple[str, ...]
    default: str | None
    of_levels: bool

    def require(self, found: Iterable[_Found], args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Refuse a stated unit that differs from the unit in which the arguments were recorded."""
        units = [(name, each.recorded) for name, several in found for each in several if name in _IN_UNIT]
        known = [(name, each) for name, each in units if each is not None]
        if not known:
            return
        place = self.names.index("unit") if "unit" in self.names else None
        if place is None:
            stated = next((each.text for name, each in known if name == "values"), None)
        else:
            stated = kwargs.get("unit", args[place] if place < len(args) else self.default)
        for _, each in known:
            if isinstance(stated, str):
                each.require(stated, difference=not self.of_levels)


def _unit_argument(function: Callable[..., Any]) -> _UnitArgument:
    code = function.__code__
    names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
    default = (function.__kwdefaults__ or {}).get("unit")
    # A default of 1 only means that no unit was stated.
    return _UnitArgument(names, None if default == "1" else default, function.__name__ in _OF_LEVELS)


_LARGEST_WRITTEN = 8
_PLACES = frozenset({"digitize", "histogram", "interp", "percentile", "quantile", "searchsorted"})
"""NumPy functions whose plain arrays are positions, not values: a grid of times, bin edges."""
_FILLED = frozenset({"empty_like", "full_like", "ones_like", "zeros_like"})
_WRITING = frozenset({"copyto", "fill_diagonal", "place", "put", "put_along_axis", "putmask"})
_WHOLE = frozenset({"append", "clip", "full_like", "insert", "nan_to_num", "select", "where"})
"""NumPy functions whose integer arguments are values; those of others are axes, orders and indices."""
_SHIFTING = frozenset({"add", "diff", "ediff1d", "nanstd", "ptp", "std", "subtract"})
_SAME_UNIT = frozenset(
    {"absolute", "amax", "amin", "append", "array_split", "atleast_1d", "atleast_2d", "average", "clip", "column_stack"}
    | {"concatenate", "copy", "delete", "expand_dims", "fabs", "flip", "fmax", "fmin", "hstack", "max", "maximum"}
    | {"mean", "median", "min", "minimum", "moveaxis", "nan_to_num", "nanmax", "nanmean", "nanmedian", "nanmin"}
    | {"nanpercentile", "nanquantile", "negative", "percentile", "positive", "quantile", "ravel", "reshape", "roll"}
    | {"sort", "split", "squeeze", "stack", "take", "transpose", "unique", "vstack", "where"}
)
"""NumPy functions whose results keep the unit of their arguments; those of others may be in any unit."""
_CANCELLING = frozenset({np.subtract, np.divide, np.floor_divide})
_SHAPE_ONLY = "only the shape of a recording is left: its samples were filled by the plan"
_OWN_ARRAY = "the plan itself made an array that stands behind it"
_WROTE = "the plan wrote values into the samples"


class Samples(np.ndarray[Any, np.dtype[Any]]):
    """An array with provenance, inherited by its parts and by NumPy's results."""

    _own: Provenance | None
    _wrote: list[Provenance]

    def __array_finalize__(self, source: object) -> None:
        self._own = getattr(source, "_own", None)
        wrote: list[Provenance] = getattr(source, "_wrote", [])
        self._wrote = [*wrote] if self.flags.owndata else wrote  # views of the same memory share the list

    @property
    def provenance(self) -> Provenance | None:
        """Origin of the array, including what was written into it or into arrays that share its memory."""
        return merged(self._own, *self._wrote) if self._wrote else self._own

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Compute with plain arrays; the result has the provenance of all operands."""
        result = getattr(ufunc, method)(*_bare(inputs), **_bare(kwargs))
        if within_library.active():
            return _bare(result)
        keeps = _keeps(ufunc.__name__) if method == "__call__" else Provenance.without_unit
        operands = inputs if method in {"__call__", "outer", "at"} else ()
        found = _computed(inputs, operands, keeps).but(*_nothing(ufunc, inputs))
        for each in (*kwargs.get("out", ()), *(inputs[:1] if method == "at" else ())):
            if isinstance(each, Samples):
                each.take_note(found if found.sources else found.but(_WROTE))
        return _with(result, found)

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Compute with plain arrays; the result has the provenance of all operands."""
        result = func(*_bare(args), **_bare(kwargs))
        if within_library.active():
            return _bare(result)
        name = func.__name__
        given = (*args, *kwargs.values())
        if name in _WRITING and args and isinstance(args[0], Samples):
            args[0].take_note((provenance_of(given[1:]) or Provenance()).but(_WROTE))
        operands = () if name in _PLACES else _operands(given, whole=name in _WHOLE)
        found = _computed(given, operands, _keeps(name))
        made = _with(result, found.but(_SHAPE_ONLY) if name in _FILLED else found)
        for each in args:
            if (
                isinstance(each, Samples)
                and isinstance(made, Samples)
                and np.may_share_memory(_bare(each), _bare(made))
            ):
                made._wrote = each._wrote  # noqa: SLF001 - both share the memory
        return made

    def __getitem__(self, key: Any) -> Any:
        """Return a part or a single number with the provenance of the whole."""
        part = _with(self.view(np.ndarray)[_bare(key)], None if within_library.active() else self.provenance)
        if isinstance(part, Samples):
            part._wrote = self._wrote  # noqa: SLF001 - it shares the memory
        return part

    def __setitem__(self, key: Any, value: Any) -> None:
        """Write into a copy of the recording; only NaN, which excludes samples, keeps its evidential value."""
        self.view(np.ndarray)[_bare(key)] = _bare(value)
        if not within_library.active() and not (isinstance(value, float) and np.isnan(value)):
            self.take_note(provenance_of(value) or Provenance(unproven=(_WROTE,)))

    def fill(self, value: Any) -> None:
        """Write one value into all samples."""
        self[...] = value

    def take_note(self, provenance: Provenance) -> None:
        """Note the provenance of a value written into it."""
        self._wrote.append(provenance)

    def __iter__(self) -> Iterator[Any]:
        """Yield numbers or parts one by one, each with the provenance of the whole."""
        return (self[place] for place in range(len(self)))


def _keeps(name: str) -> Callable[[Provenance], Provenance]:
    """Return how a NumPy function or array method affects the recorded unit of its arguments."""
    if name in _SHIFTING:
        return Provenance.of_difference
    return _as_it_is if name in _SAME_UNIT else Provenance.without_unit


def _as_it_is(provenance: Provenance) -> Provenance:
    return provenance


def _reduction(name: str) -> Callable[..., Any]:
    """Return an array method that applies NumPy's own to the plain array."""
    operation, keeps = getattr(np.ndarray, name), _keeps(name)

    def method(self: Samples, *args: Any, **kwargs: Any) -> Any:
        result = operation(self.view(np.ndarray), *_bare(args), **_bare(kwargs))
        return _bare(result) if within_library.active() else _with(result, _computed((self, args, kwargs), (), keeps))

    method.__name__, method.__doc__ = name, operation.__doc__
    return method


for _name in ("cumprod", "dot", "max", "mean", "min", "prod", "std", "sum", "var"):
    setattr(Samples, _name, _reduction(_name))


def samples(array: NDArray[Any], provenance: Provenance) -> Samples:
    """Return a view of an array with a provenance."""
    view = array.view(Samples)
    view._own, view._wrote = provenance, []  # noqa: SLF001 - made here
    return view


def _computed(given: object, operands: Iterable[Any], keeps: Callable[[Provenance], Provenance]) -> Provenance:
    """Return the provenance of a result computed by the plan, including the plan's own numbers and arrays."""
    found = keeps(provenance_of(given) or Provenance())
    return _with_written(found.through("arithmetic of the plan"), operands)


def _with_written(found: Provenance, operands: Iterable[Any]) -> Provenance:
    """Return a provenance extended by the operands that the plan wrote or made itself."""
    for each in operands:
        if type(each) is not np.ndarray or each.dtype.kind not in "fciu":
            found = found.with_numbers(each)
        elif each.size <= _LARGEST_WRITTEN:
            found = found.with_numbers(*each.ravel().tolist())
        else:
            found = found.but(_OWN_ARRAY)
    return found


def _operands(given: Iterable[Any], *, whole: bool) -> Iterator[Any]:
    """Yield the numbers and arrays behind a result, also within lists; integers may be indices and axes."""
    for each in given:
        if isinstance(each, tuple | list):
            yield from _operands(each, whole=whole)
        elif isinstance(each, float) or whole or (isinstance(each, np.ndarray) and each.dtype.kind in "fc"):
            yield each


def _nothing(ufunc: np.ufunc, inputs: tuple[Any, ...]) -> tuple[str, ...]:
    """Return why this operation leaves nothing of the recording, empty if it does not."""
    if len(inputs) != 2:
        return ()
    one, other = (np.asarray(_bare(each)) for each in inputs)
    if ufunc is np.multiply and any(provenance_of(each) is None and not np.any(each) for each in inputs):
        return (TIMES_ZERO,)
    if ufunc in {np.power, np.float_power} and not other.any():
        return (TIMES_ZERO,)
    where = [(each.__array_interface__["data"], each.shape, each.strides) for each in (one, other)]
    return (BY_ITSELF,) if ufunc in _CANCELLING and where[0] == where[1] else ()


def _with(result: Any, provenance: Provenance | None) -> Any:
    """Return a NumPy result with this provenance."""
    if provenance is None:
        return _bare(result)
    if isinstance(result, tuple):
        return tuple(_with(each, provenance) for each in result)
    if isinstance(result, float):
        return Number(result, provenance)
    return _stamped_array(result, provenance)


def _stamped_array(thing: Any, provenance: Provenance) -> Any:
    return samples(thing, provenance) if isinstance(thing, np.ndarray) and thing.dtype.kind in "fc" else thing


def _bare(thing: Any) -> Any:
    """Return arguments with provenance stripped from arrays, also within tuples, lists and mappings."""
    kind = type(thing)
    if kind is Samples:
        return thing.view(np.ndarray)
    if kind is tuple or kind is list:
        return kind(_bare(each) for each in thing)
    if isinstance(thing, Mapping) and kind is dict:
        return {key: _bare(each) for key, each in thing.items()}
    return thing
