"""A bench that nobody can look after any more is not tried on."""

from __future__ import annotations

from unittest.mock import Mock

from adcs_bench import adcs, bound
from case_parts import Written

from hil.executive.ending.stop import StopFlags
from hil.executive.watching.keeper import BenchKeeper
from hil.model.identity import Dut, Model


def tried(told):
    """Return the gates of outputs that were tried."""
    return [gate["name"] for gate in told.of("gate") if gate["name"].startswith("reduced level")]


def test_arming_ends_when_the_guardian_dies_amid_it():
    """What was tried last is off again; no other output is switched on, and the gate says why."""
    told = Written()
    with bound(adcs()) as bench:
        dut = Dut(serial="S", part="P", hardware="A", model=Model.EM)
        keeper = BenchKeeper(bench, dut, StopFlags(), told, Mock(), lambda: None)
        keeper.scheduler.present.distress = lambda: "the guardian is gone" if tried(told) else ""
        assert keeper.arm() == "bench looked after: the guardian is gone"
        assert not any(bench.roles[name].enabled() for name in ("supply.sensor", "supply.coil"))
    assert len(tried(told)) == 1
    gate = told.events[-1]
    assert (gate["name"], gate["ok"], gate["detail"]) == ("bench looked after", False, "the guardian is gone")
