"""The programming guide of a SCPI power supply: what its outputs can give, and how they deviate."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.scpi_instrument import instrument_of
from hil.simulation.peers.scpi_manual import Channel, Manual
from hil.simulation.peers.supply_output import OutputTruth, Rating, SupplyOutput, read_outputs

__all__ = ["SupplyManual", "model_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SupplyManual(Manual):
    """What the programming guide of a supply says.

    Attributes:
        ratings: by number of the output.
        deviates: what a bench file says of an output.
        output: the class of its outputs.
        of_model: ratings of the models that a truth may name, where they differ.
    """

    ratings: Mapping[int, Rating]
    deviates: type[OutputTruth]
    output: type[SupplyOutput] = SupplyOutput
    of_model: Mapping[str, Mapping[int, Rating]] = field(default_factory=dict)


def model_of(manual: SupplyManual) -> PeerModel:
    """Return the model of a manual; terminals `1`, `2`, ... go to supply ports of plants."""

    def outputs(setup: PeerSetup, article: Mapping[str, object]) -> dict[int, Channel]:
        ratings = manual.of_model.get(str(article.get("model", "")), manual.ratings)
        return dict(read_outputs(setup, ratings, manual.deviates, manual.output))

    return instrument_of(manual, outputs)
