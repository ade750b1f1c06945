"""A bench that nobody can look after any more is not tried on."""

from __future__ import annotations

from unittest.mock import Mock

from adcs_bench import adcs, bound

from hil.executive.ending.stop import StopFlags
from hil.executive.watching.keeper import BenchKeeper
from hil.model.identity import Dut, Model


def tried(told):
    """Return the gates of outputs that were tried."""
    return [facts["name"] for facts in told if facts["name"].startswith("reduced level")]


def test_arming_ends_when_the_guardian_dies_amid_it():
    """What was tried last is off again; no other output is switched on, and the gate says why."""
    told = []
    with bound(adcs()) as bench:
        dut = Dut(serial="S", part="P", hardware="A", model=Model.EM)
        keeper = BenchKeeper(bench, dut, StopFlags(), lambda _, **facts: told.append(facts), Mock(), lambda: None)
        keeper.scheduler.present.distress = lambda: "the guardian is gone" if tried(told) else ""
        assert keeper.arm() == "bench looked after: the guardian is gone"
        assert not any(bench.roles[name].enabled() for name in ("supply.sensor", "supply.coil"))
    assert len(tried(told)) == 1
    assert told[-1] == {"name": "bench looked after", "ok": False, "detail": "the guardian is gone"}
