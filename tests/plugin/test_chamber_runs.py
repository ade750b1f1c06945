"""Whole runs with the temperature chamber: what it finds out is an ERROR, and nothing more is run on the bench."""

from __future__ import annotations

import pytest
from chamber_wiring import wire_chamber
from workspaces import agreed, make

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system  # each test is a whole run

CASES = (
    """
    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration(7200)
    def test_cold(chamber, check):
        \"\"\"The plate is cold.\"\"\"
        chamber.hold(-16.0)
        plate = chamber.soak(300.0, within=3600.0)
        check("T-010", "ratio", Figure(value=plate / -16.0, unit="1", uncertainty=0.01))
    """,
    """
    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration(7200)
    def test_warm(chamber, check):
        \"\"\"The plate is warm, and nobody minds what goes wrong.\"\"\"
        chamber.hold(40.0)
        try:
            chamber.soak(300.0, within=3600.0)
        except Exception:
            pass
        check("T-010", "ratio", Figure(value=1.0, unit="1", uncertainty=0.01))
    """,
)


def ended(tmp_path, *faults, lamp=""):
    """Run both cases on a bench with these faults."""
    workspace = make(tmp_path / "workspace", *CASES)
    wire_chamber(workspace, *faults, lamp=lamp)
    return workspace.run()


def test_a_healthy_chamber_passes_and_is_replayed(tmp_path):
    """Armed with the controller in standby; cold and warm; replayed on its bytes without a difference."""
    ran = ended(tmp_path)
    agreed(ran, {"test_cold": "PASS", "test_warm": "PASS"}, "PASS", 0)
    assert replay(ran.package).differences == ()


def test_a_fault_of_the_chamber_is_an_error_of_the_bench(tmp_path):
    """The case that meets it is ERROR, the next one is NOT_RUN, and the bench is left safe."""
    ran = ended(tmp_path, "{kind: sensor-detached, from: 60 s}")
    agreed(ran, {"test_cold": "ERROR", "test_warm": "NOT_RUN"}, "ERROR", 1)
    assert "tec1: the plate goes away from -16 degC" in ran.reasons("test_cold")
    assert "bench fault: tec1" in ran.reasons("test_warm")


@pytest.mark.soak  # of any fault: `test_verdicts.py`
def test_a_fault_that_a_case_swallows_is_an_error_all_the_same(tmp_path):
    """The sensor comes off in the second case, which catches everything and checks on."""
    ran = ended(tmp_path, "{kind: sensor-detached, from: 1000 s}")
    agreed(ran, {"test_cold": "PASS", "test_warm": "ERROR"}, "ERROR", 1)
    assert "tec1: " in ran.reasons("test_warm")


def test_a_welded_lamp_is_an_error(tmp_path):
    """The relay reads open, and the cooler does not get the plate to -16 degC."""
    ran = ended(tmp_path, lamp='{welded: ["3"]}')
    agreed(ran, {"test_cold": "ERROR", "test_warm": "NOT_RUN"}, "ERROR", 1)
    assert "and the plate stays at -" in ran.reasons("test_cold")
