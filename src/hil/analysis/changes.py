"""Gates on changes within a record: jumps of the mean, changes of noise, wrapped counts and interleaved sensors."""

from __future__ import annotations

import itertools
import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hil.analysis.extremes import averaged, robust, step_of
from hil.analysis.gates import Facts, Gate, present

__all__ = ["interleaved", "jumps", "steady", "wrapped"]

_Array: TypeAlias = NDArray[np.float64]

_WIDTHS = (16, 32, 64, 128, 256)  # samples averaged before testing the mean
_FEWEST = 30  # averages needed to detect a jump
_BEFORE = 4  # averages before a jump: settling at the start of a record is not a jump
_BY_CHANCE = 1e-6  # false-alarm probability per record of noise
_AROUND, _WIDEST = 8, 3  # averages on either side of a jump, and the most that it may span
_BLOCK = 1 << 14  # samples processed at once, within the processor's cache
_PARTS = 8  # parts of a record whose noise is compared
_ENOUGH = 100_000  # differences that give their scatter to half a percent
_LOOKED_AT = 20_000  # samples of a part used for its noise
_LOUDER = 1.25  # ratio below which noise counts as unchanged
_SURE = 5.0  # standard deviations beyond which a difference is significant
_CUT = 4.0  # standard deviations at which samples are clipped: a spike is not a change of noise
_TURNS = {2: "other", 3: "third", 4: "fourth", 5: "fifth", 6: "sixth"}  # sensors that may take turns in one column
_ROUNDING = 1e-3  # of the scatter of the record: a smaller offset is none
_APART, _NO_CHANCE = 0.3, 8.0  # least offset of one turn's samples over the scatter, and its standard deviations
_LEAST = 50  # counts needed to judge the byte order
_WORDS = (8, 10, 12, 14, 16, 18, 20, 24, 32)  # bits of a count
_SWAPPED = 8.0  # least reduction of scatter by swapping the bytes


def jumps(channel: str, values: _Array) -> Gate:
    """Trip where the mean jumps and stays there, as after a reset; a random walk and a warm-up do not jump.

    Averages over 16 to 256 samples are compared with the last but one. s is the robust scatter of these differences;
    noise and slow drift exceed the limit of about 6 s once in a million records. The neighbourhood must be
    quiet.
    """
    name, means, width = "jumps", averaged(values, 4), 4
    noise = robust(values) / math.sqrt(1.5) if values.size > _FEWEST else 0.0
    for wider in _WIDTHS:
        means, width = averaged(means, wider // width), wider
        if means.size < _FEWEST:
            break
        away = means[2:] - means[:-2]
        here = present(away[:: 1 + away.size // _ENOUGH])
        if here.size < _FEWEST // 2:
            break
        middle = np.median(here)
        away -= middle
        scatter = max(1.4826 * float(np.median(np.abs(here - middle))), noise * math.sqrt(2.0 / width))
        limit = math.sqrt(2.0 * math.log(means.size / _BY_CHANCE)) * scatter
        far = np.flatnonzero(np.abs(away) > limit) if scatter > 0.0 else np.empty(0, dtype=np.intp)
        for place in far[np.argsort(-np.abs(away[far]))][:_AROUND].tolist():
            high = abs(float(away[place]))
            around = np.abs(away[max(0, place - _AROUND) : place + _AROUND + 1])
            before = present(means[max(0, place - _AROUND) : place + 1])
            after = present(means[place + 2 : place + 2 + _AROUND])
            if min(place, before.size, after.size) < _BEFORE:
                continue
            stays = abs(float(np.median(after) - np.median(before))) > high / 2.0
            if stays and int((around > high / 3.0).sum()) <= _WIDEST:
                number = (place + 1) * width + 1
                reason = f"the mean jumps by {high:.3g} near sample {number} and stays there"
                return Gate(name=name, channel=channel, ok=False, reason=reason, samples=(number,))
    if width == _WIDTHS[0] and means.size < _FEWEST:
        return Gate(name=name, channel=channel, ok=None, reason="there are too few samples to tell a jump")
    return Gate(name=name, channel=channel, ok=True, reason="the mean nowhere jumps and stays")


def steady(channel: str, values: _Array) -> Gate:
    """Trip where the noise of one part of a record is 1.25 times that of the rest, beyond chance.

    Noise is measured against the mean of neighbouring samples, so that drift has no effect.
    """
    name = "steady"
    power, count = np.zeros(_PARTS), np.zeros(_PARTS)
    edges = np.linspace(0, values.size, _PARTS + 1).astype(int).tolist()
    off = [_off(values[begin:end]) for begin, end in itertools.pairwise(edges)]
    every = np.concatenate(off)
    middle = 1.4826 * float(np.median(np.abs(every))) if every.size else 0.0
    if every.size < _PARTS * _PARTS * _PARTS or not middle > 0.0:
        return Gate(name=name, channel=channel, ok=None, reason="there is too little noise to compare its parts")
    for part, each in enumerate(off):
        scatter = 1.4826 * float(np.median(np.abs(each))) if each.size else 0.0
        kept = each[np.abs(each) <= _CUT * max(scatter, 0.1 * middle)]
        power[part], count[part] = float(np.einsum("i,i->", kept, kept)), kept.size
    for cut in range(1, _PARTS):
        sizes = (float(count[:cut].sum()), float(count[cut:].sum()))
        sums = (float(power[:cut].sum()), float(power[cut:].sum()))
        if min(*sizes, *sums) <= 0.0:
            continue
        ratio = math.sqrt(sums[1] / sizes[1] / (sums[0] / sizes[0]))
        chance = math.sqrt(1.0 / sizes[0] + 1.0 / sizes[1])
        if abs(math.log(ratio)) > max(math.log(_LOUDER), _SURE * chance):
            number = edges[cut] + 1
            reason = f"from about sample {number} on the noise is {ratio:.3g} times that before"
            return Gate(name=name, channel=channel, ok=False, reason=reason, samples=(number,))
    return Gate(name=name, channel=channel, ok=True, reason="the noise is the same in all parts")


def _off(values: _Array) -> _Array:
    """Return the deviations of samples from the mean of their neighbours, for a subset of a long record."""
    if values.size < _PARTS:
        return np.empty(0)
    every = max(1, (values.size - 2) // _LOOKED_AT)
    off = values[1:-1:every] - 0.5 * (values[:-2:every] + values[2::every])
    return present(off)


def interleaved(channel: str, values: _Array) -> Gate:
    """Trip where every second to sixth sample is offset from the others: several sensors share one column.

    Their offsets cancel in averages over whole turns, and decrease in others like quantisation; the result is not the
    noise of any of them. A spectral line at such a fraction of the rate trips too. The record is detrended first.
    """
    name = "interleaved"
    for turns, which in _TURNS.items():
        looked = values[: min(_ENOUGH, values.size) // turns * turns].reshape(-1, turns)
        rows = looked[np.isfinite(looked).all(axis=1)]
        if len(rows) < _LEAST or not np.ptp(rows) > 0.0:
            break
        middles = rows.mean(axis=1)
        drift = (middles[-1] - middles[0]) / (len(looked) - 1) / turns
        off = rows - middles[:, None] - drift * (np.arange(turns) - (turns - 1) / 2.0)
        means, scatter = np.abs(off.mean(axis=0)), off.std(axis=0)
        apart = means > _APART * max(float(np.median(scatter)), _ROUNDING * float(rows.std()))
        if (apart & (means * math.sqrt(len(rows)) > _NO_CHANCE * scatter)).any():
            told = f"every {which} sample is off by {float(np.ptp(off.mean(axis=0))):.3g}"
            reason = f"{told}, as where several sensors take turns in one column: give each its own"
            return Gate(name=name, channel=channel, ok=False, reason=reason)
    return Gate(name=name, channel=channel, ok=True, reason="no sample differs by its turn")


def wrapped(channel: str, values: _Array, facts: Facts) -> Gate:
    """Trip where counts wrap at the end of their range, or have their bytes in the wrong order.

    Neighbours then differ by nearly 2^n counts, and by little once 2^n is added or subtracted: signed counts read as
    unsigned, or counts that overflow.
    """
    name = "wrapped"
    lsb = facts.lsb or step_of(values)
    span = float(np.nanmax(values) - np.nanmin(values)) / lsb if lsb is not None and np.isfinite(values).any() else 0.0
    if lsb is None or not 1.0 <= span < 2.0 ** _WORDS[-1]:
        return Gate(name=name, channel=channel, ok=None, reason="what one count is worth is not known")
    modulus = 2.0 ** next(bits for bits in _WORDS if span < 2.0**bits)
    turns, first, rest = 0, 0, 0.0
    for begin in range(0, values.size - 1, _BLOCK):
        steps = present(np.diff(values[begin : begin + _BLOCK + 1])) / lsb
        large = np.abs(steps) > modulus / 2.0
        if large.any():
            first = first or begin + int(large.argmax()) + 2
            turns += int(np.count_nonzero(large))
            steps -= modulus * np.rint(steps / modulus)
        rest = max(rest, float(np.abs(steps).max(initial=0.0)))
    if turns and rest < modulus / 4.0:
        reason = f"neighbours differ by nearly {modulus:g} counts {turns} times, first near sample {first}"
        reason += ": signed counts were read as unsigned, or they overflow"
        return Gate(name=name, channel=channel, ok=False, reason=reason, samples=(first,))
    if _in_other_order(values, lsb):
        reason = "the counts scatter far less with their two bytes in the other order"
        return Gate(name=name, channel=channel, ok=False, reason=reason)
    return Gate(name=name, channel=channel, ok=True, reason="no count starts over")


def _in_other_order(values: _Array, lsb: float) -> bool:
    counts = np.rint(present(values[:_LOOKED_AT]) / lsb)
    if counts.size < _LEAST or np.abs(counts).max() >= 2.0**16 or np.ptp(counts) < 2.0**8:
        return False
    words = counts.astype(np.int64).astype(np.uint16)
    moves = (np.diff(each.astype(np.int16).astype(np.float64)) for each in (words, words.byteswap()))
    as_read, other = (float(np.median(np.abs(each))) for each in moves)
    return _SWAPPED * max(other, 1.0) < as_read
