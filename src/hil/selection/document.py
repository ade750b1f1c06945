"""What a selection found, as data: the same for a page, CSV and JSON."""

from __future__ import annotations

import msgspec

__all__ = ["Cell", "Document", "Excluded", "Package", "Share", "Standing", "Unjudged", "Used"]


class Used(msgspec.Struct, frozen=True, kw_only=True):
    """One axis of a candidate: the figure that counted, of one or several runs.

    Attributes:
        of: the axis, such as `gyroscope.lsm.x`; empty without one.
        value: in the unit of the cell.
        uncertainty: standard uncertainty.
        dof: degrees of freedom, None if infinite.
        packages: the evidence digests of the packages that it is from, sorted.
    """

    of: str
    value: float
    uncertainty: float
    dof: float | None
    packages: tuple[str, ...]


class Standing(msgspec.Struct, frozen=True, kw_only=True):
    """A candidate in a criterion.

    Attributes:
        candidate: its name.
        rank: the best place that it can have.
        last: the worst place that it can have.
        value: the magnitude that counted, in the unit of the cell.
        uncertainty: its standard uncertainty.
        expanded: its expanded uncertainty at the confidence of the selection.
        of: the worst axis, where that counts; empty for a mean.
        ties: the candidates that cannot be told apart from it.
        probability: that it is the best of those that were judged.
        axes: what it was computed from.
    """

    candidate: str
    rank: int
    last: int
    value: float
    uncertainty: float
    expanded: float
    of: str
    ties: tuple[str, ...]
    probability: float
    axes: tuple[Used, ...]


class Unjudged(msgspec.Struct, frozen=True, kw_only=True):
    """A candidate that has no place in a criterion, and why, a sentence each."""

    candidate: str
    reasons: tuple[str, ...]


class Cell(msgspec.Struct, frozen=True, kw_only=True):
    """A criterion for one role.

    Attributes:
        role: the role.
        criterion: the name of the criterion.
        parameter: its parameter.
        unit: the unit of all values.
        combine: `worst` axis or `mean`.
        weight: its weight.
        best: who can be the best: the only first one, or all that cannot be told from each other; empty if nobody was
            judged.
        standings: those that were judged, the best first.
        unjudged: the others.
        notes: remarks for the reader, a sentence each.
    """

    role: str
    criterion: str
    parameter: str
    unit: str
    combine: str
    weight: float
    best: tuple[str, ...]
    standings: tuple[Standing, ...]
    unjudged: tuple[Unjudged, ...]
    notes: tuple[str, ...]


class Share(msgspec.Struct, frozen=True, kw_only=True):
    """Which share of the weights a candidate wins, as an expectation: by the probabilities to be the best.

    Attributes:
        role: the role; empty for all roles together.
        candidate: its name.
        low: what it wins if all that were not judged are better.
        share: what it wins among those that were judged.
        high: what it wins if it is the best wherever it was not judged.
    """

    role: str
    candidate: str
    low: float
    share: float
    high: float


class Excluded(msgspec.Struct, frozen=True, kw_only=True, order=True):
    """Something that did not count.

    Attributes:
        run: the run.
        what: what of it: `the whole package`, or parameter and axis.
        reason: why, a sentence without its full stop.
        candidate: whose figure it is, empty for a whole package.
    """

    run: str
    what: str
    reason: str
    candidate: str = ""


class Package(msgspec.Struct, frozen=True, kw_only=True):
    """A package that was read: run, evidence digest, and what it is; `used` is the number of figures that counted."""

    run: str
    digest: str
    source: str
    purpose: str
    bench: str
    serial: str
    began: str
    deviates: bool
    used: int


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """A selection.

    Attributes:
        title: what it is for.
        criteria: SHA-256 of the criteria file.
        confidence: at which candidates are told apart.
        warnings: what stands first, a sentence each: simulated runs, evidence that was not given.
        candidates: all candidates by role, in the order of the file.
        cells: every criterion of every role.
        shares: by role and over all roles, the largest first.
        excluded: what did not count, sorted.
        packages: what was read, sorted by run.
        version: the version of hil.
        format: the number of the format.
    """

    title: str
    criteria: str
    confidence: float
    warnings: tuple[str, ...]
    candidates: dict[str, tuple[str, ...]]
    cells: tuple[Cell, ...]
    shares: tuple[Share, ...]
    excluded: tuple[Excluded, ...]
    packages: tuple[Package, ...]
    version: str
    format: int = 1
