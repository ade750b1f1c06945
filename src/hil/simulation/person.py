"""Simulated operator: attaches boards, and reads a compass and meters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil.model.errors import Refused
from hil.simulation.plants.plant import Plant
from hil.simulation.truth import TruthError, UnknownPlant, suggestion

__all__ = ["Person"]

_OUTWARD, _INWARD, _UNCLEAR = "outward", "inward", "unclear"
_NONE = "none"
_OF_HANDS = frozenset({"connect", "attach"})
_COMPASS_THRESHOLD = 1.0
"""Change of field [uT] that a phone's compass shows clearly."""


class Person:
    """Answers the operator's questions on a simulated bench.

    The bench file maps names of questions to `plant.point`. `connect` needs an input, `choose` and
    `measure` need a signal. `confirm` is always yes: a simulated bench has no hazards.

    A direction is read as with a phone: note the field without current, switch on, and observe the change
    along the outward normal. So the signal to map is the coil's contribution along it (`coil.outward`),
    without the Earth's field. From 1 uT the change is clear; below that it is unclear.

    Args:
        knows: question name to `plant.point`.
        plants: every plant by name.

    Raises:
        TruthError: if a point does not exist.
    """

    def __init__(self, knows: Mapping[str, str], plants: Mapping[str, Plant]) -> None:
        self._points = {question: _find(question, point, plants) for question, point in knows.items()}

    def answer(self, form: str, name: str, text: str, options: Sequence[str] = ()) -> str | float | bool:
        """Answer one question.

        Args:
            form: `confirm`, `choose`, `measure` or `connect`; `attach` is what `connect` was called before.
            name: the question's name.
            text: the operator's prompt; the simulated operator uses only name and options.
            options: the possible answers; for `connect` the first is the requested one.

        Raises:
            Refused: if the answer is unknown, or not among the options.
        """
        del text
        match form:
            case "confirm":
                return True
            case "connect" | "attach":
                return self._connect(name, options)
            case "choose":
                return self._choose(name, options)
            case "measure":
                plant, signal = self._point(name, "signal")
                return plant.observe(signal)
        if form == "file":
            raise Refused(f"the simulated person has no file to attach for '{name}'", "give one with --answers FILE")
        raise Refused(
            f"the simulated person does not know questions of the form '{form}'", "answer with --answers FILE"
        )

    def act(self, form: str, name: str, said: str | float | bool) -> None:
        """Carry out an answer given by someone else.

        Only `connect` has an effect, and only where the bench file maps the question.

        Args:
            form: as of `answer`.
            name: the question's name.
            said: the answer; for `connect` the item connected.

        Raises:
            Refused: if the plant has no such thing.
        """
        if form in _OF_HANDS and name in self._points:
            self._connect(name, (str(said),))

    def _connect(self, name: str, options: Sequence[str]) -> str:
        """Connect the requested item, the first option; `none` disconnects the present one."""
        plant, point = self._point(name, "input")
        wanted = options[0] if options else ""
        value = "" if wanted == _NONE else wanted
        choices = plant.choices(point)
        if not wanted or (choices and value not in choices):
            raise Refused(
                f"the simulated person has no '{wanted}' to connect for '{name}'",
                f"plant '{plant.name}' has {', '.join(choice for choice in choices if choice) or 'no list of them'}",
            )
        plant.command(**{point: value})
        return wanted

    def _choose(self, name: str, options: Sequence[str]) -> str:
        plant, signal = self._point(name, "signal")
        change = plant.observe(signal)
        seen = _UNCLEAR
        if abs(change) >= _COMPASS_THRESHOLD:
            seen = _OUTWARD if change > 0 else _INWARD
        if options and seen not in options:
            raise Refused(
                f"the simulated person saw '{seen}' for '{name}', which is not among {', '.join(options)}",
                f"offer {_OUTWARD}, {_INWARD} and {_UNCLEAR}",
            )
        return seen

    def _point(self, name: str, kind: str) -> tuple[Plant, str]:
        if name not in self._points:
            raise Refused(
                f"the simulated person does not know what '{name}' is",
                f"map '{name}' to a plant's {kind} under simulated.person in the bench file",
            )
        plant, point = self._points[name]
        if (point in plant.inputs) != (kind == "input"):
            raise Refused(
                f"the simulated person knows '{name}' as '{plant.name}.{point}', which is no {kind}",
                "correct simulated.person in the bench file",
            )
        return plant, point


def _find(question: str, point: str, plants: Mapping[str, Plant]) -> tuple[Plant, str]:
    name, _, rest = point.partition(".")
    if name not in plants:
        raise UnknownPlant(("person", question), name, tuple(plants))
    known = (*plants[name].inputs, *plants[name].signals)
    if rest not in known:
        raise TruthError(("person", question), f"plant '{name}' has no '{rest}'{suggestion(rest, known)}")
    return plants[name], rest
