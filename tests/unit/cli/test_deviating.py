"""The options by which a run deviates from its plan."""

from __future__ import annotations

import pytest

from hil.cli.options import overrides_of
from hil.model.errors import Refused


def test_a_parameter_is_changed_once():
    """The second value of one parameter is never taken silently."""
    assert overrides_of(["iterations=1", "rest=60"]) == {"iterations": "1", "rest": "60"}
    with pytest.raises(Refused, match="--parameter iterations is given 2 times; give every parameter one value"):
        overrides_of(["iterations=1", "rest=60", "iterations=2"])
