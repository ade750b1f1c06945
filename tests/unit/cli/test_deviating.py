"""The options by which a run deviates from its plan."""

from __future__ import annotations

import pytest

from hil.cli.options import only_of, overrides_of
from hil.model.errors import Refused


def test_a_parameter_is_changed_once():
    """The second value of one parameter is never taken silently."""
    assert overrides_of(["iterations=1", "rest=60"]) == {"iterations": "1", "rest": "60"}
    with pytest.raises(Refused, match="--parameter iterations is given 2 times; give every parameter one value"):
        overrides_of(["iterations=1", "rest=60", "iterations=2"])


def test_an_only_case_is_named_once():
    """In any order; nothing named is no choice."""
    assert only_of(["test_b", "test_a"]) == ("test_a", "test_b")
    with pytest.raises(Refused, match="--only test_a is given 2 times; name every case once"):
        only_of(["test_a", "test_a"])
    with pytest.raises(Refused, match="--only is empty"):
        only_of([" "])
