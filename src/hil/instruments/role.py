"""Definition of a role: everything that the bench file, the executive and the guardian need to know about it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

__all__ = ["Argument", "Operation", "Role", "problem_with"]


@dataclass(frozen=True, slots=True)
class Argument:
    """One argument of an operation: whether it is a number, or an integer, and its unit, empty if it has none."""

    name: str
    number: bool
    unit: str
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation of a role.

    Attributes:
        name: the name that cases call.
        function: the protocol's function, for its signature and docstring.
        drives: whether it changes the bench; otherwise it only reads.
        begins: whether it starts something, so that it is never reissued outside its case.
        arguments: arguments by name, in order.
        unit: unit of the figure that it returns, empty if it returns none.
        signature: signature of the function.
        effect: its kind in the journal: `drives` or `reads`.
    """

    name: str
    function: Callable[..., Any]
    drives: bool
    begins: bool
    arguments: Mapping[str, Argument]
    unit: str
    signature: inspect.Signature
    effect: Literal["drives", "reads"] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "effect", "drives" if self.drives else "reads")


@dataclass(frozen=True, kw_only=True)
class Role:
    """One kind of equipment that a case can request; entry points of the group `hil.roles` name objects of this class.

    Attributes:
        name: its name in bench files and cases.
        protocol: the interface that a driver's object implements. Its operations are marked as driving or reading
            (`hil.instruments.marks`); units are annotated as in `Annotated[float, "V"]`.
        quantities: quantities available to ratings, clamps, envelope and proofs, with their units; a measured one
            is an operation of the same name.
        states: states available to safe-off, rest and hold, with the operation without arguments that leads there.
        hazardous: whether its outputs can do harm, so that they belong in the safe-off and need cut paths.
        clamped: the quantities for which such an output must have clamps.
        proven: whether its line in the safe-off needs a proof.
        part: the argument that selects a part of an output, such as `contact`; parts are driven individually.
    """

    name: str
    protocol: type
    quantities: Mapping[str, str] = field(default_factory=dict)
    states: Mapping[str, str] = field(default_factory=dict)
    hazardous: bool = False
    clamped: tuple[str, ...] = ()
    proven: bool = False
    part: str = ""

    @cached_property
    def operations(self) -> Mapping[str, Operation]:
        """Every operation by name, sorted."""
        members = inspect.getmembers(self.protocol, callable)
        return MappingProxyType({name: _operation(name, each) for name, each in members if hasattr(each, "effect")})


def problem_with(name: str, role: object) -> str:
    """Return why an object is not a valid role of that name, empty if it is."""
    if not isinstance(role, Role):
        return f"is {role!r:.80}, not a role"
    if role.name != name:
        return f"calls itself '{role.name}'"
    try:
        operations = role.operations
    except Exception as error:  # noqa: BLE001 - annotations of a third-party protocol can raise anything
        return f"has operations that cannot be read: {type(error).__name__}: {error}"
    if not operations:
        return "has no operation: mark them with hil.instruments.marks"
    for state, operation in role.states.items():
        if operation not in operations or not operations[operation].drives or operations[operation].arguments:
            return f"comes to its state '{state}' by '{operation}', which is no driving operation without arguments"
    unknown = [quantity for quantity in role.clamped if quantity not in role.quantities]
    return f"has clamps for {', '.join(unknown)}, of which it gives no unit" if unknown else ""


def _operation(name: str, function: Callable[..., Any]) -> Operation:
    hints = get_type_hints(function, include_extras=True)
    signature = inspect.signature(function)
    arguments = {each: _argument(each, hints.get(each)) for each in list(signature.parameters)[1:]}
    return Operation(
        name=name,
        function=function,
        drives=function.effect == "drives",  # type: ignore[attr-defined]  # only marked functions get here
        begins=hasattr(function, "begins"),
        arguments=MappingProxyType(arguments),
        unit=_unit(hints.get("return")),
        signature=signature,
    )


def _argument(name: str, hint: object) -> Argument:
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return Argument(name=name, number=kind is float, unit=_unit(hint), whole=kind is int)


def _unit(hint: object) -> str:
    """Return the unit in an annotation, even of an optional value; those of a tuple are joined by commas."""
    if get_origin(hint) is Annotated:
        return str(get_args(hint)[1])
    return ", ".join(unit for unit in map(_unit, get_args(hint)) if unit)
