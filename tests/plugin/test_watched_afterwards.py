"""The watch after a run: what reads as if it were off, and is not, makes the end unsafe and is named."""

from __future__ import annotations

import pytest
from chamber_wiring import wire_chamber
from told_as_json import bodies, results_as_json
from workspaces import agreed, make

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system  # each test is a whole run

CASE = """
    @pytest.mark.requirement("T-010")
    @pytest.mark.max_duration(7200)
    def test_warm(thermal, relays, clock, check):
        \"\"\"The plate is kept warm for a while, with the lamp on.\"\"\"
        thermal.hold(30.0)
        relays.close("lamp")
        clock.sleep(120)
        check("T-010", "ratio", Figure(value=1.0, unit="1", uncertainty=0.01))
    """

WATCH = """
watch_after:
- {output: thermal, quantity: temperature, unit: degC, toward: "22", tolerance: "3", within: 120 s}

simulated:
"""


def ended(tmp_path, *faults, lamp=""):
    """Run the case on a bench with these faults, and return how it ended."""
    workspace = make(tmp_path / "workspace", CASE)
    wire_chamber(workspace, *faults, lamp=lamp)
    workspace.change_bench({"\nsimulated:\n": WATCH})
    return workspace.run()


def lines(ran):
    """Return what was written down of the watch."""
    return [event for event in bodies(ran.package, "safe") if event["state"] == "watched"]


def test_what_is_off_is_seen_to_be_off(tmp_path):
    """The plate falls; readings are a recording of the package, and a replay agrees."""
    ran = ended(tmp_path)
    agreed(ran, {"test_warm": "PASS"}, "PASS", 0)
    (line,) = lines(ran)
    assert (line["output"], line["ok"], line["duration"]) == ("thermal", True, pytest.approx(120, abs=5))
    (recording,) = [
        each for each in bodies(ran.package, "recording") if each["recording"] == "after-thermal-temperature"
    ]
    assert recording["channels"][0]["unit"] == "degC"
    assert replay(ran.package).differences == ()


@pytest.mark.parametrize(
    ("faults", "lamp"),
    [(("{kind: runaway, from: 130 s}",), ""), ((), '{welded: ["3"]}')],
    ids=["a cooler that drives on", "a lamp that is welded on"],
)
def test_what_only_reads_off_ends_unsafe(tmp_path, faults, lamp):
    """Every line of the safe-off is proven, the plate goes elsewhere: exit 7, and the output is named."""
    ran = ended(tmp_path, *faults, lamp=lamp)
    assert ran.code == 7
    assert all(event["ok"] for event in bodies(ran.package, "safe") if event["state"] != "watched")
    (line,) = lines(ran)
    assert not line["ok"]
    assert line["detail"].endswith("and not toward 22 degC: something still drives it")
    assert "NOT SAFE: thermal watched, its temperature went" in ran.out
    assert results_as_json(ran.package)["safe"] is False
    assert "something still drives it" in ran.page()
