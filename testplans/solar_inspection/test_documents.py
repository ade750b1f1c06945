"""The documents of the solar cells: attached, hashed, and compared with the cells by an inspector who gives a name."""

from __future__ import annotations

import pytest

AGREEMENT = ("agrees", "differs", "unclear")
DAMAGE = ("none", "crack", "chip", "lifted interconnector", "unclear")


@pytest.mark.requirement("EPS-SOL-060", "EPS-SOL-061")
@pytest.mark.max_duration(86400)
@pytest.mark.repeatable("looking at documents changes nothing")
def test_documents(operator, check, step):
    """Data sheet and 3D model are those of the cell that is fitted."""
    with step("Compare the data sheet with the cell"):
        sheet = operator.attach("The data sheet of the solar cell", name="datasheet", accepts=("pdf",))
        found = operator.choose(
            "Compare the part number in the data sheet with that on the cells and on the delivery note: does it agree?",
            AGREEMENT,
            name="datasheet-agrees",
        )
        check("EPS-SOL-060", "datasheet", found, at=named(sheet), headline="Data sheet")
    with step("Compare the 3D model with the data sheet"):
        model = operator.attach("The 3D model of the solar cell", name="model", accepts=("step",))
        found = operator.choose(
            "Compare length, width and contacts of the model with the drawing in the data sheet: do they agree?",
            AGREEMENT,
            name="model-agrees",
        )
        check("EPS-SOL-061", "model", found, at=named(model), headline="3D model")


@pytest.mark.requirement("EPS-SOL-062")
@pytest.mark.max_duration(86400)
@pytest.mark.repeatable("looking at a panel changes nothing")
def test_damage(operator, check, step):
    """The panel is undamaged, and a picture of it is kept."""
    with step("Look at the panel"):
        picture = operator.attach("A picture of the panel, sharp, from above", name="panel", accepts=("picture",))
        found = operator.choose(
            "Look at every cell with a magnifier under slanting light: what do you see?", DAMAGE, name="panel-damage"
        )
        check("EPS-SOL-062", "damage", found, at=named(picture), headline="Damage of the panel")


def named(file):
    """Return a file as the report calls it: by its name, and the beginning of its hash."""
    return f"{file.name}, SHA-256 {file.sha256[:16]}, by {file.by}"
