"""Computes a selection from criteria and figures: which candidate is best, how surely, and what did not count."""

from __future__ import annotations

import math
import statistics
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from hil.analysis.comparison import Place, Ranking, rank
from hil.model.errors import EvidenceError
from hil.model.figure import Figure, effective_dof
from hil.model.identity import Source
from hil.requirements.units import compatible, scale
from hil.selection.confidence import Known, best
from hil.selection.criteria import Candidate, Criteria
from hil.selection.criteria import Cell as Asked
from hil.selection.document import Cell, Document, Excluded, Package, Share, Standing, Unjudged, Used
from hil.selection.figures import CALCULATED, Input, Taken

__all__ = ["choose"]

_DIGITS = 12  # of a number: further digits depend on the machine
_MOST = 5  # runs that a sentence names
_WHOLE = "the whole package"
_OTHER = {"worst": "mean", "mean": "worst"}
_Axes = Mapping[str, tuple["Used", ...]]
_SAID = {"worst": "By the worst axis", "mean": "By the mean of the axes"}


class _Found(NamedTuple):
    """A figure of a candidate, and the package that it is from."""

    package: Input
    figure: Taken


def choose(
    criteria: Criteria,
    inputs: Iterable[Input],
    *,
    content: str,
    version: str,
    left_out: Sequence[str] = (),
    missing: Sequence[str] = (),
) -> Document:
    """Return the selection, which does not depend on the order of the packages.

    Args:
        criteria: what is compared.
        inputs: the packages that were given.
        content: SHA-256 of the criteria file.
        version: the version of hil.
        left_out: names of the packages of the workspace that have such figures and were not given.
        missing: runs that the ledger of the workspace names, and that are not there.

    Raises:
        EvidenceError: if two packages have one run's name and different contents.
    """
    packages = _once(inputs)
    chosen = _Selection(criteria, [each for each in packages if not each.problem])
    cells = tuple(chosen.cell(each) for each in criteria.cells())
    unread = [Excluded(run=each.run, what=_WHOLE, reason=each.problem) for each in packages if each.problem]
    unread += [Excluded(run=each, what=_WHOLE, reason="it was not given") for each in left_out]
    old = [Excluded(run=each.run, what="attempt", reason=text) for each in packages for text in each.superseded]
    return Document(
        title=criteria.title,
        criteria=content,
        confidence=criteria.confidence,
        warnings=tuple(_warnings(packages, chosen, left_out, missing)),
        candidates={role: tuple(c.name for c in criteria.candidates if role in c.roles) for role in criteria.roles},
        cells=cells,
        shares=tuple(share for role in (*criteria.roles, "") for share in _shares(role, cells)),
        excluded=tuple(sorted({*unread, *old, *chosen.excluded})),
        packages=tuple(
            Package(used=chosen.used[each.digest], **{name: getattr(each, name) for name in _SHOWN})
            for each in packages
        ),
        version=version,
    )


_SHOWN = ("run", "digest", "source", "purpose", "bench", "serial", "began", "deviates")


def _once(inputs: Iterable[Input]) -> list[Input]:
    """Return each package once, by the names of their runs; one that fails verification stands alone."""
    known = {(each.run, each.digest, each.problem): each for each in inputs}
    digests: dict[str, str] = {}
    for run, digest, problem in sorted(known):
        if not problem and digests.setdefault(run, digest) != digest:
            raise EvidenceError(
                f"two packages are both the run {run}, and their contents differ ({digests[run][:8]}, {digest[:8]})",
                "one of them was rewritten; keep both, compare them with the ledger, and leave out the false one",
            )
    return [known[key] for key in sorted(known)]


class _Selection:
    """Fills the cells, and notes what did not count on the way."""

    def __init__(self, criteria: Criteria, packages: Sequence[Input]) -> None:
        self._criteria = criteria
        self._packages = packages
        self._newest = _newest(packages)
        self.excluded: set[Excluded] = set()
        self.used: Counter[str] = Counter()
        self.unproven: defaultdict[str, set[str]] = defaultdict(set)

    def cell(self, asked: Asked) -> Cell:
        """Return a criterion for one role."""
        axes: dict[str, tuple[Used, ...]] = {}
        unjudged, unknown = [], []
        for candidate in asked.candidates:
            found, reasons, told = self._axes(asked, candidate)
            if reasons:
                unjudged.append(Unjudged(candidate=candidate.name, reasons=tuple(reasons)))
            else:
                axes[candidate.name] = found
                unknown += [] if told else [candidate.name]
        criterion = asked.criterion
        standings = self._standings(axes, asked.unit, criterion.combine)
        return Cell(
            role=asked.role,
            criterion=criterion.name,
            parameter=criterion.parameter,
            unit=asked.unit,
            combine=criterion.combine,
            weight=criterion.weight,
            best=tuple(each.candidate for each in standings if each.rank == 1),
            standings=standings,
            unjudged=tuple(unjudged),
            notes=tuple(self._notes(asked, axes, standings, unknown)),
        )

    def _axes(self, asked: Asked, candidate: Candidate) -> tuple[tuple[Used, ...], list[str], bool]:
        """Return the axes of a candidate, or why they are not enough; and whether aliasing is known for all of them."""
        used, wrong, told = [], defaultdict(list), True
        for member in candidate.members(asked.role, asked.criterion.axes):
            good, reasons = [], []
            for each in self._of(asked, candidate, member):
                reason = each.figure.problem or self._against(asked, each)
                if reason:
                    what = f"{each.figure.parameter} of {member}" if member else each.figure.parameter
                    run, named = each.package.run, candidate.name
                    self.excluded.add(Excluded(run=run, what=what, reason=reason, candidate=named))
                    reasons.append(reason)
                else:
                    good.append(each)
            if good:
                used.append(_combined(member, good, asked.unit))
                told = told and all(each.figure.rate and each.figure.bandwidth for each in good)
                self.used.update(each.package.digest for each in good)
                for figure in (each.figure for each in good):
                    for reason in figure.unproven:
                        self.unproven[reason].add(figure.parameter)
            else:
                wrong["; ".join(dict.fromkeys(reasons)) or self._absent(asked, member)].append(member)
        every = ["all axes"] if len(asked.criterion.axes) > 1 and len(wrong) == 1 and not used else []
        return tuple(used), [f"{', '.join(every or its)}: {why}".removeprefix(": ") for why, its in wrong.items()], told

    def _absent(self, asked: Asked, member: str) -> str:
        """Return why an axis has no figure: no plan demands it, or a run did not get that far."""
        wanted = (asked.criterion.parameter, member)
        owed = [each.run for each in self._packages if wanted in each.asked]
        if owed:
            return f"no package has a figure, though a requirement of {_listed(owed)} asks for one"
        return "no package has a figure, and no requirement asks for one"

    def _of(self, asked: Asked, candidate: Candidate, member: str) -> list[_Found]:
        """Return what packages have of an axis: what a case checked against several limits is one figure."""
        criterion = asked.criterion
        found: dict[object, _Found] = {}
        for package in self._packages:
            if (candidate.duts and package.serial not in candidate.duts) or candidate.part not in {"", package.part}:
                continue
            for each in package.figures:
                wanted = each.parameter == criterion.parameter and each.of == member
                if wanted and criterion.plan in {"", each.plan}:
                    again = CALCULATED in each.unproven  # equal calculations add no information
                    key = (
                        "" if again else package.digest,
                        each.case,
                        each.value,
                        each.unit,
                        each.uncertainty,
                        bool(each.problem),
                    )
                    found.setdefault(key, _Found(package, each))
        return list(found.values())

    def _against(self, asked: Asked, found: _Found) -> str:
        """Return what speaks against a figure in comparison with others; empty if nothing does."""
        figure = found.figure
        if not compatible(figure.unit, asked.unit):
            return f"it is in {figure.unit}, which does not convert to {asked.unit}"
        newest = self._newest[figure.requirement]
        if figure.fingerprint != newest.figure.fingerprint:
            return (
                f"it was measured for revision {figure.rev} of {figure.requirement}, and {newest.package.run} for "
                f"{'another text of ' if figure.rev == newest.figure.rev else ''}revision {newest.figure.rev}"
            )
        if asked.criterion.unaliased and figure.rate and figure.bandwidth and figure.bandwidth > figure.rate / 2.0:
            return (
                f"its noise is aliased: {figure.rate:.6g} samples per second, and the filter passes noise up to "
                f"{figure.bandwidth:.6g} Hz"
            )
        return ""

    def _ranked(self, axes: _Axes, unit: str, combine: str) -> Ranking:
        figures = {name: _score(its, unit, combine)[0] for name, its in axes.items()}
        return rank(figures, confidence=self._criteria.confidence)

    def _standings(self, axes: _Axes, unit: str, combine: str) -> tuple[Standing, ...]:
        places = self._ranked(axes, unit, combine).places
        sure = best([_known(axes[each.name], combine, each.figure) for each in places]) if places else []
        return tuple(
            Standing(
                candidate=str(each.name),
                rank=int(each.rank),
                last=int(each.last),
                value=_short(each.figure.value),
                uncertainty=_short(each.figure.uncertainty or 0.0),
                expanded=_short(
                    _coverage(each.figure.dof, self._criteria.confidence) * (each.figure.uncertainty or 0.0)
                ),
                of=_score(axes[each.name], unit, combine)[1],
                ties=tuple(map(str, each.ties)),  # plain words: results of the analysis carry their provenance
                probability=round(probability, 4),
                axes=axes[each.name],
            )
            for each, probability in zip(places, sure, strict=True)
        )

    def _notes(self, asked: Asked, axes: _Axes, standings: Sequence[Standing], unknown: Sequence[str]) -> Iterator[str]:
        other = _OTHER[asked.criterion.combine]
        otherwise = _first(self._ranked(axes, asked.unit, other).places)
        if set(otherwise) != {each.candidate for each in standings if each.rank == 1}:
            yield f"{_SAID[other]} it would be {' or '.join(otherwise)}"
        if asked.criterion.unaliased and unknown:
            yield f"Aliasing of noise cannot be judged for {', '.join(unknown)}: rate or bandwidth is not recorded"


def _newest(packages: Iterable[Input]) -> dict[str, _Found]:
    """Return a figure of the newest run of each requirement: what others are measured for must be the same."""
    found: dict[str, _Found] = {}
    for package in sorted(packages, key=lambda each: (each.began, each.digest)):
        found |= {figure.requirement: _Found(package, figure) for figure in package.figures}
    return found


def _combined(member: str, found: Sequence[_Found], unit: str) -> Used:
    """Return the figure of an axis: the mean of several, with the scatter between them where that is larger.

    u is the larger of sqrt(sum u_i^2) / n, with the degrees of freedom of Welch and Satterthwaite, and s / sqrt(n)
    (GUM 4.2.3 and G.4.1). The latter has n - 1 degrees of freedom where the scatter is beyond what the uncertainties
    explain, by (n - 1) s^2 over the mean of u_i^2 against chi-squared at 95 %; else it is their chance.
    """
    factor = [scale(each.figure.unit, unit) for each in found]
    values = sorted(by * each.figure.value for by, each in zip(factor, found, strict=True))
    parts = sorted(
        ((by * each.figure.uncertainty) ** 2, each.figure.dof or math.inf)
        for by, each in zip(factor, found, strict=True)
    )
    size = len(found)
    uncertainty, dof = math.sqrt(math.fsum(variance for variance, _ in parts)) / size, effective_dof(parts)
    if size > 1 and (scatter := statistics.stdev(values) / math.sqrt(size)) > uncertainty:
        apart = size * (size - 1) * scatter**2 > (size * uncertainty) ** 2 / size * _chance(size - 1)
        uncertainty, dof = scatter, float(size - 1) if apart else dof
    return Used(
        of=member,
        value=_short(math.fsum(values) / size),
        uncertainty=_short(uncertainty),
        dof=_short(dof) if math.isfinite(dof) else None,
        packages=tuple(sorted({each.package.digest for each in found})),
    )


def _chance(dof: int) -> float:
    """Return what chi-squared stays below in 95 of 100 cases."""
    from scipy import special  # noqa: PLC0415 - start-up stays light

    return float(special.chdtri(dof, 0.05))


def _score(axes: Sequence[Used], unit: str, combine: str) -> tuple[Figure, str]:
    """Return the magnitude that counts, and of which axis it is; of a mean of several it is of none."""
    if combine == "worst" or len(axes) == 1:
        worst = max(axes, key=lambda each: (abs(each.value), each.of))
        dof = worst.dof or math.inf
        return Figure(value=abs(worst.value), unit=unit, uncertainty=worst.uncertainty, dof=dof), worst.of
    size = len(axes)
    parts = [(each.uncertainty**2, each.dof or math.inf) for each in axes]
    return Figure(
        value=math.fsum(abs(each.value) for each in axes) / size,
        unit=unit,
        uncertainty=math.sqrt(math.fsum(variance for variance, _ in parts)) / size,
        dof=effective_dof(parts),
    ), ""


def _known(axes: Sequence[Used], combine: str, figure: Figure) -> list[Known]:
    """Return the numbers of which the largest is a candidate's score."""
    if combine == "mean":
        return [Known(figure.value, figure.uncertainty or 0.0, figure.dof)]
    return [Known(each.value, each.uncertainty, each.dof or math.inf) for each in axes]


def _first(places: Iterable[Place]) -> tuple[str, ...]:
    return tuple(each.name for each in places if each.rank == 1)


def _coverage(dof: float, confidence: float) -> float:
    from scipy import special  # noqa: PLC0415 - start-up stays light

    part = 0.5 + confidence / 2.0
    return float(special.ndtri(part) if math.isinf(dof) else special.stdtrit(dof, part))


def _short(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _shares(role: str, cells: Sequence[Cell]) -> list[Share]:
    """Return the shares of the weights that candidates win in the cells of a role, or in all, the largest first."""
    its = [cell for cell in cells if role in {"", cell.role}]
    total = math.fsum(cell.weight for cell in its)
    won: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for cell in its:
        part = cell.weight / total
        for each in cell.standings:
            sure = part * each.probability
            won[each.candidate].append((0.0 if cell.unjudged else sure, sure, sure))
        for missing in cell.unjudged:
            won[missing.candidate].append((0.0, 0.0, part))
    shares = [
        Share(
            role=role,
            candidate=name,
            **dict(zip(("low", "share", "high"), map(_summed, zip(*parts, strict=True)), strict=True)),
        )
        for name, parts in won.items()
    ]
    return sorted(shares, key=lambda each: (-each.share, -each.high, each.candidate))


def _summed(parts: Iterable[float]) -> float:
    return round(math.fsum(parts), 4)


def _warnings(
    packages: Sequence[Input], chosen: _Selection, left_out: Sequence[str], missing: Sequence[str]
) -> Iterator[str]:
    if wrong := [each.run for each in packages if each.problem]:
        yield f"These do not count, as they fail verification: {_listed(wrong)}"
    counted = [each for each in packages if chosen.used[each.digest]]
    for source in (Source.SIMULATED, Source.REPLAYED):
        if number := sum(each.source == source for each in counted):
            those = f"{number} of {len(counted)} packages that count {'is' if number == 1 else 'are'} {source}"
            yield f"{source.upper()}: {those}; this says nothing about real sensors"
    for reason, parameters in sorted(chosen.unproven.items()):
        told = ", ".join(sorted(parameters))
        if reason == CALCULATED:
            yield f"CALCULATED: {told}: from parameters of the plan, as in a simulation; no sensor was read for it"
        else:
            yield f"UNPROVEN: {told}: {reason}"
    if number := sum(each.deviates for each in counted):
        yield f"{number} of {len(counted)} packages that count {'deviates' if number == 1 else 'deviate'} from the plan"
    if left_out:
        yield f"Not given, though {'it has' if len(left_out) == 1 else 'they have'} such figures: {_listed(left_out)}"
    if missing:
        yield f"The ledger names runs that are missing here and may have such figures: {_listed(missing)}"


def _listed(runs: Sequence[str]) -> str:
    """Return names in order, the first few of many."""
    more = f" and {len(runs) - _MOST} more" if len(runs) > _MOST else ""
    return f"{', '.join(sorted(runs)[:_MOST])}{more}"
