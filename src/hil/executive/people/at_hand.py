"""What people have at hand when a case asks: instruments of the register to read, and pictures of the plan."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from hil.documents.suggest import did_you_mean
from hil.evidence.events import PlanPicture
from hil.executive.people.files import PICTURES, problem_of
from hil.executive.setup.configuration import Configuration
from hil.executive.setup.hand_instruments import HandInstrument
from hil.executive.setup.inputs import PICTURE_ENDINGS, Inputs
from hil.model.errors import Misused

__all__ = ["AtHand", "at_hand", "picture_of"]


def _no_picture(name: str) -> PlanPicture:
    raise Misused(f"there is no picture '{name}'", "put it into the folder of the plan")


@dataclass(frozen=True, slots=True, kw_only=True)
class AtHand:
    """What a person has at hand when a case asks.

    Attributes:
        instruments: the instruments that the person can be asked to read, by name.
        picture: returns a picture of the plan by its path in the plan's folder.
    """

    instruments: Mapping[str, HandInstrument] = field(default_factory=dict)
    picture: Callable[[str], PlanPicture] = _no_picture


def at_hand(configuration: Configuration, plan: str) -> AtHand:
    """Return what people have at hand when a case of a plan asks."""
    folder = configuration.workspace.testplans / plan
    return AtHand(instruments=configuration.hand, picture=partial(picture_of, configuration.inputs, folder))


def picture_of(inputs: Inputs, folder: Path, name: str) -> PlanPicture:
    """Return a picture of a plan, which was frozen with its sources.

    Args:
        inputs: the frozen sources.
        folder: the plan's folder.
        name: the path of the picture in it.

    Raises:
        Misused: if it is missing, or not a picture.
    """
    known = {
        each.relative_to(folder).as_posix(): each
        for each in inputs.sources
        if each.suffix in PICTURE_ENDINGS and each.is_relative_to(folder)
    }
    if name not in known:
        there = f"there are: {', '.join(sorted(known))}" if known else "put a PNG or JPEG into the folder of the plan"
        raise Misused(f"{inputs.shown(folder)} has no picture {name!r}{did_you_mean(str(name), known)}", there)
    if problem := problem_of(known[name], PICTURES):
        raise Misused(problem, "put a picture there that can be shown")
    digest = hashlib.sha256(inputs.snapshot.take(known[name])).hexdigest()
    return PlanPicture(file=inputs.name_of(known[name]), sha256=digest)
