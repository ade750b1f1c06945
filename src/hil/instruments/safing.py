"""Shared by drivers that describe how bytes alone make an output safe."""

from __future__ import annotations

from hil.documents.suggest import did_you_mean
from hil.instruments.role import Role
from hil.model.bench import Proof
from hil.model.errors import Refused

__all__ = ["LONGEST_REPLY_S", "NUMBER", "must_be_state", "own_bounds"]

LONGEST_REPLY_S = 0.5
"""Default reply timeout in s: the longest that one transaction may take."""

NUMBER = rb"([+-]?(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d+)?)"
"""A decimal number, as a group."""


def must_be_state(role: Role, name: str, state: str) -> None:
    """Raise Refused unless the role has that safe state.

    Args:
        role: the role that the output fills.
        name: name of the role instance, for the message.
        state: such as `off`.
    """
    states = role.states
    if state not in states:
        raise Refused(f"{name} has no state '{state}'{did_you_mean(state, states)}", f"it has {', '.join(states)}")


def own_bounds(name: str, proof: Proof | None, quantity: str) -> tuple[float, float] | None:
    """Return the bounds of a proof if it reads this quantity of this same output, otherwise None."""
    if proof is None or (proof.output, proof.quantity) != (name, quantity):
        return None
    return proof.minimum, proof.maximum
