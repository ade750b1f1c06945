"""Whole runs of the plan battery_degradation: fade, soak, firmware that does not wait, and 844 hours."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest
from battery_runs import battery_workspace
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(1800)]

PLAN = "battery_degradation"
PAGE = Path(__file__).parents[2] / "docs/how-to/degradation-run.md"
VERDICTS = {
    "EPS-DEG-001": "PASS",
    "EPS-DEG-002": "PASS",
    "EPS-DEG-003": "RECORDED",
    "EPS-DEG-004": "RECORDED",
    "EPS-DEG-005": "RECORDED",
    "EPS-DEG-006": "RECORDED",
    "EPS-DEG-007": "PASS",
    "EPS-DEG-008": "RECORDED",
    "EPS-DEG-009": "PASS",
    "EPS-DEG-010": "PASS",
    "EPS-DEG-011": "PASS",
}
CYCLES = 5
FADE_AH = -0.00107
"""By the plant's truth: 0.055 % of 2.022 Ah per cycle, and a little that growing resistances keep in the cell."""

FIVE_WEEKS, HALF_A_WEEK = 115, 11
LARGEST_RATIO = 1.2

LEVEL_1 = {
    "identity: {model: hil-cycler, serial: C0001}": "identity: {model: START ARDUINO}",
    "{role: cycler, instrument: cycler1, settings: {beat: 360 s},": "{role: cycler, instrument: cycler1,"
    ' settings: {level: "1", cycles: "2"},',
    "{output: supply.charge, watchdog: cycler,": "{output: supply.charge, hardware: interlock of the box,",
    "{output: cycler, watchdog: cycler,": "{output: cycler, hardware: interlock of the box,",
    'truth: {clock_drift: "0.0004",': 'truth: {level: "1", cycles: "2", clock_drift: "0.0004",',
}
"""Firmware that knows no rests; what it does not tell while it waits, limits and proofs cannot read."""


def found(package):
    """Return the verdict of every requirement of a run."""
    (case,) = results_as_json(package)["cases"]
    return dict(case["requirements"])


def table(package, name):
    """Return an artifact of the case as rows by column."""
    return list(csv.DictReader(package.text(f"data/attachments/test_degradation-{name}.csv").splitlines()))


def run_of(root, cycles, changes=None):
    """Run some cycles of the plan, and return how that ended."""
    return battery_workspace(root / "workspace", PLAN, changes).run(overrides={"cycles": f"{cycles}"})


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    """Run five cycles."""
    return run_of(tmp_path_factory.mktemp("degradation"), CYCLES)


def test_what_the_run_concludes(healthy):
    """Everything is met or recorded; a changed number of cycles is a deviation, which closes nothing."""
    assert healthy.code == 0
    assert found(healthy.package) == VERDICTS
    assert "parameter cycles is 5 instead of 115" in healthy.out


def test_every_half_cycle_begins_soaked(healthy):
    """The cell is within 1 K of its setpoint from the first line of every half-cycle to the last."""
    rows = table(healthy.package, "cycles")
    assert [row["cycle"] for row in rows] == [f"{number}" for number in range(1, CYCLES + 1)]
    for row in rows:
        for end in ("low", "high"):
            assert float(row[f"charge_temperature_{end} [degC]"]) == pytest.approx(40, abs=1)
            assert float(row[f"discharge_temperature_{end} [degC]"]) == pytest.approx(10, abs=1)


def test_the_fade_is_that_of_the_plant(healthy):
    """The slope of the capacity comes with an interval that holds what the plant loses per cycle."""
    fades = {row["quantity"]: row for row in table(healthy.package, "fade")}
    assert set(fades) == {"energy_fade", "capacity_fade", "time_fade"}
    assert float(fades["capacity_fade"]["low"]) < FADE_AH < float(fades["capacity_fade"]["high"])
    assert fades["time_fade"]["unit"] == "s/cycle"


def test_the_package_is_whole_and_replays(healthy):
    """The package is verified, and its checks come out of its bytes again."""
    assert verify(healthy.package.folder).ok
    replayed = replay(healthy.package)
    assert replayed.checks > 20
    assert replayed.differences == ()


def test_two_runs_have_one_content(healthy, tmp_path):
    """The same plan on the same bench gives the same content digest."""
    again = run_of(tmp_path, CYCLES)
    assert again.package.content_digest == healthy.package.content_digest


def test_one_cycle_shows_no_fade(tmp_path):
    """Its energies are recorded, and the fade is INCONCLUSIVE: nothing ends in ERROR."""
    ran = run_of(tmp_path, 1)
    assert ran.code == 1
    assert found(ran.package) == {**VERDICTS, "EPS-DEG-008": "INCONCLUSIVE"}
    assert "a fade needs 3 whole cycles after 1 of settling, and the test had 1" in ran.out


def test_a_cooler_that_does_nothing_ends_the_test_before_the_next_half_cycle(tmp_path):
    """Without a soak no discharge begins: the case is an ERROR of the bench, and the bench is safe."""
    changes = {'integral_time: "240"}': 'integral_time: "240"}\n      faults: [{kind: stuck, from: 3 h}]'}
    ran = run_of(tmp_path, 2, changes)
    assert ran.code == 1
    assert "no temperature below 11.5 within 840 s" in ran.reasons("test_degradation")
    assert not [event for event in bodies(ran.package, "step") if event["path"][-1] == "Discharge"]


def without_its_limits(text):
    """Return a bench file without what a device of level 1 cannot tell while it waits."""
    text = re.sub(r"- \{id: [a-z-]+, output: cycler,.*?\}\n", "", text, flags=re.DOTALL)
    text = re.sub(r"- \{output: cycler, quantity: current,.*?for: 60 s\}\n", "", text)
    return re.sub(
        r"(- \{output: cycler, state: stopped, within: 10 s),\n   proof: \{output: cycler, .*?\}\}", r"\1}", text
    )


def test_firmware_that_does_not_wait_leaves_the_thermal_requirement_open(tmp_path):
    """With level 1 charge and discharge run, and the thermal requirement is INCONCLUSIVE, whatever was measured."""
    workspace = battery_workspace(tmp_path / "workspace", PLAN, LEVEL_1)
    bench = workspace.root / "fixtures/benches/battery/bench.yaml"
    bench.write_text(without_its_limits(bench.read_text()))
    ran = workspace.run(overrides={"cycles": "2"})
    assert found(ran.package)["EPS-DEG-007"] == "INCONCLUSIVE", ran.out
    reasons = {event["reason"] for event in bodies(ran.package, "check") if event["requirement"] == "EPS-DEG-007"}
    assert all("waits for no temperature" in reason for reason in reasons)


def peak_of(root, cycles):
    """Run some cycles in a process of its own; return its package and its peak memory in KiB."""
    workspace = battery_workspace(root / "workspace", PLAN)
    code = (
        "import resource, subprocess, sys\n"
        "ended = subprocess.run(sys.argv[1:], capture_output=True, text=True)\n"
        "print(ended.stdout[-9999:], ended.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
    )
    arguments = ["run", PLAN, "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated"]
    ended = subprocess.run(
        [
            sys.executable,
            "-c",
            code,
            sys.executable,
            "-P",
            "-m",
            "hil.cli",
            *arguments,
            "--parameter",
            f"cycles={cycles}",
        ],
        cwd=workspace.root,
        env=workspace.environment,
        capture_output=True,
        text=True,
        check=True,
    )
    returned, peak = ended.stdout.split()[-2:]
    assert returned == "0", ended.stdout
    (folder,) = workspace.folders()
    return Package(folder), int(peak)


@pytest.mark.soak
def test_weeks_take_little_more_memory_than_days(tmp_path):
    """844 hours need at most 1.2 times the memory of 84 hours, and conclude the same of ten times the data."""
    _, days = peak_of(tmp_path / "days", HALF_A_WEEK)
    package, weeks = peak_of(tmp_path / "weeks", FIVE_WEEKS)
    assert found(package) == VERDICTS
    (ended,) = [event for event in bodies(package, "recording-end") if event["recording"].endswith("-test")]
    assert ended["rows"] * 5 == pytest.approx(844 * 3600, rel=0.005)
    assert weeks / days < LARGEST_RATIO, (weeks, days)
    (fade,) = [event for event in bodies(package, "check") if event["parameter"] == "capacity_fade"]
    assert f"capacity_fade = ({float(fade['value']):.7f} ± " in PAGE.read_text(encoding="utf-8")
