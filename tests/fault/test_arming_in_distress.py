"""A bench that nobody can look after any more is not tried on."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import Mock

from adcs_bench import adcs, bound
from case_parts import Written

from hil.clock.live import LiveClock
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.timeline import OnLiveBench
from hil.model.identity import Dut, Model


def tried(written):
    """Return the gates of outputs that were tried."""
    names = [event["name"] for event in written.of("gate")]
    return [name for name in names if name.startswith("reduced level")]


def test_arming_ends_when_the_guardian_dies_amid_it():
    """What was tried last is off again; no other output is switched on, and the gate says why."""
    written = Written()

    class Guarded(NoMachine):
        """A machine whose guardian dies after the first output was tried."""

        def distress(self):
            """Tell of the guardian."""
            return "the guardian is gone" if tried(written) else ""

    with bound(adcs()) as bench:
        dut = Dut(serial="S", part="P", hardware="A", model=Model.EM)
        clock = LiveClock("2026-01-01T00:00:00Z")
        timeline = OnLiveBench(bench, clock, Guarded(), SimpleNamespace(course=0))
        keeper = BenchKeeper(bench, dut, StopFlags(), written, Mock(), Guarded(), timeline, ())
        assert keeper.arm() == "bench looked after: the guardian is gone"
        assert not any(bench.roles[name].enabled() for name in ("supply.sensor", "supply.coil"))
    assert len(tried(written)) == 1
    last = written.events[-1]
    assert (last["name"], last["ok"], last["detail"]) == ("bench looked after", False, "the guardian is gone")
