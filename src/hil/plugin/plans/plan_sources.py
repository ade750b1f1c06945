"""Checks of the sources of plans and workspace: no hooks, no duplicate names, no cases that are not collected."""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Collection, Iterator, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType

import pytest

from hil.executive.setup.configuration import Configuration
from hil.executive.setup.inputs import Inputs
from hil.executive.setup.reach import parsed
from hil.executive.setup.workspace import Workspace
from hil.model.errors import ConfigurationError, Finding

__all__ = ["helper_modules", "hook_findings", "imported_hooks", "lost_cases", "refuse_sources"]

_CONFTEST = "conftest.py"
_CASES = ("test", "Test")
_OWN = frozenset({"pytest_plugins", "collect_ignore", "collect_ignore_glob"})
_BRINGS = "pytest hooks and plugins would come between a case and its verdict: take it out, fixtures are enough"


def refuse_sources(configuration: Configuration) -> None:
    """Refuse, before pytest reads any of it, whatever in and around the plans could change what a case is worth.

    Raises:
        ConfigurationError: with every `conftest.py` in a plan, and from the testplans up to the workspace; with every
            hook in the modules of a plan, every case replaced by another of its name, and every duplicate fixture
            name in a file of a plan, or in all files of the workspace's fixtures; with every ambiguous import of a
            module beside cases.
    """
    fixtures, inputs = configuration.workspace.fixtures, configuration.inputs
    findings = list(_conftests(configuration.workspace, configuration.plans))
    for plan in configuration.plans:
        findings += _ambiguous_imports(plan, configuration)
        findings += _in_plan([path for path in inputs.below(plan) if path.parent == plan], inputs)
    findings += _fixtures_twice([path for path in inputs.below(fixtures) if path.parent == fixtures], inputs)
    if findings:
        raise ConfigurationError(tuple(findings))


def helper_modules(configuration: Configuration) -> dict[str, Path]:
    """Return the modules beside the cases of the run's plans, which the cases import by name.

    Excluded are modules named like one of Python's or an installed one, which all other code means by that name, and
    those with the same name in several plans.
    """
    found: dict[str, Path | None] = {}
    for plan in configuration.plans:
        for name, path in _beside(plan, configuration.inputs).items():
            found[name] = None if name in found or _is_elsewhere(name, configuration) else path
    return {name: path for name, path in found.items() if path is not None}


def _beside(plan: Path, inputs: Inputs) -> dict[str, Path]:
    files = (path for path in inputs.below(plan) if path.parent == plan)
    return {path.stem: path for path in files if not path.name.startswith("test_") and path.name != _CONFTEST}


def _is_elsewhere(name: str, configuration: Configuration) -> bool:
    if name in sys.stdlib_module_names:
        return True
    ground = configuration.ground
    folders = [folder for folder in sys.path if not ground.folder(folder)]
    return PathFinder.find_spec(name, folders) is not None


def _ambiguous_imports(plan: Path, configuration: Configuration) -> Iterator[Finding]:
    """Yield every import of a module beside the cases that would get another one, or one of another plan."""
    inputs = configuration.inputs
    usable, beside = helper_modules(configuration), _beside(plan, inputs)
    taken = beside.keys() - {name for name, path in usable.items() if path == beside.get(name)}
    for path in (path for path in inputs.below(plan) if taken and path.parent == plan):
        tree = _tree(path, inputs)
        for node in _imports(tree) if tree else ():
            for name in taken & set(_imported(node)):
                what = (
                    "Python or an installed package"
                    if _is_elsewhere(name, configuration)
                    else "another plan of the run"
                )
                message = f"'{name}' is also a module of {what}: rename {inputs.shown(beside[name])}"
                yield Finding(inputs.shown(path), node.lineno, node.col_offset + 1, message)


def _imports(tree: ast.Module) -> Iterator[ast.Import | ast.ImportFrom]:
    yield from (node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom))


def _imported(node: ast.Import | ast.ImportFrom) -> list[str]:
    names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
    return [name.partition(".")[0] for name in names if not getattr(node, "level", 0)]


def _tree(path: Path, inputs: Inputs) -> ast.Module | None:
    """Return the syntax tree of a frozen file, None if it cannot be parsed: importing it shows the error."""
    try:
        return parsed(inputs.snapshot.take(path))
    except (OSError, SyntaxError, ValueError):
        return None


def hook_findings(path: Path, inputs: Inputs) -> Iterator[Finding]:
    """Yield every hook defined in a module of fixtures; none if the file cannot be parsed."""
    if (tree := _tree(path, inputs)) is not None:
        yield from _hooks(tree, inputs.shown(path))


def imported_hooks(module: ModuleType, shown: str) -> Iterator[Finding]:
    """Yield every hook in a loaded module, wherever it came from."""
    for name, value in sorted(vars(module).items()):
        if name in _OWN or (name.startswith("pytest_") and inspect.isroutine(value)):
            yield Finding(shown, 0, 0, f"'{name}': {_BRINGS}")


def _conftests(workspace: Workspace, plans: Sequence[Path]) -> Iterator[Finding]:
    folders = [workspace.testplans, *workspace.testplans.parents]
    around = [folder / _CONFTEST for folder in folders if folder.is_relative_to(workspace.root)]
    inside = [path for plan in plans for path in sorted(plan.rglob(_CONFTEST))]
    place = workspace.shown(workspace.fixtures)
    message = f"a conftest.py takes part in the verdicts and is not part of a plan: fixtures belong in {place}/"
    yield from (Finding(workspace.shown(path), 0, 0, message) for path in (*around, *inside) if path.exists())


def _in_plan(paths: Sequence[Path], inputs: Inputs) -> Iterator[Finding]:
    for path in paths:
        tree = _tree(path, inputs)
        if tree is not None and path.name != _CONFTEST:
            yield from _hooks(tree, inputs.shown(path))
            yield from _replaced(tree.body, inputs.shown(path))
            yield from _fixtures_twice([path], inputs)


def _hooks(tree: ast.Module, shown: str) -> Iterator[Finding]:
    for name, node in _bound(tree.body):
        is_hook = name.startswith("pytest_") and not isinstance(node, ast.Import)
        if is_hook or name in _OWN:
            yield Finding(shown, node.lineno, node.col_offset + 1, f"'{name}': {_BRINGS}")


def _replaced(body: Sequence[ast.stmt], shown: str) -> Iterator[Finding]:
    """Yield every redefinition of a case, or of a class of cases, which would replace the earlier one."""
    first: dict[str, ast.stmt] = {}
    for name, node in _bound(body):
        if not name.startswith(_CASES):
            continue
        before = first.setdefault(name, node)
        defines = any(
            isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) for each in (before, node)
        )
        if before is not node and defines:
            message = f"'{name}' replaces the one of line {before.lineno}, which would never run: rename it"
            yield Finding(shown, node.lineno, node.col_offset + 1, message)
        if isinstance(node, ast.ClassDef):
            yield from _replaced(node.body, shown)


def _fixtures_twice(paths: Sequence[Path], inputs: Inputs) -> Iterator[Finding]:
    """Yield every duplicate fixture name: which one a case gets would be left to chance."""
    first: dict[str, str] = {}
    for path in paths:
        tree, shown = _tree(path, inputs), inputs.shown(path)
        for node in tree.body if tree else ():
            if not isinstance(node, ast.FunctionDef) or (name := _fixture_name(node)) is None:
                continue
            before = first.setdefault(name, f"{shown}:{node.lineno}")
            if before != f"{shown}:{node.lineno}":
                message = f"there is a fixture '{name}' in {before} already: a case would get one of them, rename it"
                yield Finding(shown, node.lineno, node.col_offset + 1, message)


def _fixture_name(node: ast.FunctionDef) -> str | None:
    """Return the name by which cases ask for this fixture, None if it is not one."""
    for each in node.decorator_list:
        call = each.func if isinstance(each, ast.Call) else each
        if getattr(call, "attr", getattr(call, "id", "")) == "fixture":
            given = [keyword.value for keyword in getattr(each, "keywords", ()) if keyword.arg == "name"]
            return str(given[0].value) if given and isinstance(given[0], ast.Constant) else node.name
    return None


def _bound(body: Sequence[ast.stmt]) -> Iterator[tuple[str, ast.stmt]]:
    """Yield every name that statements bind or delete, including in conditions and loops, but not in functions."""
    for node in body:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.ClassDef():
                yield node.name, node
            case ast.Import() | ast.ImportFrom():
                yield from ((alias.asname or alias.name.partition(".")[0], node) for alias in node.names)
            case ast.Assign(targets=targets) | ast.Delete(targets=targets):
                yield from ((name, node) for target in targets for name in _names(target))
            case ast.AnnAssign(target=target) | ast.AugAssign(target=target):
                yield from ((name, node) for name in _names(target))
        yield from _below(node)


def _below(node: ast.stmt) -> Iterator[tuple[str, ast.stmt]]:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return
    if isinstance(node, ast.For | ast.AsyncFor):
        yield from ((name, node) for name in _names(node.target))
    for _, value in ast.iter_fields(node):
        if isinstance(value, list):
            for each in value:
                if isinstance(each, ast.stmt):
                    yield from _bound([each])
                elif isinstance(each, ast.ExceptHandler | ast.match_case):
                    yield from _bound(each.body)


def _names(target: ast.expr) -> Iterator[str]:
    yield from (node.id for node in ast.walk(target) if isinstance(node, ast.Name))


_Function = ast.FunctionDef | ast.AsyncFunctionDef
_MARKER = "requirement"
_LITERALS = (ast.Constant, ast.Dict, ast.JoinedStr, ast.List, ast.Set, ast.Tuple, ast.UnaryOp)
_WHY = (
    "looks like a case, and pytest does not collect it: cases are functions test_* in a file test_*.py, in no function"
    " and in no class or in a class Test* without __init__, directly in the plan's folder; rename anything that is not"
    " a case"
)


def lost_cases(items: Sequence[pytest.Item], configuration: Configuration) -> Iterator[Finding]:
    """Yield everything in the plans that is a case by its name or its marker but was not collected.

    Every file below a plan's folder is searched, whatever its folders are called, and everything in it: nested
    functions, and names that something was assigned to.

    Args:
        items: everything collected from the plans.
        configuration: names plans and their frozen files.
    """
    inputs = configuration.inputs
    collected = {place for item in items for place in _places(item)}
    for path in (path for plan in configuration.plans for path in inputs.below(plan)):
        tree = _tree(path, inputs)
        for name, node in _candidates(tree) if tree else ():
            if isinstance(node, _Function):
                lost = not {(path, name), (path, _first_line(node))} & collected
            else:
                lost = not _is_collected(path, name, collected) and _is_case(path, name, node.value)
            if lost:
                shown = name.rpartition(".")[2]
                yield Finding(inputs.shown(path), node.lineno, node.col_offset + 1, f"'{shown}' {_WHY}")


_Assigned = ast.Assign | ast.AnnAssign | ast.NamedExpr | ast.Expr
_Place = tuple[Path, str | int]


def _places(item: pytest.Item) -> Iterator[_Place]:
    """Yield where a case is defined: its name in its file, and the first line of its code, perhaps of a base class."""
    yield item.path, item.nodeid.partition("::")[2].partition("[")[0].replace("::", ".")
    code = getattr(inspect.unwrap(getattr(item, "function", item.runtest)), "__code__", None)
    if code is not None:
        yield Path(code.co_filename), code.co_firstlineno


def _candidates(tree: ast.AST, within: str = "") -> Iterator[tuple[str, _Function | _Assigned]]:
    """Yield what a reader would take for a case, with its qualified name, wherever it is."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, _Function):
            marks = {_last_name(each) for each in node.decorator_list}
            if _MARKER in marks or (node.name.startswith("test") and "fixture" not in marks):
                yield f"{within}{node.name}", node
            yield from _candidates(node, f"{within}{node.name}.{_LOCALS}")
        elif isinstance(node, ast.ClassDef):
            yield from _candidates(node, f"{within}{node.name}.")
        elif isinstance(node, _Assigned):
            yield from ((f"{within}{name}", node) for name in _assigned(node))
        else:
            yield from _candidates(node, within)


_LOCALS = "<locals>."


def _assigned(node: _Assigned) -> Iterator[str]:
    """Yield the names that a statement binds to what may be a case; applying a marker makes anything a case."""
    if node.value is None:
        return
    targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", ast.Constant(None))]
    names = [name for target in targets for name in _names(target)]
    found = [name for name in names if name.startswith(_CASES)]
    if not found and any(_is_applied(each) for each in ast.walk(node.value)):
        found = names or [_MARKER]
    yield from found


def _is_applied(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Call) and _last_name(node.func) == _MARKER


def _is_collected(path: Path, name: str, collected: Collection[_Place]) -> bool:
    """Return whether a name is a collected case, or a class of them."""
    cases = (place for file, place in collected if file == path and isinstance(place, str))
    return any(case == name or case.startswith(f"{name}.") for case in cases)


def _is_case(path: Path, name: str, value: ast.expr | None) -> bool:
    """Return whether what was assigned to a name is callable; if that is unknown, whether it is written as a case."""
    local = _LOCALS in name
    parts = () if value is None else _wrapped(value) if local else ast.walk(value)
    written = any(isinstance(each, ast.Lambda) or _is_applied(each) for each in parts)
    module = next((each for each in tuple(sys.modules.values()) if getattr(each, "__file__", None) == str(path)), None)
    if written or module is None or local or isinstance(value, _LITERALS):
        return written
    found: object = module
    for part in name.split("."):
        found = getattr(found, part, None)
    return callable(found)


def _wrapped(value: ast.expr) -> Iterator[ast.expr]:
    """Yield a value and what it wraps like a decorator: a lambda among other arguments is not a case."""
    yield value
    while isinstance(value, ast.Call) and len(value.args) == 1 and not value.keywords:
        value = value.args[0]
        yield value


def _first_line(node: _Function) -> int:
    return min(node.lineno, *(each.lineno for each in node.decorator_list), node.lineno)


def _last_name(decorator: ast.expr) -> str:
    function = decorator.func if isinstance(decorator, ast.Call) else decorator
    return getattr(function, "attr", getattr(function, "id", ""))
