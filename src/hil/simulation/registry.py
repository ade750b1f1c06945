"""Plants, peers and link faults by name: entry points of `hil.plants`, `hil.peers` and `hil.faults`."""

from __future__ import annotations

from functools import partial
from typing import TypeVar

from hil.documents.offers import Offers
from hil.model.errors import Refused
from hil.simulation.faults import Fault, LinkFault
from hil.simulation.peers.model import PeerModel
from hil.simulation.plants.model import PlantModel
from hil.simulation.truth import Path, TruthError

__all__ = ["FAULTS", "PEERS", "PLANTS", "fault_kinds", "offered"]

_Offer = TypeVar("_Offer")


def _problem(kind: type, name: str, found: object) -> str:
    del name
    return "" if isinstance(found, kind) else f"is {found!r:.80}, not a {kind.__name__}"


def _fault_problem(name: str, found: object) -> str:
    if not (isinstance(found, type) and issubclass(found, LinkFault)):
        return f"is {found!r:.80}, not a LinkFault"
    if found.name != name:
        return f"calls itself '{found.name}'"
    return "" if found.links else "hits devices on no link: name some in 'links'"


PLANTS: Offers[PlantModel] = Offers(
    "hil.plants", "plant model", partial(_problem, PlantModel), "a hil.simulation.plants.model.PlantModel"
)
"""Every plant model by the name that bench files use."""

PEERS: Offers[PeerModel] = Offers(
    "hil.peers", "peer", partial(_problem, PeerModel), "a hil.simulation.peers.model.PeerModel"
)
"""Every peer by the name of the driver that it is the counterpart of."""

FAULTS: Offers[type[LinkFault]] = Offers(
    "hil.faults", "fault", _fault_problem, "a class of hil.simulation.faults.LinkFault with that name"
)
"""Every kind of fault that can hit any device on a link, by the name that bench files use."""


def fault_kinds(model: PeerModel) -> tuple[type[Fault], ...]:
    """Return the kinds of faults that can hit a peer: those of its link, and its own.

    A kind that cannot be used is left out; see `offered` for why it cannot.
    """
    common = (kind for kind in map(FAULTS.find, FAULTS) if kind and model.link in kind.links)
    return (*common, *model.fault_kinds)


def offered(offers: Offers[_Offer], name: str, path: Path) -> _Offer:
    """Return an offer that a bench file names at a path.

    Raises:
        TruthError: if it is refused.
    """
    try:
        return offers[name]
    except Refused as error:
        raise TruthError(path, str(error)) from error
