"""Checks the names of fixtures, roles and parameters in a case's code before anything runs."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from hil.bench.file.reading import bench_names, load_bench
from hil.documents.suggest import did_you_mean
from hil.executive.setup.configuration import Configuration
from hil.instruments.registry import ROLES
from hil.model.errors import ConfigurationError, Finding, Refused
from hil.plugin.plans import case_fixtures
from hil.plugin.plans.case_fixtures import CASE_FIXTURES
from hil.plugin.plans.literals import WrittenName, given_to, written_names
from hil.requirements.parameters import Parameters

__all__ = ["name_findings", "unwired"]


def unwired(name: str, configuration: Configuration) -> str:
    """Return that no wire of the bench has this role, and which benches have one; empty if it is not a role."""
    if name not in ROLES:
        return ""
    workspace = configuration.workspace
    others = [other for other in bench_names(workspace.benches) if _has(other, name, configuration)]
    where = f"; benches that have it: {', '.join(others)}" if others else ""
    return f"a role that no wire of the bench {configuration.bench.name} has: this plan cannot run there{where}"


def _has(bench: str, role: str, configuration: Configuration) -> bool:
    workspace = configuration.workspace
    try:
        found = load_bench(workspace.benches, bench, workspace.root, driven=False)
    except (ConfigurationError, Refused):
        return False  # an unreadable bench is not the one asked for
    return any(wire.role == role for wire in found.wiring)


_FACADE = ("instrument", "wire")


def name_findings(item: pytest.Item, configuration: Configuration) -> Iterator[Finding]:
    """Yield every name in a case and its fixtures that nothing provides, or that does not exist on what is provided.

    pytest has no public way to say what a case asks for before it runs; if its internal records look different, the
    case's set-up reports the error.
    """
    provided: Mapping[str, Sequence[Any]] | None = getattr(
        getattr(item, "_fixtureinfo", None), "name2fixturedefs", None
    )
    if provided is None:
        return
    roles = _roles(configuration)
    functions = _functions(item, provided, configuration)
    yield from _unprovided(item, provided, roles, functions, configuration)
    own = {*CASE_FIXTURES, *roles}
    for name in sorted(own & set(provided)):
        if not _is_ours(provided[name]):
            path, line, _ = item.location
            message = f"{item.name} gets a '{name}' that is not the executive's: give that fixture another name"
            yield Finding(path, (line or 0) + 1, 1, message)
    ours = {name for name in own & set(provided) if _is_ours(provided[name])}
    yield from _outliving(provided, ours, configuration)
    helpers = _helpers(item, configuration)
    for function in (*functions, *helpers):
        # A function that is not a fixture may get anything as its `supply`; `parameters` were passed on by name.
        known = ours & {"parameters"} if function in helpers else ours
        for written in written_names(function):
            if written.path[0] in known:
                yield from _wrong_name(written, roles, _shown(function, configuration), _plan_of(item, configuration))


def _outliving(
    provided: Mapping[str, Sequence[Any]], ours: Collection[str], configuration: Configuration
) -> Iterator[Finding]:
    """Yield every fixture with a scope beyond one case that asks for something of one case."""
    for definitions in provided.values():
        for each in definitions:
            asked = [name for name in getattr(each, "argnames", ()) if name in ours]
            scope = getattr(each, "scope", "function")
            if asked and scope != "function":
                line = inspect.unwrap(each.func).__code__.co_firstlineno
                who = f"the fixture {each.func.__name__} requests '{asked[0]}', which exists per case"
                message = f"{who}: leave out scope='{scope}'"
                yield Finding(_shown(each.func, configuration), line, 1, message)


def _wrong_name(
    written: WrittenName, roles: Mapping[str, Mapping[str, Collection[str]]], path: str, parameters: Parameters
) -> Iterator[Finding]:
    first, second, *rest = written.path
    message = ""
    if first == "parameters":
        message = parameters.problem_with(second)
    elif first in roles:
        instances = roles[first]
        if "" not in instances and second not in instances:
            message = f"no '{second}' among the bench's {first}{did_you_mean(second, instances)}"
        else:
            operations = instances[""] if "" in instances else instances[second]
            asked = second if "" in instances else (rest[0] if rest else None)
            if asked is not None and asked not in operations:
                instance = first if "" in instances else f"{first}.{second}"
                offered = sorted(set(operations) - set(_FACADE))
                hint = did_you_mean(asked, operations) or f"; it has {', '.join(offered)}"
                message = f"{instance} has no operation '{asked}'{hint}"
    if message:
        yield Finding(path, written.line, written.column, message)


def _unprovided(
    item: pytest.Item,
    provided: Mapping[str, Sequence[Any]],
    roles: Collection[str],
    functions: Sequence[Callable[..., object]],
    configuration: Configuration,
) -> Iterator[Finding]:
    given = {"request", *provided, *_parametrised(item)}
    known = (*CASE_FIXTURES, *roles, *(name for name in given if not name.startswith("_")))
    for name in getattr(item, "fixturenames", ()):
        if name in given:
            continue
        path, line, _ = item.location
        who, line = item.name, (line or 0) + 1
        for function in functions[1:]:
            if name in inspect.signature(function).parameters:
                who, path = f"the fixture {function.__name__}", _shown(function, configuration)
                line = inspect.unwrap(function).__code__.co_firstlineno
        why = unwired(name, configuration) or f"which nothing provides{did_you_mean(name, known)}"
        yield Finding(path, line, 1, f"{who} requests '{name}', {why}")


def _functions(
    item: pytest.Item, provided: Mapping[str, Sequence[Any]], configuration: Configuration
) -> tuple[Callable[..., object], ...]:
    """Return the case and the workspace's fixtures that it uses."""
    workspace = configuration.workspace
    fixtures = [each.func for definitions in provided.values() for each in definitions]
    mine = [
        function
        for function in fixtures
        if (path := _file(function)) is not None
        and (path.is_relative_to(workspace.fixtures) or path.is_relative_to(workspace.testplans))
    ]
    function = getattr(item, "function", None)
    return (*([function] if function else []), *mine)


def _helpers(item: pytest.Item, configuration: Configuration) -> tuple[Callable[..., object], ...]:
    """Return the functions of the case's module that take `parameters` and get a function's own passed on."""
    module = getattr(item, "module", None)
    functions = [each for each in vars(module).values() if inspect.isfunction(each)] if module else []
    names = given_to(configuration.inputs.snapshot.take(item.path), "parameters")
    return tuple(each for each in functions if _file(each) == item.path and each.__name__ in names)


def _roles(configuration: Configuration) -> dict[str, dict[str, Collection[str]]]:
    """Return every role of the bench with its instances and their capabilities."""
    roles: dict[str, dict[str, Collection[str]]] = {}
    for wire in configuration.bench.wiring:
        roles.setdefault(wire.role, {})[wire.instance] = (*ROLES[wire.role].operations, *_FACADE)
    return roles


def _is_ours(definitions: Sequence[Any]) -> bool:
    return bool(definitions) and definitions[-1].func.__module__ == case_fixtures.__name__


def _plan_of(item: pytest.Item, configuration: Configuration) -> Parameters:
    return configuration.parameters.get(item.path.parent.name, Parameters())


def _parametrised(item: pytest.Item) -> Mapping[str, object]:
    callspec = getattr(item, "callspec", None)
    return callspec.params if callspec else {}


def _file(function: Callable[..., object]) -> Path | None:
    code = getattr(inspect.unwrap(function), "__code__", None)
    return Path(code.co_filename) if code else None


def _shown(function: Callable[..., object], configuration: Configuration) -> str:
    path = _file(function)
    return configuration.workspace.shown(path) if path else ""
