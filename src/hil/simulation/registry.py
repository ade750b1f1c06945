"""Plants and peers by name: entry points of `hil.plants` and `hil.peers`, ours and other packages'."""

from __future__ import annotations

from functools import partial
from typing import TypeVar

from hil.documents.offers import Offers
from hil.model.errors import Refused
from hil.simulation.peers.model import PeerModel
from hil.simulation.plants.model import PlantModel
from hil.simulation.truth import Path, TruthError

__all__ = ["PEERS", "PLANTS", "offered"]

_Offer = TypeVar("_Offer")


def _problem(kind: type, name: str, found: object) -> str:
    del name
    return "" if isinstance(found, kind) else f"is {found!r:.80}, not a {kind.__name__}"


PLANTS: Offers[PlantModel] = Offers(
    "hil.plants", "plant model", partial(_problem, PlantModel), "a hil.simulation.plants.model.PlantModel"
)
"""Every plant model by the name that bench files use."""

PEERS: Offers[PeerModel] = Offers(
    "hil.peers", "peer", partial(_problem, PeerModel), "a hil.simulation.peers.model.PeerModel"
)
"""Every peer by the name of the driver that it is the counterpart of."""


def offered(offers: Offers[_Offer], name: str, path: Path) -> _Offer:
    """Return an offer that a bench file names at a path.

    Raises:
        TruthError: if it is refused.
    """
    try:
        return offers[name]
    except Refused as error:
        raise TruthError(path, str(error)) from error
