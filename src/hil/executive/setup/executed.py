"""Comparison of executed code with what was installed: of sources with their RECORD, and of code with its source."""

from __future__ import annotations

import dis
import marshal
import os
import re
import sys
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from importlib.machinery import SourceFileLoader
from importlib.util import MAGIC_NUMBER, cache_from_source
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from hil.executive.setup import auditing
from hil.executive.setup.checkout import digest_of
from hil.executive.setup.ground import PRODUCT
from hil.executive.setup.inputs import Inputs
from hil.executive.setup.other_code import Installed, needed, of_no_package, other_packages
from hil.executive.setup.software import product_source
from hil.guardian.ports.hosted import files_executed

__all__ = ["Executed"]

_PRODUCT = "hil"
_CASES = ("test_", "conftest")
_HEADER = 16
"""Header bytes of a compiled copy: magic number, flags, and time and size of the source (PEP 552)."""

_MAPS = Path("/proc/self/maps")
_FIELDS = 6
_DELETED = " (deleted)"
"""Suffix to the name of a file that no longer exists, such as after an upgrade."""
_SYSTEM = (
    "/gnu/store/",
    "/lib",
    "/nix/store/",
    "/opt/",
    "/usr/lib",
    "/usr/local/lib",
    *(f"{os.path.realpath(each)}{os.sep}" for each in (f"{sys.base_prefix}/bin", f"{sys.base_prefix}/lib")),
)
"""Where systems, and Python, have their libraries: only the computer's administrator can put any there."""


class Executed:
    """The code that this process, and those of vendors' drivers, have executed outside Python's own library.

    Late imports, such as by a function of a driver, are neither listed nor compared when a run begins. And a compiled
    copy is executed whatever it was compiled from, if its time and size are those of the source.

    Args:
        inputs: what is frozen from the workspace.
        modules: the modules of this process.
        maps: lists every file whose machine code this process executes, see proc_pid_maps(5).
    """

    def __init__(self, inputs: Inputs, modules: Mapping[str, object] = sys.modules, maps: Path = _MAPS) -> None:
        self._inputs = inputs
        self._modules = modules
        self._maps = maps
        self._installed = Installed()
        self._offering = {str(path): digest for each in other_packages() for path, digest in each.digests().items()}
        self._strays = set(of_no_package(inputs.root, modules))
        self._product = product_source()
        self._reported: set[str] = set()
        self._seen: set[str] = set()
        self._pythons: set[str] = set()
        self._fine: set[str] = set()
        self._heard = 0
        self._codes: dict[str, list[CodeType]] = {}
        self._first: tuple[str, ...] = self._of_others()  # slow the first time, and nothing waits for it now

    def new_problems(self) -> tuple[str, ...]:
        """Return why third-party code executed since the last call is unknown, a sentence each."""
        first, self._first = self._first, ()
        return self._new([*first, *self._of_others()])

    def last_problems(self) -> tuple[str, ...]:
        """Return why executed code is unknown, including the product and its dependencies, a sentence each."""
        self._collect()
        changed = ["hil was changed while the run lasted"] if product_source() != self._product else []
        found = (*self._problems(self._files()), *self._replaced_parts(), *self._strange_libraries())
        return self._new([*found, *changed])

    def packages(self) -> tuple[str, ...]:
        """Return the packages whose code was executed, sorted, except hil and its dependencies."""
        self._collect()
        names = {self._installed.package_of(file) for file in self._files() if not self._is_needed(file)}
        return tuple(sorted(names - {""}))

    def _of_others(self) -> tuple[str, ...]:
        """Return what is wrong with third-party files executed since the last call."""
        self._collect()
        files = [file for file in self._files() if file not in self._seen]
        self._seen.update(files)
        return (*self._problems(file for file in files if not self._is_needed(file)), *self._strange_libraries())

    def _replaced_parts(self) -> Iterator[str]:
        """Yield the functions of hil and of its dependencies that other code has replaced.

        It does not matter whether that was before hil first looked. For libraries, functions that a module only
        imported are left out, and so is code without a file, which many of them generate.
        """
        for named, owner, name, code in _functions(self._modules):
            file = code.co_filename
            if file in self._fine:
                continue
            if file.startswith("<frozen ") or self._is_needed(file) or self._installed.is_python(file):
                self._fine.add(file)
                continue
            by = "/".join(Path(file).parts[-2:]) if file.startswith(os.sep) else "code of no file"
            if named.partition(".")[0] == _PRODUCT:
                if not (file.startswith("<") and name.startswith("__")):  # by `dataclass`
                    yield f"{by} replaced {owner}.{name}, which is a part of hil"
            elif file.startswith(os.sep) and self._is_defined_by_library(named, owner, name):
                yield f"{by} replaced {owner}.{name}, which hil is built on"

    def _is_defined_by_library(self, named: str, owner: str, name: str) -> bool:
        """Return whether a library itself defines a function, so that other code in it is a replacement."""
        module = self._modules.get(named)
        file = getattr(module, "__file__", None)
        if getattr(module, "__name__", named) != named:  # the module is known by its own name, too
            return False
        if file is not None and not self._is_needed(file) and not self._installed.is_python(file):
            return False
        return owner != named or file is None or not file.endswith(".py") or _defines(file, name)

    def _strange_libraries(self) -> Iterator[str]:
        """Yield the libraries of machine code that belong to no package, whether loaded by the linker or by `ctypes`.

        The system's libraries are trusted, and so are those beside Python. A module of a package in place has to be
        committed.
        """
        try:
            lines = self._maps.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:  # no such file on this system
            return
        found = {fields[5] for line in lines if len(fields := line.split(maxsplit=5)) == _FIELDS and "x" in fields[1]}
        for file in sorted(each for each in found if each.startswith("/")):
            path = Path(os.path.realpath(file.removesuffix(_DELETED)))
            if not (
                str(path).startswith(_SYSTEM) or self._installed.has(str(path)) or self._installed.is_in_place(path)
            ):
                yield f"the library {path.name} was loaded, which is neither of the system nor of an installed package"

    def _new(self, problems: Iterable[str]) -> tuple[str, ...]:
        found = tuple(each for each in dict.fromkeys(problems) if each not in self._reported)
        self._reported.update(found)
        return found

    def _collect(self) -> None:
        """Add what was executed since."""
        heard = auditing.executed(self._heard)
        self._heard += len(heard)
        for each in heard:
            if isinstance(each, CodeType):
                self._codes.setdefault(each.co_filename, []).append(each)
            else:
                self._codes.setdefault(each, [])

    def _files(self) -> list[str]:
        """Return the files that were executed, except Python's own, sorted."""
        named = (getattr(module, "__file__", None) for module in list(self._modules.values()))
        files = {file for file in named if isinstance(file, str)} | self._codes.keys() | set(files_executed())
        self._pythons.update(file for file in files - self._seen - self._pythons if self._installed.is_python(file))
        return sorted(files - self._pythons)

    def _is_needed(self, file: str) -> bool:
        """Return whether a file belongs to the product or to one of its dependencies."""
        return file.startswith(PRODUCT) or self._installed.name_of(file) in needed()

    def _problems(self, files: Iterable[str]) -> Iterator[str]:
        loaded = self._loaded_from_source() | set(files_executed())
        for file in files:
            path = Path(os.path.realpath(file))
            if path.is_relative_to(self._inputs.root) and not self._installed.has(file):
                yield from self._of_workspace(file, path)
            else:
                yield from self._of_package(file, path, copied=file in loaded)

    def _of_workspace(self, file: str, path: Path) -> Iterator[str]:
        if path not in self._inputs.snapshot:
            yield f"{self._inputs.shown(path)} was executed, and was not frozen"
        elif not path.name.startswith(_CASES):  # assertions of cases are rewritten, and loaded from the frozen source
            data = self._inputs.snapshot.take(path)
            if not _are_of(self._codes.get(file, []), data, file):
                yield f"{self._inputs.shown(path)} was executed otherwise than its source says"

    def _of_package(self, file: str, path: Path, *, copied: bool) -> Iterator[str]:
        shown, package = "/".join(path.parts[-2:]), self._installed.package_of(file)
        if not file.startswith(PRODUCT):
            named = f"{shown} of {package}" if package else shown
            problem = self._unknown(file, path)
            if problem:
                yield f"{named} {problem}"
                return
        codes = self._codes.get(file) or (_compiled_copy(file) if copied else [])
        if codes and not _are_of(codes, path.read_bytes(), file):
            yield f"{shown} was executed otherwise than its source says, such as from a compiled copy of another source"

    def _unknown(self, file: str, path: Path) -> str:
        """Return why it is unknown what a third-party file held, empty if it is known."""
        due, digest = self._offering.get(str(path)), digest_of(path)
        if due is not None:
            return "" if due == digest else "was changed while the run lasted"
        recorded = self._installed.recorded(file)
        if recorded is None:
            told = any(f"({path.name})" in each for each in self._strays)
            if self._installed.is_in_place(path):
                return "" if self._installed.is_committed(path, digest) else "is not in a commit as it is"
            return "" if told else "was executed, and is of no installed package"
        return "" if not recorded or recorded == digest else "is not as it was installed"

    def _loaded_from_source(self) -> frozenset[str]:
        """Return the files of the modules that Python's own loader loaded."""
        loaded = (each for each in list(self._modules.values()) if type(_loader(each)) is SourceFileLoader)
        return frozenset(str(getattr(each, "__file__", "")) for each in loaded)


def _functions(modules: Mapping[str, object]) -> Iterator[tuple[str, str, str, CodeType]]:
    """Yield every function in modules and their classes: the module, the owner's dotted name, its name, its code."""
    for named, module in list(modules.items()):
        if not isinstance(module, ModuleType):
            continue
        inside = list(vars(module).items())
        owners: dict[str, list[tuple[str, object]]] = {named: inside}
        own = [each for _, each in inside if isinstance(each, type) and each.__module__ == named]
        owners |= {f"{named}.{each.__qualname__}": list(vars(each).items()) for each in own}
        for owner, its in owners.items():
            for name, value in its:
                inner = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
                if isinstance(inner, FunctionType):
                    yield named, owner, name, inner.__code__


def _defines(file: str, name: str) -> bool:
    """Return whether the source of a module defines a function of this name."""
    try:
        code = compile(Path(file).read_bytes(), file, "exec", dont_inherit=True)
    except (OSError, SyntaxError, ValueError):
        return True
    return any(isinstance(each, CodeType) and each.co_name == name for each in code.co_consts)


def _loader(module: object) -> object:
    return getattr(module, "__loader__", None)


def _compiled_copy(file: str) -> list[CodeType]:
    """Return the code in the compiled copy of a source loaded before auditing began, none if there is no copy."""
    try:
        data, its = Path(cache_from_source(file)).read_bytes(), os.stat(file)  # noqa: PTH116 - by the name as it is
    except (OSError, NotImplementedError, ValueError):  # missing; a Python that keeps none; not the name of a source
        return []
    flags = int.from_bytes(data[4:8], "little")
    stamp = int(its.st_mtime).to_bytes(8, "little")[:4] + its.st_size.to_bytes(8, "little")[:4]
    if data[:4] != MAGIC_NUMBER or (not flags and data[8:_HEADER] != stamp):
        return []
    found = marshal.loads(data[_HEADER:])  # noqa: S302 - what Python executed before
    return [found] if isinstance(found, CodeType) else []


def _are_of(codes: Iterable[CodeType], source: bytes, file: str) -> bool:
    """Return whether code objects are what Python compiles from a source."""
    try:
        due = compile(source, file, "exec", dont_inherit=True)
    except (SyntaxError, ValueError):
        return False
    return all(code == due or _is_alike(code, due) for code in codes)


def _is_alike(one: CodeType, other: CodeType) -> bool:
    """Return whether two code objects do the same, whatever the interpreter has specialised in one while it ran.

    Python 3.11 does not always compile a source to the same bytes: it may jump to a jump or to its target, keep a jump
    or a no-op, or duplicate an instruction. So both are followed along every path, instruction by instruction.
    """
    if _head(one) != _head(other):
        return False
    mine, its = _Course(one), _Course(other)
    waiting, seen = [(mine.leads_to(0), its.leads_to(0))], set()
    while waiting:
        pair = waiting.pop()
        if pair in seen:
            continue
        seen.add(pair)
        (what, const, ways), (its_what, its_const, its_ways) = mine.step(pair[0]), its.step(pair[1])
        if isinstance(const, CodeType) and isinstance(its_const, CodeType):
            alike = _is_alike(const, its_const)
        else:
            alike = _essence(const) == _essence(its_const)
        if what != its_what or len(ways) != len(its_ways) or not alike:
            return False
        waiting += zip(ways, its_ways, strict=True)
    return True


def _head(code: CodeType) -> tuple[object, ...]:
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    return (counts, code.co_name, code.co_varnames, code.co_freevars, code.co_cellvars)


def _essence(value: object) -> object:
    """Return a key that equal constants share: including their types, and without the order of a set."""
    if isinstance(value, tuple):
        return tuple(map(_essence, value))
    return (type(value), sorted(map(repr, value)) if isinstance(value, frozenset) else repr(value))


class _Course:
    """The instructions of a code object, and where each of them leads."""

    def __init__(self, code: CodeType) -> None:
        self._steps = [each for each in dis.get_instructions(code) if each.opname != "EXTENDED_ARG"]
        self._offsets = [each.offset for each in self._steps]
        self._handlers = getattr(dis, "_parse_exception_table")(code)  # noqa: B009 - there is no public way to it

    def leads_to(self, offset: int) -> int:
        """Return the number of the instruction at an offset, or of the one to which jumps lead from there."""
        number = bisect_left(self._offsets, offset)  # the offset of an EXTENDED_ARG stands for the instruction after it
        for _ in self._steps:
            if number >= len(self._steps) or self._steps[number].opname not in _EMPTY:
                break
            step = self._steps[number]
            number = number + 1 if step.opname == "NOP" else bisect_left(self._offsets, step.argval)
        return number

    def step(self, number: int) -> tuple[tuple[object, ...], object, tuple[int, ...]]:
        """Return an instruction, its constant or name, and where it leads: next, by its jump, by an exception."""
        if number >= len(self._steps):
            return ("END",), None, ()
        step = self._steps[number]
        ways = [] if step.opname in _LAST else [self._after(number)]
        jumps = step.opcode in dis.hasjrel or step.opcode in dis.hasjabs
        ways += [self.leads_to(step.argval)] if jumps else []
        handler = next((each for each in self._handlers if each.start <= step.offset < each.end), None)
        ways += [self.leads_to(handler.target)] if handler else []
        caught = (handler.depth, handler.lasti) if handler else None
        return (_WAY.sub("", step.opname), caught), None if jumps else step.argval, tuple(ways)

    def _after(self, number: int) -> int:
        after = number + 1
        return self.leads_to(self._offsets[after]) if after < len(self._steps) else after


_EMPTY = frozenset({"NOP", "JUMP_FORWARD", "JUMP_BACKWARD", "JUMP_BACKWARD_NO_INTERRUPT"})
"""Instructions that only lead to another one."""
_LAST = frozenset({"RAISE_VARARGS", "RERAISE", "RETURN_VALUE"})
"""Instructions that lead nowhere but to a handler."""
_WAY = re.compile("FORWARD_|BACKWARD_")
