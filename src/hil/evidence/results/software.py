"""Frozen software of a run, and what is proven about it: product, workspace, and third-party code."""

from collections.abc import Iterable, Iterator, Mapping, Sequence

import msgspec

from hil.evidence.results.outcome import NO_OTHERS, OTHERS, Condition

__all__ = [
    "TELLS_OF_EXECUTED",
    "AtStart",
    "Commit",
    "FrozenSoftware",
    "OtherPackage",
    "condition",
    "each_of",
    "of_software",
]

TELLS_OF_EXECUTED = 3
"""First format of `software.json` in whose packages a run on hardware compares what it executed."""
_TELLS_OF_ENVIRONMENT = 4
"""First format of `software.json` that records which variables change what code is executed."""
_TELLS_OF_OTHERS = 2
"""First format of `software.json` that records third-party code."""
_ORIGINS = {
    "archive": "an archive",
    "folder": "a folder in version control",
    "index": "an index",
    "version control": "version control",
}
_MOST = 3


class Commit(msgspec.Struct, frozen=True, kw_only=True):
    """The commit of some software; the id is empty if it was not in version control."""

    id: str = ""
    changed: bool = False


class Versioned(msgspec.Struct, frozen=True, kw_only=True):
    """Some software, by its commit."""

    commit: Commit = Commit()


class OtherPackage(msgspec.Struct, frozen=True, kw_only=True):
    """A third-party package that offered something the run used, as it was frozen.

    Attributes:
        name: its name.
        version: its version.
        offers: what the run used from it, such as `driver ina226`.
        origin: where it was installed from: `index`, `archive`, `version control` or `folder`.
        commit: that holds its files, for one from version control or from a folder.
        recorded: whether it has a RECORD of its files as installed.
        differing: the files that differ from the RECORD.
    """

    name: str
    version: str
    offers: tuple[str, ...]
    origin: str = msgspec.field(name="from")
    commit: Commit = Commit()
    recorded: bool = False
    differing: tuple[str, ...] = ()


class AtStart(msgspec.Struct, frozen=True, kw_only=True):
    """Code that Python executed at its start.

    Attributes:
        file: its file.
        package: the package that it belongs to, empty if none.
        whole: whether it is as in that package's RECORD.
        needed: whether hil needs that package; not recorded before format 4.
    """

    file: str
    package: str = msgspec.field(name="of")
    whole: bool
    needed: bool = True


class FrozenSoftware(msgspec.Struct, frozen=True, kw_only=True):
    """The part of `data/software.json` that verdicts depend on.

    Attributes:
        hil: the product.
        workspace: the workspace.
        flags: of the interpreter; None in packages that do not record them.
        format: from 2 on it records third-party code.
        others: third-party packages that offered something the run used.
        start: what Python executed at its start.
        strays: loaded modules that belong to no package.
        changing: variables, and the loader's file, that change which code is executed.
    """

    format: int = 1
    hil: Versioned = Versioned()
    workspace: Versioned = Versioned()
    flags: Mapping[str, int] | None = None
    others: tuple[OtherPackage, ...] = ()
    start: tuple[AtStart, ...] = ()
    strays: tuple[str, ...] = ()
    changing: tuple[str, ...] = ()


def of_software(software: FrozenSoftware) -> Iterator[Condition]:
    """Yield what is proven about product, workspace, interpreter, and third-party code."""
    optimize = None if software.flags is None else software.flags.get("optimize")
    yield condition(
        "interpreter",
        optimize == 0,
        "Python ran with assertions",
        "it is not recorded that Python ran with assertions" if optimize is None else "Python ran without assertions",
    )
    yield _version("product", software.hil.commit)
    yield _version("workspace", software.workspace.commit)
    if software.format >= _TELLS_OF_OTHERS:
        yield from _others(software)
        yield from each_of("start", _strangers(software), _started(software))
    if software.format >= _TELLS_OF_ENVIRONMENT:
        told = (f"{each} changes which code is executed: {_without(each)}" for each in software.changing)
        yield from each_of("environment", told, "no variable of the environment changes which code is executed")


def _without(name: str) -> str:
    return "take it away" if name.startswith("/") else "unset it"


def _others(software: FrozenSoftware) -> Iterator[Condition]:
    """Third-party drivers and the like count if what was installed is known, and has not been changed since."""
    foreign = [each for each in software.start if each.package and not each.needed]
    if not software.others and not foreign:
        yield condition(OTHERS, True, NO_OTHERS)
    for it in foreign:
        told = f"{it.file} of package {it.package} was executed when Python started, and hil needs no such package"
        yield condition(OTHERS, True, told)
    for each in software.others:
        named = f"{', '.join(each.offers)} of package {each.name} {each.version}"
        problem = _unknown(each)
        at = f", commit {each.commit.id[:12]}" if each.commit.id else ""
        proof = f"{named} is as it was installed from {_ORIGINS.get(each.origin, each.origin)}{at}"
        yield condition(OTHERS, not problem, proof, f"{named} {problem}")


def _unknown(package: OtherPackage) -> str:
    """Return why it cannot be known what code of a package ran, empty if it is known."""
    if package.origin == "folder" and not package.commit.id:
        return "was installed from a folder that is not in version control"
    if package.origin == "folder" and package.commit.changed:
        return f"differs from commit {package.commit.id[:12]} of the folder that it was installed from"
    if package.origin not in _ORIGINS:
        return f"was installed from {package.origin or 'nobody knows where'}"
    if not package.recorded:
        return "has no RECORD of its files, so nobody can tell whether they were changed"
    if package.differing:
        return f"was changed after it was installed: {_some(package.differing)}"
    return ""


def _strangers(software: FrozenSoftware) -> Iterator[str]:
    for each in software.start:
        if not each.package:
            yield f"Python executed {each.file} when it started, which is of no installed package"
        elif not each.whole:
            yield f"Python executed {each.file} when it started, which is not as {each.package} has it"
    if software.strays:
        yield f"code was loaded that is of no installed package: {_some(software.strays)}"


def _started(software: FrozenSoftware) -> str:
    told = ", ".join(f"{each.file} of {each.package}" for each in software.start)
    return f"all code is of Python, of installed packages or of the workspace{f'; at the start {told}' * bool(told)}"


def _some(names: Sequence[str]) -> str:
    more = len(names) - _MOST
    return ", ".join(names[:_MOST]) + (f" and {more} more" if more > 0 else "")


def _version(name: str, commit: Commit) -> Condition:
    if not commit.id:
        return condition(name, False, f"the {name} is not in version control")
    changed = f"the {name} differs from its commit {commit.id[:12]}"
    return condition(name, not commit.changed, f"the {name} is at commit {commit.id[:12]}, unchanged", changed)


def condition(name: str, proven: bool, proof: str, reason: str = "") -> Condition:
    """Return a condition with its proof, or with the reason, if any, when it is not proven."""
    return Condition(name=name, proven=proven, text=proof if proven or not reason else reason)


def each_of(name: str, reasons: Iterable[str], proof: str) -> Iterator[Condition]:
    """Yield a condition per reason, or a proven one if there is none."""
    told = tuple(reasons)
    yield from (condition(name, False, reason) for reason in told)
    if not told:
        yield condition(name, True, proof)
