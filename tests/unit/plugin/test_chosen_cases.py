"""Which cases the command line leaves out, and why."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.executive.setup.configuration import Request
from hil.executive.setup.head import PlannedCase
from hil.model.errors import Refused
from hil.plugin.plans.collection import skipped_cases

PLACE = "testplans/small/test_small.py"
IDS = [f"{PLACE}::{name}" for name in ("test_one", "test_each[a]", "test_each[b]", "test_last")]
PLANNED = {id_: PlannedCase(id=id_, title="", plan="small", requirements=(), max_duration_s=1.0) for id_ in IDS}


def left_out(**asked):
    """Return the reason of every case that is left out, by its own name."""
    request = Request(start=Path("/"), plans=("small",), bench="b", dut="d", **asked)
    return {case.rpartition("::")[2]: reason for case, reason in skipped_cases(PLANNED, request).items()}


def test_only_leaves_every_other_case_out():
    """A case, or a function with all its cases; together they are what is run."""
    out = "left out by --only"
    assert left_out(only=("test_each",)) == {"test_one": out, "test_last": out}
    assert left_out(only=("test_each[a]", "test_last")) == {"test_one": out, "test_each[b]": out}
    assert left_out(only=(IDS[0],)) == {"test_each[a]": out, "test_each[b]": out, "test_last": out}
    assert left_out() == {}


def test_a_skipped_case_keeps_its_reason():
    """A person's reason says more than that the case was not named; the reason of a single case counts first."""
    skips = {"test_each[b]": "broken", "test_each": "no jig"}
    assert left_out(skips=skips) == {"test_each[a]": "no jig", "test_each[b]": "broken"}
    found = left_out(only=("test_one", "test_each[a]"), skips={"test_one": "no board", "test_last": "late"})
    assert found == {"test_one": "no board", "test_each[b]": "left out by --only", "test_last": "late"}


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"only": ("test_on",)}, "no case 'test_on' to run, did you mean 'test_one'?"),
        ({"skips": {"test_on": "why"}}, "no case 'test_on' to skip, did you mean 'test_one'?"),
        ({"only": ("test_one",), "skips": {"test_one": "why"}}, "every case of --only is skipped as well"),
    ],
)
def test_a_choice_that_means_nothing_is_refused(asked, told):
    """A misspelt case, and a run of nothing."""
    with pytest.raises(Refused, match=told.replace("?", r"\?")):
        left_out(**asked)
