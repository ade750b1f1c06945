"""A plan with a role, a driver, a peer, a plant and a fault of another package: run, verified, replayed, refused."""

from __future__ import annotations

import textwrap

import pytest
from other_packages import TMP117, install, uninstall
from told_as_json import bodies, results_as_json
from workspaces import Workspace

from hil.bench.file.reading import load_bench
from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import procedure, replay

BENCH = """\
schema: hil/bench/1
bench: {name: air, title: A box with air, place: Table 1}
buses:
  i2c1: {port: /dev/i2c-1, frequency: 400 kHz}
instruments:
  tmp1:
    driver: tmp117
    bus: i2c1
    address: "0x48"
    identity: {model: TMP117}
    dut: true
    calibration:
      certificate: certificates/tmp1.txt
      due: "2030-01-01"
      ranges:
      - {quantity: temperature, unit: degC, from: "-20", to: "50", absolute: "0.1"}
wiring:
- {role: thermometer, instrument: tmp1, settings: {averages: "8"}, note: in the middle of the box}
envelope:
- {id: air, output: thermometer, quantity: temperature, unit: degC, max: "40", period: 5 s, max_age: 20 s}
safe_off:
- {output: thermometer, state: asleep, within: 1 s}
rest:
- {output: thermometer, state: asleep, within: 1 s}
simulated:
  seed: "7"
  epoch: "2026-03-02T06:00:00Z"
  plants:
    box: {model: still-air, grid: 100 ms, truth: {start: "20", around: "30", time: "60"}}
  peers:
    tmp1: {truth: {noise: "0.02"}, connects: {temperature: box.temperature}}
"""

REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: AIR, issue: "1.0", title: Air in a box}
requirements:
- {id: AIR-010, rev: 1, text: The air shall come to 30 degC within five minutes., kind: limit, method: test,
   limits: [{parameter: temperature, unit: degC, min: "29", max: "31", decision: guarded}]}
- {id: AIR-020, rev: 1, text: The temperature shall be recorded., kind: record, method: test,
   records: {recording: warming, channels: [temperature], rate: 4 Hz, duration: 10 s, max_gap: 1 s}}
"""

CASES = """\
    import pytest

    @pytest.mark.requirement("AIR-010", "AIR-020")
    def test_the_air_gets_warm(thermometer, record, check, step, clock):
        '''It tends to what is around it.'''
        with step("Wake the sensor"):
            thermometer.start()
        with step("Record"):
            record("warming", thermometer, duration=11.0, rate=4.0)
        with step("Wait"):
            clock.sleep(300.0)
            check("AIR-010", "temperature", thermometer.temperature())
"""


@pytest.fixture(scope="module", autouse=True)
def _package(tmp_path_factory):
    """Install the package for these tests."""
    folder = tmp_path_factory.mktemp("site")
    install(TMP117, folder)
    yield
    uninstall(TMP117, folder)


@pytest.fixture
def made(tmp_path):
    """Return a workspace that needs the package."""
    root = tmp_path / "workspace"
    bench = root / "fixtures/benches/air"
    plan = root / "testplans/air"
    for folder in (bench / "certificates", plan):
        folder.mkdir(parents=True)
    (root / "hil.toml").touch()
    (bench / "bench.yaml").write_text(BENCH, encoding="utf-8")
    (bench / "certificates/tmp1.txt").write_text("A certificate.\n", encoding="utf-8")
    duts = (
        "schema: hil/duts/1\nduts:\n- {serial: AIR-1, part: AIR, model: EM, hardware: A, simulated: true, title: Air}\n"
    )
    (root / "fixtures/duts.yaml").write_text(duts, encoding="utf-8")
    (plan / "requirements.yaml").write_text(REQUIREMENTS, encoding="utf-8")
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n", encoding="utf-8")
    (plan / "test_air.py").write_text(textwrap.dedent(CASES), encoding="utf-8")
    workspace = Workspace(root, plan)
    workspace.lock()
    return workspace


def ran(workspace, **changes):
    """Run the plan on the bench."""
    return workspace.run(bench="air", dut="AIR-1", **changes)


def test_it_runs_to_a_package_that_verifies_and_replays(made):
    """The case asks for a role that `hil` does not have; its operations are journalled like those of every other."""
    run = ran(made)
    assert (run.code, results_as_json(run.package)["verdict"]) == (0, "PASS"), run.out
    assert verify(run.package.folder).findings == ()
    effects = [(event["name"], event["effect"]) for event in bodies(run.package, "effect")]
    assert ("thermometer.start", "drives") in effects
    assert ("thermometer.temperature", "reads") in effects
    (check,) = (
        each
        for case in results_as_json(run.package)["cases"]
        for each in case["checks"]
        if each["parameter"] == "temperature"
    )
    assert 29.8 < float(check["value"]) < 30.1
    assert float(check["uncertainty"]) == pytest.approx(0.05)
    replayed = replay(run.package)
    assert (replayed.cases, replayed.differences) == (1, ())
    assert any("start" in line and "thermometer" in line for line in procedure(made.request(bench="air", dut="AIR-1")))


def test_a_fault_of_the_package_ends_a_case_in_the_open(made):
    """The data line is held: what answers is no thermometer any more, and the DUT has failed."""
    path = made.root / "fixtures/benches/air/bench.yaml"
    text = path.read_text(encoding="utf-8").replace(
        "connects: {temp", "faults: [{kind: sda-low, from: 15 s}], connects: {temp"
    )
    path.write_text(text, encoding="utf-8")
    run = ran(made)
    assert run.code != 0
    assert results_as_json(run.package)["verdict"] != "PASS"
    assert verify(run.package.folder).findings == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("role: thermometer,", "role: thermometre,"), "unknown role 'thermometre', did you mean 'thermometer'"),
        (("model: still-air", "model: still-ait"), "unknown plant model 'still-ait', did you mean 'still-air'"),
        (("driver: tmp117", "driver: tmp11"), "unknown driver 'tmp11', did you mean 'tmp117'"),
        (("state: asleep, within", "state: off, within"), "unknown state 'off'"),
        (("unit: degC, max", "unit: K, max"), "temperature is given in degC here, not in 'K'"),
    ],
)
def test_its_names_are_checked_like_ours(made, change, message):
    """With place and the nearest word."""
    with pytest.raises(ConfigurationError) as caught:
        _checked(made, change)
    assert message in str(caught.value)
    assert "bench.yaml:" in str(caught.value)


def _checked(made, change):
    from hil.bench.binding import check_twin  # noqa: PLC0415 - beside its only use

    path = made.root / "fixtures/benches/air/bench.yaml"
    text = path.read_text(encoding="utf-8")
    assert change[0] in text
    path.write_text(text.replace(*change).replace("state: off", 'state: "off"'), encoding="utf-8")
    benches = made.root / "fixtures/benches"
    load_bench(benches, "air", made.root, twin=check_twin)


def test_a_role_that_cannot_be_used_is_told_at_its_wire(made, tmp_path):
    """Another package has the same role: what, which packages, and what to do."""
    other = tmp_path / "hil_other"
    (other / "src").mkdir(parents=True)
    points = '[project.entry-points."hil.roles"]\nthermometer = "hil_other:ROLE"\n'
    (other / "pyproject.toml").write_text(f'[project]\nname = "hil-other"\nversion = "3"\n{points}', encoding="utf-8")
    install(other, tmp_path / "site")
    try:
        with pytest.raises(ConfigurationError) as caught:
            load_bench(made.root / "fixtures/benches", "air", made.root)
    finally:
        uninstall(other, tmp_path / "site")
    told = str(caught.value)
    assert "there are several roles 'thermometer': hil_other:ROLE (package hil-other 3)" in told
    assert "hil_tmp117.role:THERMOMETER (package hil-tmp117 0.1); uninstall the packages of all but one" in told
