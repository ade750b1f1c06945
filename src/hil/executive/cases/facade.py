"""Façades: what a case holds instead of a driver's role."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from numbers import Real
from types import MappingProxyType
from typing import Any, Protocol, TypeVar

from hil.documents.suggest import did_you_mean
from hil.executive.cases.certificate import calibrated, uncovered
from hil.executive.cases.effects import Effects
from hil.executive.cases.escapes import OfThisProcess
from hil.instruments.registry import ROLES
from hil.instruments.role import Operation
from hil.instruments.sampled import Captured, ReadBacks, Sampled, Streamed
from hil.model.bench import BenchSpec, InstrumentSpec, Wire
from hil.model.errors import ClampExceeded, DeviceFault, HilError, Misused, Refused
from hil.model.figure import Figure
from hil.model.provenance import Provenance, stamped

__all__ = ["Facade", "RoleSet", "UsingCase", "facades"]

_NOT_DONE = (ClampExceeded, Misused, Refused)
"""Errors raised instead of beginning an operation."""

_Result = TypeVar("_Result")


class UsingCase(Protocol):
    """The case that holds a façade."""

    def point(self) -> None:
        """Pass a scheduling point."""
        ...

    def uses(self, instrument: InstrumentSpec) -> None:
        """Note that the case uses this instrument."""
        ...

    def fault(self, instrument: InstrumentSpec, fault: DeviceFault) -> None:
        """Note silence or nonsense of a device, before the case learns of it."""
        ...

    def refused(self, error: HilError) -> None:
        """Note a refused request, before the case learns of it."""
        ...


class Facade(OfThisProcess):
    """One role instance as a case sees it.

    Every operation of the role is a scheduling point and an effect; readings carry the uncertainty of the instrument's
    certificate, and every result carries its provenance, even if it comes from a journal.

    Args:
        wire: the role instance.
        instrument: the instrument behind it.
        role: the driver's object.
        effects: where operations are performed and recorded.
        case: the case that holds it.
        instruments: every instrument of the bench by name: the one that fails may be on the way to this one.
    """

    said = "a role"

    wire: Wire
    instrument: InstrumentSpec
    _role: object
    _effects: Effects
    _case: UsingCase
    _instruments: Mapping[str, InstrumentSpec]
    _operations: Mapping[str, Operation]

    def __init__(
        self,
        wire: Wire,
        instrument: InstrumentSpec,
        role: object,
        effects: Effects,
        case: UsingCase,
        instruments: Mapping[str, InstrumentSpec] = MappingProxyType({}),
    ) -> None:
        self.__dict__.update(
            wire=wire,
            instrument=instrument,
            _role=role,
            _effects=effects,
            _case=case,
            _instruments=instruments,
            _operations=ROLES[wire.role].operations,
        )

    def __getattr__(self, name: str) -> Callable[..., Any]:
        operations: Mapping[str, Operation] = self.__dict__.get("_operations", {})
        if name not in operations:
            hint = did_you_mean(name, operations)
            raise AttributeError(f"{self.__dict__['wire'].name} has no operation '{name}'{hint}")
        bound = self.__dict__[name] = self._bound(operations[name])  # cached: a case uses it again and again
        return bound

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{self.wire.name} is what the bench file says, its '{name}' cannot be changed")

    def __repr__(self) -> str:
        return f"<{self.wire.name} on {self.instrument.name}>"

    def serves(self, effects: Effects) -> bool:
        """Return whether this is a role of the case with these effects."""
        return self._effects is effects

    @cached_property
    def sampled(self) -> Sampled:
        """The role as `record` samples it; samples go to the recording, not into effects."""
        if hasattr(self._role, "sample"):
            return self._role  # type: ignore[return-value]  # the attribute was checked
        if not ROLES[self.wire.role].quantities:
            raise TypeError(f"{self.wire.name} has no channels that could be recorded")
        return ReadBacks(ROLES[self.wire.role], self._role)

    @property
    def streamed(self) -> Streamed | None:
        """The role as `record` streams from it, None if it cannot stream."""
        able = hasattr(self._role, "drain") and getattr(self._role, "streams", True)
        return self._role if able else None  # type: ignore[return-value]  # the attributes were checked

    @property
    def alone(self) -> bool:
        """Whether `record` must stream from it on its own."""
        return self.streamed is not None and not getattr(self._role, "can_be_asked", False)

    @property
    def captured(self) -> Captured | None:
        """The role as `record.capture` reads it, None if it cannot capture."""
        return self._role if hasattr(self._role, "blocks") else None  # type: ignore[return-value]  # it was checked

    def sample(self) -> tuple[float, ...]:
        """Take one sample; a fault is reported before it is raised."""
        return self.guarded(self.sampled.sample)

    def _bound(self, operation: Operation) -> Callable[..., Any]:
        name, signature, kind = operation.name, operation.signature, operation.effect
        what = f"{self.wire.name}.{name}"

        def call(*args: object, **kwargs: object) -> object:
            try:
                arguments = signature.bind(self, *args, **kwargs).arguments
            except TypeError as error:
                raise TypeError(f"{what}: {error}") from None
            arguments.pop("self")
            try:
                _require_numbers(what, operation, arguments)
                self._case.point()
                return self._traced(
                    what, self._effects.perform(what, kind, arguments, lambda: self._act(name, arguments))
                )
            except _NOT_DONE as error:
                self._case.refused(error)
                raise

        call.__name__, call.__doc__ = name, operation.function.__doc__
        return call

    def _act(self, name: str, arguments: dict[str, Any]) -> object:
        result = self.guarded(lambda: getattr(self._role, name)(**arguments))
        return calibrated(result, self.instrument.calibration) if isinstance(result, Figure) else result

    def _traced(self, what: str, result: object) -> object:
        """Return the result of an operation with its provenance."""
        figures = [each for each in (result if isinstance(result, tuple) else (result,)) if isinstance(each, Figure)]
        missing = [sentence for each in figures for sentence in uncovered(self.instrument, each.unit, each.value)]
        provenance = Provenance(
            instruments=(self.instrument.name,), sources=(what,), uncovered=tuple(dict.fromkeys(missing))
        )
        self._effects.learnt(provenance)
        return stamped(result, provenance)

    def guarded(self, action: Callable[[], _Result]) -> _Result:
        """Perform an action on the role; a fault is reported before it is raised, against the device it names."""
        self._case.uses(self.instrument)
        try:
            return action()
        except DeviceFault as fault:
            self._case.fault(self._instruments.get(fault.device, self.instrument), fault)
            raise


def _require_numbers(what: str, operation: Operation, arguments: Mapping[str, object]) -> None:
    """Refuse what is not a number where the role requires one; a bool would pass for 0 or 1."""
    for name, value in arguments.items():
        argument = operation.arguments[name]
        if argument.whole and (isinstance(value, bool) or not isinstance(value, int)):
            raise Misused(f"{what}: {name} is a whole number, found {value!r}", "see the role's operations")
        if argument.number and (isinstance(value, bool) or not isinstance(value, Real)):
            hint = (
                "take its value, in the unit of the role" if isinstance(value, Figure) else "see the role's operations"
            )
            raise Misused(f"{what}: {name} is a number, found {value!r}", hint)


class RoleSet:
    """The named instances of one role: `supply.coil`, `supply.sensor`."""

    _role: str
    _instances: dict[str, Facade]

    def __init__(self, role: str, instances: dict[str, Facade]) -> None:
        self.__dict__.update(_role=role, _instances=instances)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{self._role} is what the bench file says, its '{name}' cannot be changed")

    def __getattr__(self, name: str) -> Facade:
        instances: dict[str, Facade] = self.__dict__.get("_instances", {})
        if name not in instances:
            raise AttributeError(f"no '{name}' among the bench's {self._role}{did_you_mean(name, instances)}")
        return instances[name]

    def __repr__(self) -> str:
        return f"<{self._role}: {', '.join(self._instances)}>"


def facades(
    spec: BenchSpec, roles: Mapping[str, object], effects: Effects, case: UsingCase
) -> Mapping[str, Facade | RoleSet]:
    """Return the façades of one case, by role; a role with several instances is a set.

    Args:
        spec: the bench file.
        roles: the drivers' objects by dotted name.
        effects: where operations are performed and recorded.
        case: the case.
    """
    by_role: dict[str, dict[str, Facade]] = {}
    instruments = {instrument.name: instrument for instrument in spec.instruments}
    for wire in spec.wiring:
        facade = Facade(wire, spec.instrument(wire.instrument), roles[wire.name], effects, case, instruments)
        by_role.setdefault(wire.role, {})[wire.instance] = facade
    return {role: instances[""] if "" in instances else RoleSet(role, instances) for role, instances in by_role.items()}
