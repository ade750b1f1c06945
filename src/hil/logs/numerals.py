"""Vectorised parsing of plain tables: many cells at once, by arithmetic on the bytes of a block of lines.

Eight digits are one word of eight bytes, which three multiplications turn into a number. Results equal those of `float`
to the last bit: a mantissa below 2^53 and a power of ten up to 10^22 are exact, so that one division rounds only once;
longer ones are divided with 64 bits, and `float` decides those close to the midpoint of two numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

__all__ = ["MARGIN", "Cells", "numbers", "plain"]

_Bytes: TypeAlias = NDArray[np.uint8]
_Words: TypeAlias = NDArray[np.uint64]
_Places: TypeAlias = NDArray[np.int64]

MARGIN = 32
"""Bytes required before the first line of a block."""

_LINE, _RETURN, _SPACE, _TAB, _MINUS, _PLUS, _ZERO = b"\n\r \t-+0"
_MARKS = b"eE"
_E = frozenset(_MARKS)
_BLANK = frozenset(b" \t\r")
_CARE = _E | _BLANK | {_PLUS}
_ROWS = 2  # dimensions of what is the same in every row
_WORD = 8  # bytes, and digits in it
_MOST_DIGITS = 19  # of a mantissa that fits into 64 bits
_EXPONENT = 4  # bytes of one as it is usually written: e-05
_EXACT, _EXACT_POWER, _LONG_POWER = 1 << 53, 22, 27  # mantissas and powers of ten without rounding, in 53 and 64 bits
_LONG = np.finfo(np.longdouble).nmant >= 63
_ZEROS, _HIGH, _OVER = (np.uint64(int(each * _WORD, 16)) for each in ("30", "80", "76"))
_PAIRS, _UPPER, _LOWER = (np.uint64(each) for each in (0x000000FF000000FF, 0x000F424000000064, 0x0000271000000001))
_EIGHT, _SIXTEEN, _THIRTY_TWO, _SIGN = (np.uint64(each) for each in (8, 16, 32, 63))
_KEPT = np.array([(1 << 64) - (1 << 8 * (_WORD - digits)) for digits in range(_WORD + 1)], dtype=np.uint64)
_TENS = np.array([10**power for power in range(_MOST_DIGITS + 1)], dtype=np.uint64)
_POWERS = np.array([10.0**power for power in range(_LONG_POWER + 1)])
_LONG_POWERS = np.cumprod(np.array([1] + [10] * _LONG_POWER, dtype=np.longdouble))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Positions of the cells of a block.

    Attributes:
        block: the bytes.
        places: of every separator, line end and decimal sign; shape (rows, k) where they are the same in every row.
        last: which of them end a cell; shape (width,) where they are the same in every row, else (rows, width).
        starts: of the cells, shape (rows, width), where white space separates them, else None.
        has: which of the bytes that need care the block holds.
        signs: by column that was asked for, how far before its end each cell has its decimal sign, 0 where it has none;
            None where `places` holds these signs, because they are not as far in every row.
    """

    block: _Bytes
    places: _Places
    last: _Places
    starts: _Places | None
    has: frozenset[int]
    signs: Mapping[int, int] | None = None

    def __len__(self) -> int:
        """Return the number of rows."""
        return int(self.places.shape[0] if self.places.ndim == _ROWS else self.last.shape[0])

    @property
    def beginnings(self) -> frozenset[int]:
        """The first bytes of lines."""
        ends = self.places[:-1, -1] if self.places.ndim == _ROWS else self.places[self.last[:-1, -1]]
        if self.starts is not None:
            return frozenset(np.flatnonzero(np.bincount(self.block[self.starts[:, 0]])).tolist())
        return frozenset(np.flatnonzero(np.bincount(self.block[np.append(ends + 1, MARGIN)])).tolist())

    def texts(self, column: int, rows: NDArray[np.intp]) -> list[bytes]:
        """Return the cells of a column in some rows as bytes."""
        if not rows.size:
            return []
        starts, ends, *_ = self.found(column)
        return [self.block[starts[row] : ends[row]].tobytes() for row in rows.tolist()]

    def found(self, column: int) -> tuple[_Places, _Places, _Places, NDArray[np.bool_] | None, bool]:
        """Return the positions of a column's cells.

        Starts, ends, decimal signs (or ends), which cells hold more than one, and whether each is known to hold one.
        """
        last = self.last[..., column]
        before = self.last[..., column - 1] if column else None
        if self.signs is not None:
            ends = self.places[:, column].copy()
            distance = self.signs.get(column, 0)
            points = ends - distance
            odd = None
            signed = distance > 0
            begun = None if before is None else self.places[:, column - 1]
            earlier = self.places[:-1, -1]
        elif self.places.ndim == _ROWS:
            count = int(last) - (-1 if before is None else int(before)) - 1
            ends = self.places[:, last].copy()
            points = self.places[:, last - 1].copy() if count == 1 else ends.copy()
            odd = np.ones(ends.size, dtype=np.bool_) if count > 1 else None
            signed = count == 1
            begun = None if before is None else self.places[:, before]
            earlier = self.places[:-1, -1]
        else:
            ends = self.places[last]
            first = np.concatenate([[-1], self.last[:-1, -1]]) if before is None else before
            counts = last - first - 1
            points = np.where(counts == 1, self.places[last - 1], ends)
            odd = counts > 1
            signed = False
            begun = None if before is None else self.places[before]
            earlier = self.places[self.last[:-1, -1]]
        if self.starts is not None:
            starts = self.starts[:, column].copy()
        else:
            starts = (np.concatenate([[MARGIN - 1], earlier]) if begun is None else begun) + 1
        return starts, ends, points, odd, signed


def plain(text: bytes, separator: str | None, decimal: str, width: int, columns: Sequence[int] = ()) -> Cells | None:
    """Find the cells of whole lines; None unless each line is a row of `width` cells.

    Args:
        text: MARGIN line ends, then lines, the last with its end too.
        separator: cell separator, None for any white space.
        decimal: the decimal sign.
        width: cells in a row.
        columns: those that will be asked for, counted from 0: decimal signs of others need not be found.
    """
    block = np.frombuffer(text, dtype=np.uint8)
    if separator is not None and columns:
        found = _alike(text, block, ord(separator), ord(decimal), width, columns)
        if found is not None:
            return found
    starts: NDArray[Any] | None = None
    if separator is None:
        blank = (block == _SPACE) | (block == _TAB) | (block == _LINE) | (block == _RETURN)
        starts = np.flatnonzero(blank[:-1] & ~blank[1:]) + 1
        end = np.zeros_like(blank)
        np.greater(blank[1:], blank[:-1], out=end[1:])
    else:
        end = (block == ord(separator)) | (block == _LINE)
        end[:MARGIN] = False
    places: NDArray[Any] = np.flatnonzero(end | (block == ord(decimal)))
    last: NDArray[Any]
    closing: NDArray[Any]
    rows = int(np.count_nonzero(block[MARGIN:] == _LINE))
    if not rows or not places.size:
        return None
    kinds = block[places] if separator is not None else end[places]
    regular = places.size % rows == 0 and (kinds.reshape(rows, -1) == kinds[: places.size // rows]).all()
    if regular:
        places = places.reshape(rows, -1)
        last = np.flatnonzero(end[places[0]])
        closing = places[:, -1]
    else:
        last = np.flatnonzero(end[places])
        last = last.reshape(rows, -1) if last.size == rows * width else last[:0]
        closing = places[last[:, -1]] if last.size else places[:0]
    if last.shape[-1] != width or not _in_lines(block, closing, starts, width):
        return None
    if starts is not None:
        starts = starts.reshape(rows, width)
    has = frozenset(byte for byte in _CARE if byte in text)
    return Cells(block=block, places=places, last=last, starts=starts, has=has)


def _alike(
    text: bytes, block: _Bytes, separator: int, decimal: int, width: int, columns: Sequence[int]
) -> Cells | None:
    """Find the ends of cells only; None unless the decimal sign of each column is as far from them in every row.

    A sign before the cell's own would be taken for a digit, and found to be none.
    """
    line = block == _LINE
    line[:MARGIN] = False
    end = block == separator
    end |= line
    places: NDArray[Any] = np.flatnonzero(end)
    rows = int(np.count_nonzero(line))
    if not rows or places.size != rows * width:
        return None
    places = places.reshape(rows, width)
    if not line[places[:, -1]].all():
        return None
    signs, written = {}, decimal in text
    for column in columns:
        cell = text[int(places[0, column - 1]) + 1 if column else MARGIN : int(places[0, column])]
        sign = cell.find(decimal)
        signs[column] = len(cell) - sign if sign >= 0 else 0
        if (written and sign < 0) or (sign >= 0 and (block[places[:, column] - signs[column]] != decimal).any()):
            return None
    has = frozenset(byte for byte in _CARE if byte in text)
    return Cells(block=block, places=places, last=np.arange(width), starts=None, has=has, signs=signs)


def _in_lines(block: _Bytes, closing: NDArray[Any], starts: NDArray[Any] | None, width: int) -> bool:
    """Return whether each row's last cell ends its line, so that no cell belongs to another line."""
    if starts is None:
        return bool((block[closing] == _LINE).all())
    if starts.size != closing.size * width:
        return False
    lines = np.flatnonzero(block[MARGIN:] == _LINE) + MARGIN
    return bool((closing <= lines).all() and (starts[::width][1:] > lines[:-1]).all())


def numbers(cells: Cells, column: int) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Parse a column, and return its numbers and the rows whose cell is not a plain number.

    Args:
        cells: where the block's cells are.
        column: counted from 0.
    """
    block = cells.block
    starts, ends, points, odd, signed = cells.found(column)
    if not cells.has.isdisjoint(_BLANK):
        _strip(block, starts, ends)
        np.minimum(points, ends, out=points)
        signed = False
    first = block[starts]
    negative = (first == _MINUS).astype(np.int64)
    starts += negative
    if _PLUS in cells.has:
        starts += first == _PLUS
    bad = np.zeros(starts.size, dtype=np.bool_) if odd is None else odd
    exponents = None if cells.has.isdisjoint(_E) else _exponents(block, starts, ends, points, bad)
    part = ends - points
    part -= 1 if signed and exponents is None else part > 0
    mantissa = _mantissa(block, starts, points, ends, part, bad)
    values = _divided(mantissa, part if exponents is None else part - exponents, bad)
    bits = values.view(np.uint64)
    bits |= negative.view(np.uint64) << _SIGN
    return values, np.flatnonzero(bad)


def _strip(block: _Bytes, starts: _Places, ends: _Places) -> None:
    """Strip white space from the cells' starts and ends."""
    for _ in range(MARGIN):
        first = block[starts]
        blank = ((first == _SPACE) | (first == _TAB)) & (starts < ends)
        if not blank.any():
            break
        starts += blank
    for _ in range(MARGIN):
        last = block[ends - 1]
        blank = ((last == _SPACE) | (last == _TAB) | (last == _RETURN)) & (starts < ends)
        if not blank.any():
            break
        ends -= blank


def _exponents(
    block: _Bytes, starts: _Places, ends: _Places, points: _Places, bad: NDArray[np.bool_]
) -> _Places | None:
    """Return the exponents, and move ends and points before them; None where no cell has one."""
    marks = block[ends - _EXPONENT]
    has = ((marks == _MARKS[0]) | (marks == _MARKS[1])) & (ends - starts > _EXPONENT)
    if not has.any():
        return None
    sign, tens, ones = (block[ends - place].astype(np.int64) for place in (3, 2, 1))
    tens, ones = tens - _ZERO, ones - _ZERO
    exponents = np.where(has, 10 * tens + ones, 0)
    bad |= has & ((tens < 0) | (tens > 9) | (ones < 0) | (ones > 9) | ((sign != _MINUS) & (sign != _PLUS)))
    ends -= _EXPONENT * has
    np.minimum(points, ends, out=points)
    return np.where(sign == _MINUS, -exponents, exponents)


def _mantissa(
    block: _Bytes, starts: _Places, points: _Places, ends: _Places, part: _Places, bad: NDArray[np.bool_]
) -> _Words:
    """Return the numbers that cells hold without their decimal sign; those without digits or with too many are bad."""
    words = np.ndarray((block.size - _WORD + 1,), "<u8", block, strides=(1,))
    whole = points - starts
    total = whole + part
    longest, shortest, after = int(total.max()), int(total.min()), int(part.max())
    if not shortest:
        bad |= total == 0
    if longest > _MOST_DIGITS:
        bad |= total > _MOST_DIGITS
    same = after == int(part.min())
    if longest <= _WORD and same and after:  # both parts in one word
        digits = words[ends - _WORD]
        before = digits << _EIGHT if longest < _WORD else words[points - _WORD] >> np.uint64(8 * after)
        before &= ~_KEPT[after]
        digits &= _KEPT[after]
        digits |= before
        return _value(digits, total, shortest, bad)
    mantissa = _digits(words, points, whole, bad)
    if after:
        mantissa *= _TENS[min(after, _MOST_DIGITS)] if same else _TENS.take(part, mode="clip")
        mantissa += _digits(words, ends, part, bad)
    return mantissa


def _digits(words: _Words, ends: _Places, lengths: _Places, bad: NDArray[np.bool_]) -> _Words:
    """Return the numbers that end at some places and have so many digits; others than digits are bad."""
    longest, shortest = min(int(lengths.max()), _MOST_DIGITS), int(lengths.min())
    total = _value(words[ends - _WORD], lengths, shortest, bad)
    for word in range(1, -(-longest // _WORD)):
        skipped = _WORD * word
        more = _value(words[ends - (_WORD + skipped)], lengths - skipped, shortest - skipped, bad)
        more *= _TENS[skipped]
        total += more
    return total


def _value(digits: _Words, lengths: _Places, shortest: int, bad: NDArray[np.bool_]) -> _Words:
    """Return the numbers that the last digits of words are, in place; others than digits are bad.

    Args:
        digits: eight characters each, the first in the lowest byte.
        lengths: how many of them count.
        shortest: least length.
        bad: where those that are none are noted.
    """
    digits ^= _ZEROS
    if shortest < _WORD:
        digits &= _KEPT.take(lengths, mode="clip")
    wrong = digits + _OVER
    wrong |= digits
    wrong &= _HIGH
    if wrong.any():
        bad |= wrong != 0
    pairs = digits >> _EIGHT
    digits *= _TENS[1]
    digits += pairs
    np.right_shift(digits, _SIXTEEN, out=pairs)
    digits &= _PAIRS
    digits *= _UPPER
    pairs &= _PAIRS
    pairs *= _LOWER
    digits += pairs
    digits >>= _THIRTY_TWO
    return digits


def _divided(mantissa: _Words, powers: _Places, bad: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return mantissas over powers of ten; those that might be rounded twice are bad."""
    values = mantissa.view(np.int64).astype(np.float64)
    least, most = int(powers.min()), int(powers.max())
    if least == most and 0 <= least <= _EXACT_POWER:
        values /= _POWERS[least]
    else:
        values /= _POWERS.take(powers, mode="clip")
        if least < 0:
            values *= _POWERS.take(-powers, mode="clip")
    if least >= -_EXACT_POWER and most <= _EXACT_POWER and int(mantissa.max()) < _EXACT:
        return values
    rest = np.flatnonzero(~(((mantissa < _EXACT) & (np.abs(powers) <= _EXACT_POWER)) | bad))
    if rest.size:
        power = powers[rest]
        fits = (power >= 0) & (power <= _LONG_POWER) & _LONG
        quotient = mantissa[rest].astype(np.longdouble) / _LONG_POWERS[np.where(fits, power, 0)]
        nearest = quotient.astype(np.float64)
        half = np.spacing(nearest) / 2.0
        left = np.abs(quotient - nearest.astype(np.longdouble)).astype(np.float64)
        values[rest] = nearest
        bad[rest] |= ~fits | (np.abs(left - half) <= half / 256.0)
    return values
