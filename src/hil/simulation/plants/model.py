"""Plant models: kinds of physics that bench files refer to."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hil.simulation.plants.plant import Plant
from hil.simulation.truth import Truth

__all__ = ["PlantModel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantModel:
    """One kind of plant; entry points of the group `hil.plants` name objects of this class.

    Attributes:
        build: makes one plant from its name, its grid [ns] and its truth; raises TruthError.
    """

    build: Callable[[str, int, Truth], Plant]
