"""Units that are words of the definition file, prefixed or not, and products of words: known without pint.

Nearly every unit of a catalogue is one of these, and to load pint takes longer than to load the catalogue. What is said
here of a unit is what pint says of it, to the last bit; of any other text nothing is said.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple

__all__ = ["DEFINITIONS", "LONGEST", "UnitWord", "is_product", "kind_of", "unit_word"]

DEFINITIONS = Path(__file__).with_name("units.txt")
LONGEST = 100
"""No unit is a longer text."""

_WORD = r"[A-Za-zµμΩ°%]+"
_FACTOR = rf"(?:sqrt\({_WORD}\)|√{_WORD}|{_WORD}(?:(?<!%)(?:[²³]|(?:\^|\*\*)[23]))?)"
_TIMES = r"(?:[*/]|(?<=[A-Za-z%°Ω)²³])[.·](?=[A-Za-zµμΩ°]))"
_PRODUCT = re.compile(rf"(?:1/)?{_FACTOR}(?:{_TIMES}{_FACTOR})*")
_NAME = re.compile(rf"sqrt\(({_WORD})|({_WORD})")
_PART = re.compile(rf"(1/|{_TIMES})?(?:(sqrt\(|√)({_WORD})\)?|({_WORD})([²³]|(?:\^|\*\*)[23])?)")
_POWERS = {"²": 2, "³": 3, "2": 2, "3": 3}
_TERM = re.compile(r"([*/]?)\s*([^\s*/]+)(?:\s*\*\*\s*(\d+))?\s*")

Dimension = frozenset[tuple[str, float]]
"""Powers of base units, halves of roots among them."""


class UnitWord(NamedTuple):
    """A unit of one word.

    Attributes:
        name: the unit's first name, without a prefix.
        prefix: what its prefix stands for, 1 without one.
        size: in base units, prefix included.
        dimension: powers of base units.
        offset: whether its zero is not that of its base unit.
    """

    name: str
    prefix: float
    size: float
    dimension: Dimension
    offset: bool


_NOTHING = UnitWord("1", 1.0, 1.0, frozenset(), offset=False)


@lru_cache(maxsize=1024)
def is_product(text: str) -> bool:
    """Return whether a text is certainly a unit: words, and their roots and powers, multiplied or divided."""
    if unit_word(text) is not None:
        return True
    if len(text) > LONGEST:
        return False
    return _PRODUCT.fullmatch(text) is not None and all(unit_word(a or b) is not None for a, b in _NAME.findall(text))


@lru_cache(maxsize=1024)
def kind_of(text: str) -> tuple[Dimension, bool] | None:
    """Return what a unit measures, and whether its zero is not that of its base unit; None unless it is a product.

    Numbers in two units of one kind convert.
    """
    if word := unit_word(text):
        return word.dimension, word.offset
    if not is_product(text):
        return None
    powers: dict[str, float] = {}
    for sign, root, rooted, name, power in _PART.findall(text):
        exponent = 0.5 if root else float(_POWERS[power[-1]]) if power else 1.0
        for base, of_it in (unit_word(rooted or name) or _NOTHING).dimension:
            powers[base] = powers.get(base, 0.0) + of_it * (-exponent if "/" in sign else exponent)
    return frozenset((base, power) for base, power in powers.items() if power), False


@lru_cache(maxsize=1024)
def unit_word(text: str) -> UnitWord | None:
    """Return a unit of one word, None for anything else."""
    prefixes, units = _definitions()
    if text in units:
        return units[text]
    for prefix, factor in prefixes.items():
        unit = units.get(text.removeprefix(prefix)) if text.startswith(prefix) else None
        if unit is not None and not unit.offset and text[len(prefix) :].isalpha():
            return unit._replace(prefix=factor, size=factor * unit.size)
    return None


@cache
def _definitions() -> tuple[Mapping[str, float], Mapping[str, UnitWord]]:
    """Return prefixes and units, each by every name that it has."""
    prefixes: dict[str, float] = {}
    units = {"1": _NOTHING}
    for line in DEFINITIONS.read_text(encoding="utf-8").splitlines():
        names, _, rest = line.partition("#")[0].partition(" = ")
        if not rest or names.startswith(" "):
            continue
        meaning, *others = rest.strip().split(" = ")
        every = [names, *(name for name in others if name != "_")]
        if names.endswith("-"):
            prefixes |= {name.removesuffix("-"): float(meaning) for name in every}
        else:
            units |= dict.fromkeys(every, _unit(names, meaning, prefixes, units))
    return dict(sorted(prefixes.items(), key=lambda item: -len(item[0]))), units


def _unit(name: str, meaning: str, prefixes: Mapping[str, float], units: Mapping[str, UnitWord]) -> UnitWord:
    """Return the unit of a line; what it is made of stands in lines above, but for the kilogram."""
    formula, _, zero = meaning.partition(";")
    if formula.startswith("["):
        return UnitWord(name, 1.0, 1.0, frozenset({(formula, 1)}), offset=False)
    size, powers = 1.0, dict[str, float]()
    for sign, word, power in _TERM.findall(formula):
        exponent = int(power or 1) * (-1 if sign == "/" else 1)
        if word[0].isdigit():
            size *= float(word) ** exponent
            continue
        unit = units["gram"]._replace(size=prefixes["kilo"]) if word == "kilogram" else units[word]
        size *= unit.size**exponent
        for base, of_it in unit.dimension:
            powers[base] = powers.get(base, 0) + of_it * exponent
    dimension = frozenset((base, power) for base, power in powers.items() if power)
    return UnitWord(name, 1.0, size, dimension, offset=bool(zero) and not zero.strip().endswith(" 0"))
