"""Truth sections are read strictly, and all that is wrong is told at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import pytest

from hil.model.notation import number, one_of, vector, whole
from hil.simulation.truth import Truth, TruthError


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


@dataclass(frozen=True, kw_only=True)
class Board:
    """What a section says, and every section below it unless it says something else."""

    turns: Annotated[int, whole(1)]
    sides: Annotated[tuple[float, ...], vector(2, minimum=0)] = (1.0, 1.0)
    winding: Annotated[str, one_of("left", "right")] = "right"


def boards(values):
    """Return what is said at the top and of each board, and the path and message of everything that is wrong."""
    truth = Truth(values, ("plants", "coil", "truth"))
    read = [truth.part(Board), *(section.part(Board) for section in truth.sections("boards").values())]
    try:
        truth.finish()
    except TruthError as error:
        return read, [(each.path[3:], each.message) for each in (error, *error.others)]
    return read, []


def test_sections_differ_from_the_one_around_them():
    """Each says only what is different."""
    read, wrong = boards({"turns": "5", "winding": "left", "boards": {"x": {"turns": "6"}, "y": {"winding": "right"}}})
    assert read == [Board(turns=5, winding="left"), Board(turns=6, winding="left"), Board(turns=5)]
    assert wrong == []


def test_tells_everything_at_once_with_its_place():
    """Missing keys, bad list items and unknown keys of inner sections come together, what is inherited only once."""
    _, wrong = boards({"sides": ["1", "two"], "boards": {"x": {"winding": "lef", "colour": "red"}}})
    assert wrong == [
        ((), "truth: key 'turns' is missing"),
        (("sides", 1), 'sides: entry 2 must be a decimal number in quotes, found "two"'),
        (
            ("boards", "x", "winding"),
            "x: 'winding' must be one of left, right, found \"lef\", did you mean 'left'?",
        ),
        (("boards", "x", "colour"), "unknown key 'colour'; known are sides, turns, winding"),
    ]


def test_unknown_key_names_the_nearest():
    """A misspelt key is refused with a suggestion, besides the one that is missing now."""
    assert boards({"turn": "60"})[1] == [
        ((), "truth: key 'turns' is missing"),
        (("turn",), "unknown key 'turn', did you mean 'turns'?"),
    ]


@pytest.mark.parametrize(
    ("values", "path", "message"),
    [
        ("text", (), "must be a mapping, found 'text'"),
        ({"turns": "1", "boards": "x"}, ("boards",), "must be a mapping, found 'x'"),
        ({"turns": "1", "boards": {"x": "1"}}, ("boards", "x"), "must be a mapping, found '1'"),
    ],
)
def test_refuses_what_is_no_section(values, path, message):
    """At its place."""
    assert (path, message) in boards(values)[1]


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
        ({"levels": ["0", "2", "2"]}, ("levels",), "must be rising numbers"),
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
