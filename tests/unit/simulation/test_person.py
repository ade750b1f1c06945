"""The simulated person's hands and eyes."""

from __future__ import annotations

import pytest
from twin import Twin

from hil.model.errors import Refused
from hil.simulation.truth import TruthError

DIRECTIONS = ("outward", "inward", "unclear")


@pytest.fixture
def twin():
    """Return a twin with both supplies limited to the coil's usual current."""
    twin = Twin()
    twin.scpi("VOLT 5,(@2);CURR 0.016,(@2);:OUTP ON,(@2)")
    return twin


def test_attaches_what_is_asked_for(twin):
    """It is the first option; `none` takes the board away."""
    person = twin.world.person
    assert person.answer("attach", "outer_board", "Replace x_plus by y_plus.", ("y_plus", "x_plus")) == "y_plus"
    assert twin.coil.inputs["board"] == "y_plus"
    assert person.answer("attach", "outer_board", "Leave the jig empty.", ("none", "x_plus")) == "none"
    assert twin.coil.inputs["board"] == ""


@pytest.mark.parametrize("form", ["connect", "attach"])
def test_does_what_others_say_is_done(twin, form):
    """What somebody else says is connected is connected; `none` takes the board away."""
    person = twin.world.person
    person.act(form, "outer_board", "y_plus")
    assert twin.coil.inputs["board"] == "y_plus"
    person.act(form, "outer_board", "none")
    assert twin.coil.inputs["board"] == ""


@pytest.mark.parametrize(
    ("form", "name", "said"),
    [("confirm", "outer_board", True), ("choose", "compass", "outward"), ("measure", "coil_current", 1.0)],
)
def test_words_alone_move_nothing(twin, form, name, said):
    """Nor does what the bench file does not map: then there is nothing of it in the physics."""
    before = dict(twin.coil.inputs)
    twin.world.person.act(form, name, said)
    twin.world.person.act("connect", "unknown_thing", "x_plus")
    assert twin.coil.inputs == before


@pytest.mark.parametrize(("name", "said"), [("outer_board", "z_plus"), ("compass", "x_plus")])
def test_refuses_to_do_what_cannot_be_done(twin, name, said):
    """The physics has no such board, or nothing that can be connected there."""
    with pytest.raises(Refused, match="simulated person"):
        twin.world.person.act("connect", name, said)


def test_sees_the_direction_of_the_coil_alone(twin):
    """The Earth's field of -38 uT does not mislead; a change below 1 uT is unclear."""
    person = twin.world.person
    assert person.answer("choose", "compass", "", DIRECTIONS) == "unclear"
    twin.coil.command(board="y_plus")
    twin.clock.sleep(0.1)
    assert person.answer("choose", "compass", "", DIRECTIONS) == "outward"
    twin.coil.command(board="x_plus")
    twin.clock.sleep(0.1)
    assert person.answer("choose", "compass", "", DIRECTIONS) == "inward"
    twin.scpi("CURR 0.001,(@2)")
    assert person.answer("choose", "compass", "", DIRECTIONS) == "unclear"


def test_measures_and_confirms(twin):
    """A measurement is the plant's signal; a confirmation is yes."""
    twin.coil.command(board="y_plus")
    twin.clock.sleep(0.1)
    assert twin.world.person.answer("measure", "coil_current", "") == pytest.approx(0.016)
    assert twin.world.person.answer("confirm", "whatever", "Is the area clear?") is True


@pytest.mark.parametrize(
    ("form", "name", "options"),
    [
        ("attach", "unknown_thing", ("x_plus",)),
        ("attach", "outer_board", ("z_plus",)),
        ("attach", "outer_board", ()),
        ("attach", "compass", ("x_plus",)),
        ("choose", "outer_board", DIRECTIONS),
        ("choose", "compass", ("left", "right")),
        ("shout", "compass", ()),
    ],
)
def test_refuses_what_is_not_known(twin, form, name, options):
    """The person never makes an answer up."""
    with pytest.raises(Refused, match="simulated person"):
        twin.world.person.answer(form, name, "", options)


@pytest.mark.parametrize("point", ["cool.board", "coil.bord"])
def test_points_must_exist(point):
    """A point that no plant has is an error of the bench file."""
    with pytest.raises(TruthError, match="did you mean") as caught:
        Twin(person={"outer_board": point})
    assert caught.value.path == ("person", "outer_board")
