"""What a role is: one object says all that the bench file, the executive and the guardian have to know of it."""

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
    """One argument of an operation: whether it takes a number, or a whole one, and its unit, empty if it has none."""

    name: str
    number: bool
    unit: str
    whole: bool = False


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation of a role.

    Attributes:
        name: what cases call.
        function: of the role's protocol, for its signature and its words.
        drives: whether it changes the bench; else it only reads.
        begins: whether it begins something, and is never issued again without its case.
        arguments: by name, in their order.
        unit: of the figure that it returns, empty if it returns none.
        signature: of the function.
        effect: what the journal calls it: `drives` or `reads`.
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
    """One kind of thing that a case can ask for; entry points of the group `hil.roles` name objects of this class.

    Attributes:
        name: what bench files and cases call it.
        protocol: the class that a driver's object looks like. Its operations are those that are marked as driving or
            reading (`hil.instruments.marks`); units stand in `Annotated[float, "V"]`.
        quantities: what ratings, clamps, envelope and proofs may name of it, and the unit; a quantity that is read
            is an operation of the same name.
        states: what safe-off, rest and hold may name, and the operation without arguments that leads there.
        hazardous: whether its outputs can do harm: they belong into the safe-off and need cut paths.
        clamped: the quantities that such an output must have clamps for.
        proven: whether its line in the safe-off needs a proof.
        part: the argument that distinguishes the parts of one output, such as `contact`; each is driven by itself.
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
        """Every operation by its name, sorted."""
        members = inspect.getmembers(self.protocol, callable)
        return MappingProxyType({name: _operation(name, each) for name, each in members if hasattr(each, "effect")})


def problem_with(name: str, role: object) -> str:
    """Return why an object is not the role of that name, empty if it is."""
    if not isinstance(role, Role):
        return f"is {role!r:.80}, not a role"
    if role.name != name:
        return f"calls itself '{role.name}'"
    try:
        operations = role.operations
    except Exception as error:  # noqa: BLE001 - annotations of somebody's protocol can raise anything
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
        drives=function.effect == "drives",  # type: ignore[attr-defined]  # only marked functions come here
        begins=hasattr(function, "begins"),
        arguments=MappingProxyType(arguments),
        unit=_unit(hints.get("return")),
        signature=signature,
    )


def _argument(name: str, hint: object) -> Argument:
    kind = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return Argument(name=name, number=kind is float, unit=_unit(hint), whole=kind is int)


def _unit(hint: object) -> str:
    """Return the unit that an annotation holds, those of a tuple with commas, also where the value is optional."""
    if get_origin(hint) is Annotated:
        return str(get_args(hint)[1])
    return ", ".join(unit for unit in map(_unit, get_args(hint)) if unit)
