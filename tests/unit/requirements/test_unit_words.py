"""Units that are known without pint: what is said of each of them is what pint says."""

from __future__ import annotations

import itertools
import random
import subprocess
import sys

import pytest
from sweeps import sample

from hil.requirements import unit_words, units
from hil.requirements.unit_words import is_product, kind_of, unit_word


@pytest.fixture(scope="module")
def words():
    """Return every unit of one word, every thirtieth outside of a soak, and those without a prefix."""
    prefixes, plain = unit_words._definitions()
    every = [f"{prefix}{name}" for prefix in prefixes for name in plain]
    return [*plain, *filter(unit_word, sample(every, 60))]


def test_a_word_is_what_pint_says_it_is(words):
    """Whether it is a unit, of what dimension, with what zero, and what it is in root units."""
    registry = units._registry()
    for word in words:
        ours = unit_word(word)
        theirs = registry.parse_units("dimensionless" if word == "1" else word)
        assert dict(ours.dimension) == dict(theirs.dimensionality), word
        assert ours.offset == (str(theirs) == "degree_Celsius"), word
        if not ours.offset:
            size = registry.Quantity(1.0, theirs).to_root_units().magnitude
            assert ours.size == pytest.approx(size, rel=1e-12), word


def test_prefixes_convert_to_the_last_bit_as_with_pint():
    """What was judged before is judged again with the same numbers."""
    registry = units._registry()
    prefixes = [*unit_words._definitions()[0], ""]
    for name in sample(("A", "V", "s", "g", "Hz", "T", "ohm", "m"), 1):
        for one, other in itertools.product(prefixes, repeat=2):
            expected = registry.convert(1.0, registry.Unit(f"{one}{name}"), registry.Unit(f"{other}{name}"))
            assert units.scale(f"{one}{name}", f"{other}{name}") == expected


def test_ratios_convert_to_the_last_bit_as_with_pint():
    """They have no dimension, and no name in common."""
    registry = units._registry()
    ratios = [name for name, word in unit_words._definitions()[1].items() if not word.dimension]
    assert {"1", "%", "ppm"} <= {*ratios}
    for one, other in itertools.product(ratios, repeat=2):
        assert units.scale(one, other) == units._factor(registry, units._unit(one), units._unit(other))


def test_whatever_is_called_a_product_is_one():
    """What is no unit for pint is none here either, however it is put together."""
    chance = random.Random(1)
    pool = ["V", "mA", "s", "uT", "cycle", "%", "°", "Ω", "deg", "µs", "g0", "sqrt", "x", "1", "K", "degC", "ppm", "‰"]
    found = 0
    for _ in sample(range(20_000), 600):
        text = chance.choice(["", "", "1/"])
        for place in range(chance.randint(1, 3)):
            word = chance.choice(pool)
            made = [word, word, f"{word}²", f"{word}³", f"sqrt({word})", f"√{word}", f"{word}2", f"({word})"]
            made += [f"{word}^2", f"{word}**3", f"{word}^4"]
            text += (chance.choice("/*.· ") if place else "") + chance.choice(made)
        if is_product(text):
            found += 1
            assert units._unit(text) is not None
    assert found > 30


def test_products_convert_where_pint_says_so():
    """What a unit measures is found without pint, roots, powers and what cancels out included."""
    chance = random.Random(2)
    pool = ["V", "mA", "s", "Hz", "W", "h", "Wh", "J", "%", "deg", "K", "degC", "count"]
    made = {"1", "W.h", "V.A.s", "V/√Hz", "V*s**0.5", "1/Hz", "deg/s", "m/s^2", "degC", "K", "degC/s", "K/s", "V.V/V"}
    for _ in sample(range(400), 60):
        text = chance.choice(["", "", "1/"])
        for place in range(chance.randint(1, 3)):
            word = chance.choice(pool)
            forms = [word, word, f"{word}²", f"{word}^3", f"sqrt({word})", f"√{word}", f"{word}**2"]
            text += (chance.choice("/*.·") if place else "") + chance.choice(forms)
        made.add(text)
    known = {text: units._unit(text) for text in made if kind_of(text)}
    assert len(known) > 30
    agreed = 0
    for one, other in itertools.product(known, repeat=2):
        alike = known[one].dimensionality == known[other].dimensionality
        expected = alike and units._is_offset(known[one]) == units._is_offset(known[other])
        assert units.compatible(one, other) == expected, (one, other)
        agreed += expected and one != other
    assert agreed > 10


@pytest.mark.parametrize(
    "text", ["", " ", "V//A", "V/", "sqrt(V", "sqrt(sqrt)", "%²", "mdegC", "k%", "V" * 101, "V2", "%^2", "V^22"]
)
def test_of_what_is_no_plain_product_nothing_is_said(text):
    """Pint, or the rule for what people write, has the last word."""
    assert not is_product(text)


@pytest.mark.parametrize(
    "text", ["V", "mA.s", "A².s", "deg/s/sqrt(Hz)", "uT/√Hz", "Wh/cycle", "1/s", "1", "%", "°/√h", "W/m^2", "V**2/Hz"]
)
def test_what_requirements_are_written_in_needs_no_pint(text):
    """A start pays for it only where a unit is made in another way."""
    assert is_product(text)
    assert units.check_unit(text) is None


def test_a_catalogue_of_plain_units_loads_no_pint():
    """It takes longer to load than the catalogue."""
    code = (
        "import sys\n"
        "from hil.requirements.units import check_unit, compatible, convert, is_plain, scale\n"
        "assert check_unit('deg/s/sqrt(Hz)') is None and convert(1.5, 'A', 'mA') == 1500.0\n"
        "assert not compatible('V', 'A') and is_plain('degC') and scale('uT', 'uT') == 1.0\n"
        "sys.exit('pint' in sys.modules)\n"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
