"""Visits to a bench outside runs: what is not as the bench file says is a gate that does not hold."""

from __future__ import annotations

import pytest
from workspaces import make

from hil.bench.live import Reach
from hil.executive.setup.bench_visit import check_bench
from hil.model.identity import Source


@pytest.mark.parametrize("energise", [False, True])
def test_a_served_port_that_is_gone_is_a_gate_that_does_not_hold(tmp_path, monkeypatch, energise):
    """Nothing behind it is looked at, and nothing is driven."""
    workspace = make(tmp_path / "workspace")
    gone = Reach(source=Source.SIMULATED, ports={"psu1": str(tmp_path / "gone")}, served=tmp_path)
    monkeypatch.setattr("hil.executive.setup.bench_visit.reach_of", lambda *_: gone)
    gates = list(check_bench(workspace.root, "adcs", Source.SIMULATED, energise=energise, served=tmp_path))
    assert [(gate.name, gate.ok) for gate in gates] == [("port of psu1", False)]
    assert "cannot be opened" in gates[0].detail
