"""The pages about loads and meters, and about captures: their benches and cases run as they stand."""

from __future__ import annotations

import re

import pytest
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace

from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system  # each test is a whole run

PAGE = (ROOT / "docs/how-to/load-a-rail.md").read_text(encoding="utf-8")
CAPTURE = (ROOT / "docs/how-to/capture-a-waveform.md").read_text(encoding="utf-8")
REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: PWR, issue: "1.0", title: A rail under load}
requirements:
- {id: PWR-010, rev: 1, text: The rail shall have 7.8 to 8.1 V at 1.5 A., kind: limit, method: test,
   limits: [{parameter: voltage, unit: V, min: "7.8", max: "8.1", decision: guarded}]}
- {id: PWR-020, rev: 1, text: The load shall draw 1.5 A., kind: limit, method: test,
   limits: [{parameter: current, unit: A, min: "1.49", max: "1.51", decision: guarded}]}
- {id: PWR-030, rev: 1, text: The rail shall be recorded., kind: record, method: test,
   records: {recording: steps, channels: [supply.vbat.voltage, multimeter.rail.voltage], max_gap: 0.5 s}}
"""


CAPTURED = """\
schema: hil/requirements/1
document: {id: EPS, issue: "1.0", title: A board that is switched on}
requirements:
- {id: EPS-POWER-010, rev: 1, text: The rail shall rise within 3 ms., kind: limit, method: test,
   limits: [{parameter: rise_time, unit: ms, max: "3", decision: guarded}]}
- {id: EPS-POWER-020, rev: 1, text: The inrush shall be below 2.5 A., kind: limit, method: test,
   limits: [{parameter: inrush, unit: A, max: "2.5", decision: guarded}]}
"""
CERTIFICATE = """calibration: {certificate: certificates/dmm1.txt, due: "2030-01-01", ranges: [
    {quantity: voltage, unit: V, from: "-10", to: "10", absolute: "0.05", relative: "0.03"},
    {quantity: current, unit: A, from: "-5", to: "5", absolute: "0.05", relative: "0.03"}]}"""

BOARD = "board: {model: power-converter, grid: 1 ms}"


def workspace(root, bench_text, case, requirements):
    """Return a workspace with this bench and this plan."""
    bench, plan = root / "fixtures/benches/power", root / "testplans/power"
    for folder in (bench / "certificates", plan):
        folder.mkdir(parents=True)
    (root / "hil.toml").touch()
    (bench / "bench.yaml").write_text(bench_text, encoding="utf-8")
    (bench / "certificates/dmm1.txt").write_text("A certificate.\n", encoding="utf-8")
    duts = (
        "schema: hil/duts/1\nduts:\n- {serial: B-1, part: B, model: EM, hardware: A, simulated: true, title: Board}\n"
    )
    (root / "fixtures/duts.yaml").write_text(duts, encoding="utf-8")
    (plan / "requirements.yaml").write_text(requirements, encoding="utf-8")
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n", encoding="utf-8")
    (plan / "test_power.py").write_text(case, encoding="utf-8")
    made = Workspace(root, plan)
    made.lock()
    return made


@pytest.fixture
def made(tmp_path):
    """Return a workspace with what the page shows."""
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (case,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    return workspace(tmp_path / "workspace", text, case.replace('"PWR-020"', '"PWR-020", "PWR-030"', 1), REQUIREMENTS)


def changed(made, old, new):
    """Change the bench file."""
    path = made.root / "fixtures/benches/power/bench.yaml"
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def ran(made):
    """Run the plan on the bench."""
    return made.run(bench="power", dut="B-1")


def test_the_page_runs_as_it_stands(made):
    """The load shows at the supply, at the multimeter and in the recording; the certificate gives the uncertainty."""
    run = ran(made)
    results = results_as_json(run.package)
    assert (run.code, results["verdict"]) == (0, "PASS"), run.out
    assert verify(run.package.folder).findings == ()
    checks = {check["parameter"]: check for case in results["cases"] for check in case["checks"]}
    assert float(checks["voltage"]["value"]) == pytest.approx(8.0 - 1.5 * 0.05, abs=0.02)
    assert float(checks["voltage"]["uncertainty"]) > 0
    recording = next(body for body in bodies(run.package, "recording") if body.get("name") == "steps")
    assert [channel["name"] for channel in recording["channels"]] == [
        "supply.vbat.voltage", "supply.vbat.current", "multimeter.rail.voltage",
    ]  # fmt: skip


@pytest.mark.system
@pytest.mark.parametrize(
    ("old", "new", "verdict"),
    [
        ('series: "0.05"', 'series: "0.2"', "FAIL"),
        ("range: 10 V", "range: 1 V", "INCONCLUSIVE"),
        ("load1: {connects", "load1: {faults: [{kind: dead, from: 12 s}], connects", "ERROR"),
    ],
    ids=["wires", "overload", "dead"],
)
def test_what_goes_wrong_shows(made, old, new, verdict):
    """A rail that comes down too far, a reading beyond its range, a load that falls silent."""
    changed(made, old, new)
    run = ran(made)
    assert results_as_json(run.package)["cases"][0]["verdict"] == verdict, run.out
    assert run.code


@pytest.mark.system
def test_the_page_about_captures_runs_as_it_stands(tmp_path):
    """With its oscilloscope beside the other page's instruments, and a converter in place of the rail."""
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    wired, connected = re.findall(r"```yaml\n(.*?)```", CAPTURE, re.DOTALL)
    (case,) = re.findall(r"```python\n(.*?)```", CAPTURE, re.DOTALL)
    instrument, wire = wired.removeprefix("instruments:\n").split("wiring:\n")
    text = text.replace("vbat", "board").replace("rail.", "board.")
    for old, new in (
        ("instruments:\n", f"instruments:\n{instrument.replace('identity', f'{CERTIFICATE}, identity')}"),
        ("wiring:\n", f"wiring:\n{wire}"),
        ("  peers:\n", connected),
        ('rail: {model: power-feed, grid: 100 ms, truth: {series: "0.05", resistance: "10000"}}', BOARD),
        ('relay1: {connects: {"1": board.contact}}', "relay1: {}"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    made = workspace(tmp_path / "workspace", text, case, CAPTURED)
    run = ran(made)
    assert (run.code, results_as_json(run.package)["verdict"]) == (0, "PASS"), run.out
