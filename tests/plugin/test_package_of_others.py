"""A plan with a role, a driver, a peer, a plant and a fault of another package: run, verified, replayed, refused."""

from __future__ import annotations

import textwrap

import pytest
from other_packages import INA226, install, uninstall
from told_as_json import bodies, results_as_json
from workspaces import Workspace

from hil.bench.file.reading import load_bench
from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import procedure, replay

pytestmark = pytest.mark.system  # each test is a whole run

BENCH = """\
schema: hil/bench/1
bench: {name: air, title: A rail, place: Table 1}
buses:
  i2c1: {port: /dev/i2c-1, frequency: 400 kHz}
instruments:
  mon1:
    driver: ina226
    bus: i2c1
    address: "0x40"
    identity: {model: INA226}
    dut: true
    calibration:
      certificate: certificates/mon1.txt
      due: "2030-01-01"
      ranges:
      - {quantity: voltage, unit: V, from: "-1", to: "50", absolute: "0.1"}
wiring:
- {role: power_monitor, instrument: mon1, settings: {averages: "16"}, note: on the rail}
envelope:
- {id: air, output: power_monitor, quantity: voltage, unit: V, max: "6", period: 5 s, max_age: 20 s}
safe_off:
- {output: power_monitor, state: asleep, within: 1 s}
rest:
- {output: power_monitor, state: asleep, within: 1 s}
simulated:
  seed: "7"
  epoch: "2026-03-02T06:00:00Z"
  plants:
    box: {model: soft-start, grid: 100 ms, truth: {target: "5", time: "60"}}
  peers:
    mon1: {truth: {noise: "0.02"}, connects: {voltage: box.voltage, current: box.current}}
"""

DRIVER = "data/packages/hil-ina226/hil_ina226/driver.py"

REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: AIR, issue: "1.0", title: A rail}
requirements:
- {id: AIR-010, rev: 1, text: The rail shall come to 5 V within five minutes., kind: limit, method: test,
   limits: [{parameter: voltage, unit: V, min: "4.8", max: "5.2", decision: guarded}]}
- {id: AIR-020, rev: 1, text: The voltage shall be recorded., kind: record, method: test,
   records: {recording: warming, channels: [voltage], rate: 4 Hz, duration: 10 s, max_gap: 1 s}}
"""

CASES = """\
    import pytest

    @pytest.mark.requirement("AIR-010", "AIR-020")
    def test_the_air_gets_warm(power_monitor, record, check, step, clock):
        '''It tends to what is around it.'''
        with step("Wake the sensor"):
            power_monitor.start()
        with step("Record"):
            record("warming", power_monitor, duration=11.0, rate=4.0)
        with step("Wait"):
            clock.sleep(300.0)
            check("AIR-010", "voltage", power_monitor.voltage())
"""


@pytest.fixture(scope="module", autouse=True)
def _package(tmp_path_factory):
    """Install the package for these tests."""
    folder = tmp_path_factory.mktemp("site")
    install(INA226, folder)
    yield
    uninstall(INA226, folder)


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
    (bench / "certificates/mon1.txt").write_text("A certificate.\n", encoding="utf-8")
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
    assert ("power_monitor.start", "drives") in effects
    assert ("power_monitor.voltage", "reads") in effects
    (check,) = (
        each
        for case in results_as_json(run.package)["cases"]
        for each in case["checks"]
        if each["parameter"] == "voltage"
    )
    assert 4.95 < float(check["value"]) < 5.02
    assert float(check["uncertainty"]) == pytest.approx(0.05)
    assert (run.package.folder / DRIVER).read_bytes() == (INA226 / "src/hil_ina226/driver.py").read_bytes()
    conditions = [each for each in results_as_json(run.package)["conditions"] if each["name"] == "others"]
    (told,) = [each["text"] for each in conditions if not each["proven"]]
    assert told.startswith("driver ina226, fault sda-low, peer ina226, plant model soft-start, role power_monitor of")
    assert told.endswith("so nobody can tell whether they were changed")
    replayed = replay(run.package)
    assert (replayed.cases, replayed.differences) == (1, ())
    assert any(
        "start" in line and "power_monitor" in line for line in procedure(made.request(bench="air", dut="AIR-1"))
    )


def test_a_fault_of_the_package_ends_a_case_in_the_open(made):
    """The data line is held: what answers is no power monitor any more, and the DUT has failed."""
    path = made.root / "fixtures/benches/air/bench.yaml"
    text = path.read_text(encoding="utf-8").replace(
        "connects: {volt", "faults: [{kind: sda-low, from: 15 s}], connects: {volt"
    )
    path.write_text(text, encoding="utf-8")
    run = ran(made)
    assert run.code != 0
    assert results_as_json(run.package)["verdict"] != "PASS"
    assert verify(run.package.folder).findings == ()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("role: power_monitor,", "role: power_moniter,"),
            "unknown role 'power_moniter', did you mean 'power_monitor'",
        ),
        (("model: soft-start", "model: soft-strat"), "unknown plant model 'soft-strat', did you mean 'soft-start'"),
        (("driver: ina226", "driver: ina22"), "unknown driver 'ina22', did you mean 'ina226'"),
        (("state: asleep, within", "state: off, within"), "unknown state 'off'"),
        (("unit: V, max", "unit: mV, max"), "voltage is given in V here, not in 'mV'"),
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
    points = '[project.entry-points."hil.roles"]\npower_monitor = "hil_other:ROLE"\n'
    (other / "pyproject.toml").write_text(f'[project]\nname = "hil-other"\nversion = "3"\n{points}', encoding="utf-8")
    install(other, tmp_path / "site")
    try:
        with pytest.raises(ConfigurationError) as caught:
            load_bench(made.root / "fixtures/benches", "air", made.root)
    finally:
        uninstall(other, tmp_path / "site")
    told = str(caught.value)
    assert "there are several roles 'power_monitor': hil_ina226.role:POWER_MONITOR (package hil-ina226 0.1), " in told
    assert "hil_other:ROLE (package hil-other 3); uninstall the packages of all but one" in told
