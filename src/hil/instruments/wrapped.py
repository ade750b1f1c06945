"""Instruments reachable only through a vendor's driver: a wrapper fills the role, operation by operation.

The vendor's code runs in a separate process (`hil.guardian.ports.hosted`). The calls and results exchanged with it, one
line of JSON each, are recorded in place of bytes. The instrument's own bytes are never visible.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar

from hil.instruments import settings
from hil.instruments.driver import Connection, Outlet
from hil.instruments.registry import DRIVERS, ROLES
from hil.instruments.role import Operation, Role
from hil.instruments.safing import NUMBER, must_be_state, own_bounds
from hil.instruments.sampled import Channel
from hil.model.bench import InstrumentSpec, Proof, Wire
from hil.model.errors import Garbled, NoReply, Refused, Rejected
from hil.model.figure import Figure
from hil.model.identity import Identity
from hil.model.safing import Exchange, GuardedPort, SafeBytes
from hil.wire.opening import VENDOR, bare

__all__ = ["Wrapped", "WrappedOutput", "hosted_port", "is_wrapped"]

_LONGEST_LINE = 65_536
_MOST_STALE = 8
_SAME = 1e-3


class Wrapped:
    """Base driver of an instrument reachable only through a vendor's driver.

    Subclass it, and register the class as an entry point of `hil.drivers`.

    Attributes:
        roles: the roles that the instrument fills.
        made_by: `module:name` of the factory of the object that wraps the vendor's driver; it is called in a separate
            process with the bench file's port, less `visa:` or `vendor:`.
        channels: channel numbers of the instrument; empty where it has no channels.
        quantities: the role's quantities that it can read; all of them if empty.
    """

    roles: ClassVar[frozenset[str]]
    made_by: ClassVar[str]
    channels: ClassVar[tuple[int, ...]] = ()
    quantities: ClassVar[tuple[str, ...]] = ()

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._calls = 0

    def identify(self) -> Identity:
        """Call `identity`: manufacturer, model, serial and firmware, as far as the vendor's driver knows them."""
        told = self.call("identity")
        try:
            return Identity(**{str(key): str(value) for key, value in told.items()})
        except (TypeError, AttributeError) as error:
            raise self._nonsense("identity", told) from error

    def outlets(self) -> Sequence[Outlet]:
        """Call `enabled` for every channel, if the role has it."""
        if not any("enabled" in ROLES[role].operations for role in self.roles):
            return ()
        return tuple(Outlet(each, bool(self.call("enabled", channel=each))) for each in self.channels or (0,))

    def role(self, wire: Wire) -> WrappedOutput:
        """Return the object that fills the wire's role."""
        settings.fits(wire, type(self).__name__, self.roles, self.channels)
        settings.read(wire, settings.NoSettings)
        role = ROLES[wire.role]
        if why := _why_not_wrapped(role):
            raise Refused(f"wiring {wire.name}: the role {wire.role} cannot be wrapped, {why}", "write a driver for it")
        return WrappedOutput(self, self._connection, wire, role)

    def call(self, name: str, arguments: dict[str, Any] | None = None, *, channel: int = 0) -> Any:  # noqa: ANN401 - JSON
        """Call an operation on the vendor's side and return its result; replies to earlier calls are skipped.

        Raises:
            NoReply: the call does not return in time, or the vendor's driver got no reply.
            Rejected: the vendor's driver raised an error.
            Garbled: the reply is malformed.
        """
        device, port = self._connection.device, self._connection.port
        if port is None:
            raise Refused(f"{device}: a wrapped instrument needs a port", "give it one in the bench file")
        self._calls += 1
        port.timeout = self._connection.timeout
        port.write(call_of(name, self._calls, arguments, channel))
        for _ in range(_MOST_STALE):
            line = port.read_line(b"\n", _LONGEST_LINE)
            if not line.endswith(b"\n"):
                break
            told = self._read(name, line)
            if told.get("number") == self._calls:
                return self._result(name, told)
        raise NoReply(device, f"{name} has not returned after {self._connection.timeout:g} s", "see 'timeout'")

    def _read(self, name: str, line: bytes) -> dict[str, Any]:
        try:
            told = json.loads(line)
        except ValueError as error:
            raise self._nonsense(name, line) from error
        if not isinstance(told, dict):
            raise self._nonsense(name, line)
        return told

    def _result(self, name: str, told: dict[str, Any]) -> Any:  # noqa: ANN401 - JSON
        device = self._connection.device
        if "silent" in told:
            raise NoReply(device, f"{name}: {told['silent']}", "check its power and its cable")
        if "error" in told:
            raise Rejected(device, f"{name}: {told['error']}", "see the manual of the vendor's driver")
        if "result" not in told:
            raise self._nonsense(name, told)
        return told["result"]

    def _nonsense(self, name: str, told: object) -> Garbled:
        return Garbled(self._connection.device, f"{name} returned {told!r:.80}", f"correct {self.made_by}")


class WrappedOutput:
    """A role filled through a vendor's driver: every operation is a call of the same name.

    Where the role has clamps, a setting needs one, is checked against it before it is sent, and is compared with
    `settings` afterwards. An operation without arguments, such as `enable`, first checks the present settings against
    the clamps. The wrapped object's `in_state(state)` reports whether it is in a safe state.

    Args:
        driver: the driver.
        connection: its connection.
        wire: the bench file's wire.
        role: the role that it fills.
    """

    def __init__(self, driver: Wrapped, connection: Connection, wire: Wire, role: Role) -> None:
        self._driver = driver
        self._connection = connection
        self._wire = wire
        self._role = role

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - operations of any role
        role: Role | None = self.__dict__.get("_role")
        if role is None or name not in role.operations:
            raise AttributeError(name)
        operation = role.operations[name]

        def perform(*args: Any, **kwargs: Any) -> Any:  # noqa: ANN401 - of any role
            _, *given = operation.signature.bind(self, *args, **kwargs).arguments.items()
            return self._perform(operation, dict(given))

        perform.effect = operation.effect  # type: ignore[attr-defined]  # as every operation is marked
        return perform

    def channels(self) -> tuple[Channel, ...]:
        """Return a channel for every quantity read."""
        units = self._role.quantities
        return tuple(Channel(name, units[name]) for name in self._driver.quantities or units)

    def sample(self) -> tuple[float, ...]:
        """Read every quantity, one after the other."""
        return tuple([getattr(self, each.name)().value for each in self.channels()])

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the calls that lead to a state and prove it; see `hil.instruments.roles.SafeByBytes`."""
        must_be_state(self._role, self._wire.name, state)
        bounds = {name: own_bounds(self._wire.name, proof, name) for name in self._role.quantities}
        measured = [replace(self._exchange(name, b":" + NUMBER), between=its) for name, its in bounds.items() if its]
        return SafeBytes(
            resync=(Exchange(send=b"\n"),),  # terminates a partial line
            off=(self._exchange(self._role.states[state], b""),),
            proof=(self._exchange("in_state", b":true", {"state": state}), *measured),
            owed_s=0.0,  # every reply names its call
            who=replace(self._exchange("identity", rb":(\{[^\n]*)\n"), send=call_of("identity", "guard identity")),
        )

    def _exchange(self, name: str, result: bytes, arguments: dict[str, Any] | None = None) -> Exchange:
        return Exchange(
            send=call_of(name, f"guard {name}", arguments, self._wire.channel),
            expect=rb'"number":"guard ' + name.encode() + rb'","result"' + result,
            within_s=self._connection.timeout,
        )

    def _perform(self, operation: Operation, arguments: dict[str, Any]) -> Any:  # noqa: ANN401 - of any role
        if not operation.drives:
            return self._measured(operation, self._call(operation.name, arguments))
        state = next((name for name, leads in self._role.states.items() if leads == operation.name), "")
        wanted = {name: value for name, value in arguments.items() if name in self._role.quantities}
        self._permit(self._settings() if self._role.clamped and not arguments and not state else wanted)
        self._call(operation.name, arguments)
        if state and self._call("in_state", {"state": state}) is not True:
            raise self._rejected(f"was to be {state} and is not")
        if wanted:
            self._must_be_set(wanted)
        return None

    def _settings(self) -> dict[str, float]:
        """Return the present settings by quantity; every clamped quantity must be among them."""
        told = self._call("settings")
        missing = [name for name in self._role.clamped if not isinstance(told, dict) or name not in told]
        if missing:
            raise Garbled(self._connection.device, f"settings does not say its {' and '.join(missing)}", "correct it")
        units = self._role.quantities
        return {name: self._figure("settings", told[name], units[name]).value for name in told if name in units}

    def _must_be_set(self, wanted: dict[str, Any]) -> None:
        found = self._settings()
        for name, value in wanted.items():
            if not math.isclose(found.get(name, math.nan), value, rel_tol=_SAME, abs_tol=_SAME):
                raise self._rejected(f"{name} was set to {value:g} and reads back as {found.get(name)}")

    def _permit(self, values: dict[str, Any]) -> None:
        clamps, channel = self._connection.clamps, self._wire.channel
        for name, value in values.items():
            if self._role.clamped and not math.isfinite(clamps.bounds(channel, name)[1]):
                raise Refused(f"{self._wire.name}: {name} needs a clamp", "add one to `clamps` in the bench file")
            clamps.permit(channel, name, value)

    def _measured(self, operation: Operation, result: Any) -> Any:  # noqa: ANN401 - of any role
        units = operation.unit.split(", ") if operation.unit else []
        if len(units) == 1:
            return self._figure(operation.name, result, units[0])
        if units:
            return tuple(self._figure(operation.name, each, unit) for each, unit in zip(result, units, strict=True))
        return tuple(result) if isinstance(result, list) else result

    def _figure(self, name: str, value: object, unit: str) -> Figure:
        if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise Garbled(
                self._connection.device, f"{name} returned {value!r:.80}, not a number of {unit}", "correct it"
            )
        return Figure(value=math.nan if value is None else float(value), unit=unit)

    def _call(self, name: str, arguments: dict[str, Any] | None = None) -> Any:  # noqa: ANN401 - JSON
        return self._driver.call(name, arguments, channel=self._wire.channel)

    def _rejected(self, what: str) -> Rejected:
        return Rejected(self._connection.device, f"{self._wire.name} {what}", "check the instrument's display")


def call_of(name: str, number: int | str, arguments: dict[str, Any] | None = None, channel: int = 0) -> bytes:
    """Return the line of one call."""
    asked: dict[str, Any] = {"number": number, "call": name}
    if arguments:
        asked["arguments"] = arguments
    if channel:
        asked["channel"] = channel
    return json.dumps(asked, separators=(",", ":"), default=float).encode() + b"\n"


def _why_not_wrapped(role: Role) -> str:
    """Return why calls alone cannot fill a role, empty if they can."""
    if role.part:
        return f"because each {role.part} is an output of its own"
    set_by = {name for operation in role.operations.values() if operation.drives for name in operation.arguments}
    unset = [name for name in role.clamped if name not in set_by]
    return f"because nothing would hold its clamp on {' and '.join(unset)}" if unset else ""


def is_wrapped(instrument: InstrumentSpec) -> bool:
    """Return whether an instrument is reachable only through a vendor's driver."""
    driver = DRIVERS.find(instrument.driver)
    return driver is not None and issubclass(driver, Wrapped)


def hosted_port(instrument: InstrumentSpec, port: str) -> GuardedPort:
    """Return how to start the process of an instrument's vendor driver.

    Args:
        instrument: a wrapped instrument.
        port: its port from the bench file.
    """
    driver = DRIVERS[instrument.driver]
    made_by = driver.made_by if issubclass(driver, Wrapped) else ""
    return GuardedPort(
        device=instrument.name, url=f"hosted://{made_by}/{bare(port).removeprefix(VENDOR)}", speaks="hosted"
    )
