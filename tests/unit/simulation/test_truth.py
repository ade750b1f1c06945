"""Truth sections are read strictly, and all that is wrong is told at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import pytest

from hil.model.notation import number, vector, whole
from hil.simulation.truth import Truth, TruthError


def wrong(values, read):
    """Return the path and message of everything that is wrong."""
    truth = Truth(values, ("plants", "coil", "truth"))
    read(truth)
    with pytest.raises(TruthError) as caught:
        truth.finish()
    return [(error.path[3:], error.message) for error in (caught.value, *caught.value.others)]


def test_reads_numbers_lists_texts_flags_and_durations():
    """Decimal strings become floats, durations nanoseconds."""
    truth = Truth({"a": "1e-3", "b": ["1", "-2.5"], "c": "left", "d": True, "e": "1.5 ms", "f": ["2"]}, ("truth",))
    assert truth.number("a") == 1e-3
    assert truth.vector("b", 2) == (1.0, -2.5)
    assert truth.text("c", choices=("left", "right")) == "left"
    assert truth.flag("d", default=False) is True
    assert truth.duration_ns("e") == 1_500_000
    assert truth.integers("f", minimum=1, maximum=8) == (2,)
    assert truth.number("absent", 5.0) == 5.0
    truth.finish()


def test_unknown_key_names_the_nearest():
    """A misspelt key is refused with a suggestion."""
    found = wrong({"turn": "60"}, lambda truth: truth.number("turns", 1.0))
    assert found == [(("turn",), "unknown key 'turn', did you mean 'turns'?")]


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (60, "expected a number in quotes, not 60"),
        ("sixty", "expected a number in quotes, not 'sixty'"),
        ("nan", "expected a number in quotes, not 'nan'"),
        (True, "expected a number in quotes, not True"),
        ("0", "expected a number above 0, not 0"),
    ],
)
def test_refuses_what_is_no_number(value, message):
    """Only decimal strings within the bounds are numbers."""
    assert wrong({"turns": value}, lambda truth: truth.number("turns", above=0)) == [(("turns",), message)]


def test_tells_everything_at_once_with_its_place():
    """Missing keys, bad list items and unknown keys of inner sections come together."""

    def read(truth):
        truth.number("turns")
        truth.vector("sides", 2)
        for section in truth.sections("boards").values():
            section.text("winding", "right", choices=("left", "right"))

    found = wrong({"sides": ["1", "two"], "boards": {"x": {"winding": "lef", "colour": "red"}}}, read)
    assert found == [
        ((), "'turns' is missing"),
        (("sides", 1), "expected a number in quotes, not 'two'"),
        (("boards", "x", "winding"), "unknown value 'lef', did you mean 'left'?"),
        (("boards", "x", "colour"), "unknown key 'colour'; known are winding"),
    ]


@pytest.mark.parametrize(
    ("values", "read"),
    [
        ("text", lambda _: None),
        ({"a": "1.5"}, lambda truth: truth.integer("a")),
        ({"a": ["1"]}, lambda truth: truth.vector("a", 2)),
        ({"a": "1"}, lambda truth: truth.integers("a", minimum=0, maximum=5)),
        ({"a": ["9"]}, lambda truth: truth.integers("a", minimum=0, maximum=5)),
        ({"a": ["x"]}, lambda truth: truth.text("a")),
        ({"a": "yes"}, lambda truth: truth.flag("a", default=False)),
        ({"a": "12"}, lambda truth: truth.duration_ns("a")),
        ({"a": "x"}, lambda truth: truth.sections("a")),
    ],
)
def test_refuses_values_of_another_kind(values, read):
    """Each getter refuses what it cannot be, once, and never raises itself."""
    assert len(wrong(values, read)) == 1


@dataclass(frozen=True, kw_only=True)
class Coil:
    """One part of a section."""

    turns: Annotated[int, whole(1)] = 10
    sides: Annotated[tuple[float, ...], vector(2, above=0)] = (1.0, 1.0)
    heat: Annotated[float, number(0)] = field(default=0.0, metadata={"alias": "heating"})


@dataclass(frozen=True, kw_only=True)
class Earth:
    """Another one."""

    levels: Annotated[tuple[float, ...], vector(3, rising=True)] = (1.0, 2.0, 3.0)


def test_parts_of_a_section_are_declared():
    """Each takes its own keys, by the names of the file; what is left over is unknown."""
    truth = Truth({"turns": "3", "heating": "0.5", "levels": ["0", "1", "2"], "heat": "1"}, ("truth",))
    assert truth.part(Coil) == Coil(turns=3, heat=0.5)
    assert truth.part(Earth) == Earth(levels=(0.0, 1.0, 2.0))
    with pytest.raises(TruthError, match="unknown key 'heat', did you mean 'heating'") as caught:
        truth.finish()
    assert caught.value.path == ("truth", "heat")


@pytest.mark.parametrize(
    ("section", "path", "message"),
    [
        ({"turns": "0"}, ("turns",), "must be at least 1"),
        ({"sides": ["1"]}, ("sides",), "must be a list of 2 numbers"),
        ({"sides": ["1", "0"]}, ("sides", 1), "must be above 0"),
        ({"sides": ["one", "2"]}, ("sides", 0), "must be a decimal number in quotes"),
        ({"heating": "-1"}, ("heating",), "must be at least 0"),
        ({"levels": ["0", "2", "2"]}, ("levels",), "must be numbers that rise"),
    ],
)
def test_what_a_part_cannot_be_is_told_at_its_place(section, path, message):
    """With the path of the value."""
    truth = Truth(section, ("truth",))
    truth.part(Coil)
    truth.part(Earth)
    with pytest.raises(TruthError, match=message) as caught:
        truth.finish()
    assert caught.value.path == ("truth", *path)
