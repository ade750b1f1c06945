"""A trip that cannot be written down makes the bench safe all the same."""

from __future__ import annotations

from unittest.mock import Mock

import pytest
from adcs_bench import adcs, bound
from case_parts import Written

from hil.bench.envelope import Trip
from hil.executive.ending.stop import StopFlags
from hil.executive.watching.keeper import BenchKeeper
from hil.executive.watching.ports import NoMachine
from hil.executive.watching.recorded import timeline_of
from hil.model.identity import Dut, Model

NANO = 1_000_000_000


def test_the_bench_is_safe_although_the_trip_cannot_be_told():
    """Whatever writing raises, every line of the safe-off is taken before it goes on."""

    class Wordless(Written):
        """A journal that no trip can be written to."""

        def write(self, event, *, beside=None):
            """Take one event."""
            super().write(event, beside=beside)
            if event.kind() == "trip":
                raise RuntimeError("no words")

    written = Wordless()

    with bound(adcs()) as bench:
        dut = Dut(serial="S", part="P", hardware="A", model=Model.EM)
        machine = NoMachine()
        keeper = BenchKeeper(
            bench,
            dut,
            StopFlags(),
            written,
            Mock(),
            machine,
            timeline_of(bench, machine, Mock(course=0)),
            (),
        )
        bench.roles["supply.sensor"].configure(3.3, 0.02)
        bench.roles["supply.sensor"].enable()
        with pytest.raises(RuntimeError, match="no words"):
            keeper.trip(Trip("coil", 1.0, "A", "too much"))
        assert bench.roles["supply.sensor"].enabled() is False
    told = [(event["kind"], event.get("ok")) for event in written.events]
    assert told == [("trip", None), *[("safe", True)] * 3, ("safe-end", True)]
