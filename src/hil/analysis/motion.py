"""Motion detection in a log of gyroscope and magnetometer: rest, rotation and shaking.

The log of a satellite or balloon does not say when it was at rest, so the readings must show it. They are cut into
windows of equal length. A window is quiet if no axis scatters more than the sensor's own noise, and the field is
constant if its vector is. A steady spin is quiet too: only the field, or a rate too large for a bias, distinguishes it
from rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

__all__ = ["AXES", "FEWEST", "SURE", "Kind", "Motions", "Run", "motions"]

AXES = ("x", "y", "z")
FEWEST = 10
"""Least number of samples per window, and of windows per log."""
SURE = 5.0
"""Standard deviations beyond which a difference is significant."""

_QUIETEST = 0.2  # share of the windows, the quietest, that define the noise
_LOUDER = 1.6  # multiple of the noise up to which scatter still counts as noise
_MOVED = 0.01  # of the field: more than its drift without rotation
_SWINGS = 0.1  # of the field, rms: more than noise, even if every window swings equally
_ANOTHER = 0.3  # relative step of a rate at which another rotation begins

_Array = NDArray[np.float64]


class Kind(StrEnum):
    """Kind of motion in a phase."""

    REST = "rest"
    ROTATION = "rotation"
    UNSTEADY = "unsteady"
    MISSING = "missing"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Samples `first` to before `after` with one kind of motion; and whether the field was constant meanwhile."""

    kind: Kind
    first: int
    after: int
    still_field: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Motions:
    """Motion found in a log.

    Attributes:
        bias: bias of the rates, shape (3,): the median of the windows at rest, zeros if there was no rest.
        noise: standard deviation of a sample of the rates, shape (3,).
        calm: whether there was any rest.
        runs: runs in order of time, without gaps.
    """

    bias: _Array
    noise: _Array
    calm: bool
    runs: tuple[Run, ...]


def motions(
    rates: _Array, field: _Array | None, width: int, *, still: float, shortest: int, every: float = 1.0
) -> Motions:
    """Separate rest from motion.

    Args:
        rates: readings of the gyroscope, shape (n, 3), evenly spaced; NaN marks a missing sample.
        field: readings of the magnetometer, shape (n, 3), at the same times; NaN where it has none.
        width: samples per window; n is at least ten times that.
        still: largest change of bias, in the unit of the rates.
        shortest: shortest run reported, in windows.
        every: rows per reading of the magnetometer, 1 if it is as fast as the gyroscope.
    """
    seen = _Windows.cut(rates, width, field=None if field is None else _Windows.cut(field, width, every=every))
    if seen.missing.all():
        every_row = Run(kind=Kind.MISSING, first=0, after=len(rates), still_field=False)
        return Motions(bias=np.zeros(len(AXES)), noise=seen.noise, calm=False, runs=(every_row,))
    quiet, moves = seen.quiet(), seen.moves()
    calm = quiet & ~moves & (np.abs(seen.means).max(axis=1) <= still if field is None else True)
    bias = np.median(seen.means[calm], axis=0) if calm.any() else np.zeros(len(AXES))
    away = np.sqrt(np.square(seen.means - bias).sum(axis=1))
    sure = SURE * np.sqrt(np.square(np.maximum(seen.spreads, seen.noise)).sum(axis=1) / width)
    turns = (away > np.maximum(still, sure)) | (quiet & moves & (away > sure))
    order = (Kind.MISSING, Kind.ROTATION, Kind.REST, Kind.UNSTEADY)
    kinds = [order[place] for place in np.argmax([seen.missing, turns, quiet & ~moves, np.ones_like(turns)], axis=0)]
    found = _merged(list(zip(kinds, _cuts(seen.means - bias), strict=True)), shortest)
    runs = tuple(
        Run(
            kind=kind,
            first=begin * width,
            after=len(rates) if end == len(kinds) else end * width,
            still_field=field is not None and not bool(moves[begin:end].mean() > 0.5),
        )
        for kind, begin, end in found
    )
    return Motions(bias=bias, noise=seen.noise, calm=bool(calm.any()), runs=runs)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Windows:
    """Means (w, 3), scatters (w, 3) and noise (3,) of rates or field per window; and which windows lack half.

    `trimmed` is the scatter without the farthest sample, so that a spike does not count as motion. `width` is the
    number of samples in a complete window.
    """

    means: _Array
    spreads: _Array
    trimmed: _Array
    noise: _Array
    missing: NDArray[np.bool_]
    width: int
    field: _Windows | None = None

    @classmethod
    def cut(cls, table: _Array, rows: int, *, every: float = 1.0, field: _Windows | None = None) -> _Windows:
        """Cut a table into windows, ignoring the rows after the last complete one."""
        count, width = len(table) // rows, round(rows / every)
        parts = table[: count * rows].reshape(count, rows, len(AXES))
        here = np.isfinite(parts)
        missing = (here.sum(axis=1) < width / 2).any(axis=1)
        parts, here = np.where(missing[:, None, None], 0.0, parts), here | missing[:, None, None]
        means = np.nanmean(parts, axis=1)
        squares = np.nan_to_num(np.square(parts - means[:, None, :]))
        dof = here.sum(axis=1) - 1
        spreads = np.sqrt(squares.sum(axis=1) / dof)
        trimmed = np.sqrt(np.maximum(squares.sum(axis=1) - squares.max(axis=1), 0.0) / (dof - 1))
        means[missing] = np.nan
        told = spreads[~missing] if (~missing).any() else spreads
        noise = np.quantile(told, _QUIETEST, axis=0) / _quantile(width - 1, _QUIETEST)
        if field is not None:
            missing = missing | field.missing
        return cls(
            means=means, spreads=spreads, trimmed=trimmed, noise=noise, missing=missing, width=width, field=field
        )

    def quiet(self) -> NDArray[np.bool_]:
        """Mask of windows in which no axis scatters by more than its noise."""
        limit = max(_LOUDER, _quantile(self.width - 1, 1.0 - 1e-6))
        return (self.trimmed <= limit * self.noise).all(axis=1) & ~self.missing

    def moves(self) -> NDArray[np.bool_]:
        """Mask of windows in which the field vector changes, internally or against the neighbours."""
        if self.field is None:
            return np.zeros(len(self.means), dtype=bool)
        its = self.field
        around = np.pad(its.means, ((1, 1), (0, 0)), mode="edge")
        away = np.abs(around[2:] - around[:-2]).max(axis=1)
        size = float(np.median(np.sqrt(np.square(its.means[~its.missing]).sum(axis=1)), axis=0))
        limit = max(_MOVED * size, SURE * float(its.noise.max()) * math.sqrt(2.0 / its.width))
        swings = its.trimmed.max(axis=1) > _SWINGS * size
        moved: NDArray[np.bool_] = (~its.quiet() | swings | (away > limit)) & ~self.missing
        return moved


def _quantile(dof: int, share: float) -> float:
    """Return a quantile of the standard deviation of noise, relative to it."""
    from scipy.special import chdtri  # noqa: PLC0415 - slow to import

    return math.sqrt(float(chdtri(dof, 1.0 - share)) / dof)


def _cuts(turning: _Array) -> list[int]:
    """Return, per window, the number of earlier rate steps of a third: each ends one rotation and begins another."""
    step = np.sqrt(np.square(turning[2:] - turning[:-2]).sum(axis=1))
    size = np.sqrt(np.square(turning).sum(axis=1))
    change = step > _ANOTHER * np.maximum(size[2:], size[:-2])
    cuts = np.concatenate(([0], np.cumsum(np.diff(change.astype(int), prepend=0) > 0), [0]))
    cuts[-1] = cuts[-2]
    return [int(each) for each in cuts]


def _merged(windows: Sequence[tuple[Kind, int]], shortest: int) -> list[tuple[Kind, int, int]]:
    """Return kind, first window and the one after the last of each phase.

    A rest that is too short joins the adjacent motion, a motion that is too short an adjacent longer motion; one within
    a rest is kept, as unsteady. Only a rotation ends where another begins.
    """
    keys = [(kind, cut if kind is Kind.ROTATION else 0) for kind, cut in windows]
    runs: list[tuple[tuple[Kind, int], int, int]] = []
    for key, group in groupby(keys):
        begin = runs[-1][2] if runs else 0
        runs.append((key, begin, begin + len(list(group))))
    long = {place for place, (_, begin, end) in enumerate(runs) if end - begin >= shortest}
    named: list[tuple[Kind, int]] = []
    for place, (key, _, _) in enumerate(runs):
        beside = [*named[-1:], *(runs[near][0] for near in (place + 1,) if near in long)]
        moving = [each for each in beside if each[0] in {Kind.ROTATION, Kind.UNSTEADY}]
        named.append(key if place in long or key[0] is Kind.MISSING else (*moving, (Kind.UNSTEADY, 0))[0])
    begins = [runs[place][1] for place, key in enumerate(named) if not place or named[place - 1] != key]
    kinds = [key[0] for key, _ in groupby(named)]
    return list(zip(kinds, begins, [*begins[1:], len(windows)], strict=True))
