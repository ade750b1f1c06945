"""The true state of a served bench, as JSON values: what physics and instruments are, not what they say."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TypeVar

from hil.model.errors import Refused
from hil.simulation.plants.plant import Plant
from hil.simulation.served.bench import ServedBench
from hil.simulation.truth import suggestion

__all__ = ["true_state"]

_Item = TypeVar("_Item")


def true_state(bench: ServedBench, path: str) -> object:
    """Return what stands at a dotted path, all of it for an empty one.

    `plants.coil` has every signal and input of a plant; `plants.coil.field.x` is one signal, `plants.coil.field` a
    group of them, and where there is no signal of that name it is an input. `peers.psu1.outputs.2.on` is what the peer
    itself keeps, by the names that it keeps it under; `lines.psu1` tells whether a client is there, and what
    overflowed.

    Raises:
        Refused: if there is nothing of that name.
    """
    section, _, rest = path.partition(".")
    name, _, inner = rest.partition(".")
    world = bench.world
    known: dict[str, Mapping[str, object]] = {"lines": bench.lines, "peers": world.by_device, "plants": world.plants}
    if not section:
        return {key: {item: _part(bench, key, item, "") for item in items} for key, items in known.items()}
    items = _one_of(known, section)
    if not name:
        return {item: _part(bench, section, item, "") for item in items}
    _one_of(items, name)
    return _part(bench, section, name, inner)


def _part(bench: ServedBench, section: str, name: str, path: str) -> object:
    if section == "plants":
        return _of_plant(bench.world.plants[name], path)
    if section == "peers":
        state = bench.world.by_device[name].state()
        # On a byte stream the peer stands behind what goes wrong around it.
        found: object = state["peer"] if name in bench.lines else state
    else:
        line = bench.lines[name]
        found = {"open": line.is_open, "lost": line.lost}
    for key in path.split(".") if path else ():
        found = _inside(found, key)
    return _plain(found)


def _of_plant(plant: Plant, path: str) -> object:
    signals = sorted(plant.signals)
    if not path:
        seen = {name: _plain(plant.observe(name)) for name in signals}
        return {"signals": seen, "inputs": {name: _plain(value) for name, value in sorted(plant.inputs.items())}}
    if path in plant.signals:
        return _plain(plant.observe(path))
    group = [name for name in signals if name.startswith(f"{path}.")]
    if group:
        return {name.removeprefix(f"{path}."): _plain(plant.observe(name)) for name in group}
    return _plain(_one_of({**dict.fromkeys(signals), **plant.inputs}, path))


def _inside(found: object, key: str) -> object:
    if isinstance(found, list) and key.isdecimal() and int(key) < len(found):
        return found[int(key)]
    return _one_of(found if isinstance(found, Mapping) else {}, key)


def _one_of(items: Mapping[str, _Item], name: str) -> _Item:
    if name not in items:
        raise Refused(f"there is no '{name}'{suggestion(name, tuple(items))}", "ask for the state of '' to see all")
    return items[name]


def _plain(value: object) -> object:
    """Return a value as JSON has it; numbers that JSON has not are texts, such as `inf`."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value
