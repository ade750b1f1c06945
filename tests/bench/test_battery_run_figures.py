"""What a line of the cycler costs in a whole run: plant, port, driver, envelope, recording, seal and report."""

from __future__ import annotations

from battery_runs import battery_workspace
from told_as_json import bodies

PLAN = "battery_degradation"


def test_a_line_in_a_whole_run(cost, tmp_path):
    """Four cycles at 40 and 10 degC, from arm to the sealed package; what a run costs by itself is in it."""
    workspace = battery_workspace(tmp_path / "workspace", PLAN)

    def made():
        return workspace.run(overrides={"cycles": "4"})

    lines = 4 * 27_000 // 5
    ran = cost("five seconds of a battery's whole run", made, units=lines, rounds=1)
    (ended,) = [event for event in bodies(ran.package, "recording-end") if event["recording"].endswith("-test")]
    assert abs(ended["rows"] - lines) < lines / 50
