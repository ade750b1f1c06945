"""What an audit reports besides the status of requirements: gaps, exceptions, and problems of packages and ledger."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from hil.audit.document import Exempted, Gap, GapKind, Row
from hil.audit.inputs import Package, World
from hil.audit.ledgered import Ledgered
from hil.requirements.requirement import Kind, Method

__all__ = ["BY_CASES", "exceptions_of", "gaps_of", "problems_of"]

BY_CASES = frozenset({Method.TEST, Method.INSPECTION})
"""The methods by which cases verify a requirement."""


def gaps_of(rows: Sequence[Row], packages: Sequence[Package], world: World) -> Iterator[Gap]:
    """Yield requirements without a case or a child, and cases and results without a requirement."""
    present = {each.id for each in world.asked if not each.withdrawn}
    for row in rows:
        if row.kind == Kind.PARENT and not row.children:
            yield Gap(kind=GapKind.WITHOUT_CHILDREN, name=row.id, where=row.planning.place)
        wanted = row.id in present and row.kind != Kind.PARENT and row.method in BY_CASES
        if wanted and not row.planning.cases and not row.stated:
            yield Gap(kind=GapKind.WITHOUT_CASE, name=row.id, where=row.planning.place)
    for case in world.cases or ():
        if not case.marked:
            yield Gap(kind=GapKind.WITHOUT_REQUIREMENT, name=case.case, where=case.place)
    known = {each.id for each in world.asked}
    newest = {plan: package for package in packages for plan in package.plans}
    for package in {package.folder: package for package in newest.values()}.values():
        for name in package.orphans if world.cases is None else ():
            yield Gap(kind=GapKind.WITHOUT_REQUIREMENT, name=name, where=package.folder)
        for identifier in package.results:
            if identifier not in known:
                yield Gap(kind=GapKind.NOT_IN_CATALOGUE, name=identifier, where=package.folder)


def exceptions_of(packages: Sequence[Package]) -> Iterator[Exempted]:
    """Yield what counts as hardware on the word of a bench file alone, with the reason declared."""
    for package in packages:
        for instrument, reason in package.exceptions:
            yield Exempted(package=package.folder, instrument=instrument, reason=reason)


def problems_of(packages: Sequence[Package], book: Ledgered) -> Iterator[str]:
    """Yield what is wrong with packages and ledger, in sentences."""
    yield from (
        f"{each.name}: it was removed or changed, and the reason is not on record" for each in book.removed.told
    )
    yield from (each.text for each in book.missing)
    if book.doubted:
        yield book.doubted
    for package in packages:
        if package.problem:
            yield f"{package.folder}: {package.problem}"
