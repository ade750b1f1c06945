"""Which plant models and which peers there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points

from hil.simulation.peers import keysight_e36312a, korad_ka3005p, lis3mdl, rigol_dp832, waveshare_relay
from hil.simulation.peers.cycler import model as cycler
from hil.simulation.peers.esp301 import controller as newport_esp301
from hil.simulation.peers.eurotherm import article as eurotherm_3216
from hil.simulation.peers.iim42652 import model as iim42652
from hil.simulation.peers.model import PeerModel
from hil.simulation.peers.obc_link import model as obc_link
from hil.simulation.plants import coil, power_feed, rotation_table, thermal_chamber
from hil.simulation.plants.battery import build as battery
from hil.simulation.plants.plant import Plant
from hil.simulation.truth import Path, Truth, TruthError, suggestion

__all__ = ["PEERS", "PLANTS", "peer_model", "plant_model"]

_GROUP = "hil.peers"

PLANTS: Mapping[str, Callable[[str, int, Truth], Plant]] = {
    "battery": battery.build,
    "coil-and-earth-field": coil.build,
    "power-feed": power_feed.build,
    "rotation-table": rotation_table.build,
    "thermal-chamber": thermal_chamber.build,
}
"""Plant models by the name that bench files use."""

PEERS: Mapping[str, PeerModel] = {
    "cycler": cycler.MODEL,
    "eurotherm-3216": eurotherm_3216.MODEL,
    "iim42652": iim42652.MODEL,
    "keysight-e36300": keysight_e36312a.MODEL,
    "korad-ka3005p": korad_ka3005p.MODEL,
    "lis3mdl": lis3mdl.MODEL,
    "newport-esp301": newport_esp301.MODEL,
    "obc-link": obc_link.MODEL,
    "rigol-dp832": rigol_dp832.MODEL,
    "waveshare-relay": waveshare_relay.MODEL,
}
"""Our own peers by the driver that they are the counterpart of."""


def plant_model(name: str, path: Path) -> Callable[[str, int, Truth], Plant]:
    """Return a plant model.

    Raises:
        TruthError: if there is none of that name.
    """
    if name not in PLANTS:
        raise TruthError(path, f"unknown plant model '{name}'{suggestion(name, tuple(PLANTS))}")
    return PLANTS[name]


def peer_model(name: str, path: Path) -> PeerModel:
    """Return a peer model: one of ours, or one that another package declares in the group `hil.peers`.

    Raises:
        TruthError: if there is none of that name, or it cannot be imported.
    """
    if name in PEERS:
        return PEERS[name]
    foreign = entry_points(group=_GROUP)
    if name not in foreign.names:
        known = (*PEERS, *foreign.names)
        raise TruthError(path, f"no simulated instrument for '{name}'{suggestion(name, known)}")
    try:
        model = foreign[name].load()
    except Exception as error:  # importing somebody's module can raise anything
        raise TruthError(path, f"the peer '{name}' cannot be imported: {type(error).__name__}: {error}") from error
    if not isinstance(model, PeerModel):
        raise TruthError(path, f"the entry point '{name}' of {_GROUP} is no peer model")
    return model
