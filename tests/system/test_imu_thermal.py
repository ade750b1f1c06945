"""The heat-lamp and thermal-vacuum plans on the bench `imu`: they find what was put in, and pass nothing wrong."""

from __future__ import annotations

import re

import pytest
import sweeps
from thermal_plans import (
    DUT,
    LAMP,
    VACUUM,
    checks,
    covers,
    fragment_table,
    requirements_of,
    thermal_workspace,
    true_drift,
)

from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

ON_IMU = {"bench": "imu", "dut": DUT}
LAMP_GOOD = {
    **dict.fromkeys(("011", "021", "022", "023", "024", "031", "032", "033", "034", "050"), "PASS"),
    **dict.fromkeys(("010", "025", "026", "035", "040", "041", "051", "052"), "RECORDED"),
}
VACUUM_GOOD = {
    **dict.fromkeys(("010", "011", "020", "021"), "PASS"),
    **dict.fromkeys(("022", "030", "031"), "RECORDED"),
}


def _lets(device, fault):
    """Return the change of the bench that gives a device a fault."""
    place = f"    {device}:\n      truth:"
    return {place: place.replace("truth:", f"faults: [{{{fault}}}]\n      truth:")}


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.soak)], ids=["short", "whole"])
def lamp(request, tmp_path_factory):
    """Run the lamp plan on a healthy bench."""
    root = tmp_path_factory.mktemp("lamp") / "workspace"
    return thermal_workspace(root, LAMP, whole=request.param).run(**ON_IMU)


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.soak)], ids=["short", "whole"])
def vacuum(request, tmp_path_factory):
    """Run the vacuum plan on a healthy bench."""
    root = tmp_path_factory.mktemp("vacuum") / "workspace"
    return thermal_workspace(root, VACUUM, whole=request.param).run(**ON_IMU)


def test_under_the_lamp_every_requirement_is_met_again_from_the_bytes(lamp):
    """Limits pass and figures are recorded, and the replay finds no difference."""
    assert lamp.verdicts() == {"test_lamp": "PASS"}, lamp.out
    assert requirements_of(lamp) == LAMP_GOOD, lamp.out
    assert replay(lamp.package).differences == ()


def test_the_lamp_plan_finds_the_drifts_that_were_put_in(lamp):
    """Of 72 intervals at 95 % no more than seven miss the truth; none by far."""
    found = checks(lamp, "drift")
    assert len(found) == 72
    assert sum(covers(check, true_drift(str(check["of"]))) for check in found) >= 65
    for check in found:
        assert abs(float(check["value"]) - true_drift(str(check["of"]))) < 8 * float(check["uncertainty"]), check


def test_the_lamp_plan_finds_the_hysteresis_of_elements_that_lag(lamp):
    """The element is colder than its thermometer while it heats, so that the loop has the sign of minus the drift."""
    strong = [check for check in checks(lamp, "hysteresis") if abs(true_drift(str(check["of"]))) > 0.01]
    gyroscopes = [check for check in strong if str(check["of"]).startswith("gyroscope")]
    assert len(gyroscopes) == 11
    for check in gyroscopes:
        lag = -float(check["value"]) / true_drift(str(check["of"]))
        assert 1.0 < lag < 4.0, check  # K between heating and cooling: five seconds of lag each way


def test_runs_repeat_and_units_differ(lamp):
    """Within a unit drifts agree; another unit's differs by what was put in, also where the first is nearly zero."""
    repeats, units = checks(lamp, "drift_repeat"), checks(lamp, "drift_unit_difference")
    assert (len(repeats), len(units)) == (24, 24)
    assert all(float(check["value"]) < 3.0 for check in repeats)
    assert sum(covers(check, between(str(check["of"]))) for check in units) >= 21


def between(second):
    """Return the true drift of an axis of a second unit less that of the first one."""
    return true_drift(second) - true_drift(second.replace("2", ""))


def test_relative_deviations_are_told_where_there_are_any(lamp):
    """Equation 3.3: the ratio of both truths; a drift that cannot be told from zero has none, and the table says so."""
    lines = lamp.package.text("data/attachments/test_lamp-drift-deviations.csv").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    assert (len(rows), {len(row) for row in rows}) == (48, {8})
    told = [row for row in rows if row[5]]
    assert len(told) >= 40
    assert all("cannot be told from zero" in row[7] for row in rows if not row[5])
    near = 0
    for of, against, _, _, _, relative, uncertainty, _ in told:
        true = between(of) / abs(true_drift(of.replace("2", ""))) if against == "second unit" else 0.0
        near += abs(float(relative) - true) <= 2.5 * float(uncertainty)
    assert near >= 0.85 * len(told)


def test_ranks_are_within_one_unit(lamp):
    """One table per role, the weakest drift first; who cannot be told apart shares ranks."""
    for role, axes in (("gyroscope", 12), ("magnetometer", 12)):
        lines = lamp.package.text(f"data/attachments/test_lamp-drift-ranking-{role}.csv").splitlines()
        assert len(lines) == 1 + axes
        assert all(line.startswith(f"{role}.") for line in lines[1:])
    assert (
        "gyroscope.lsm.x"
        in lamp.package.text("data/attachments/test_lamp-drift-ranking-gyroscope.csv").splitlines()[-1]
    )


def test_what_is_wrong_under_the_lamp_passes_nothing(tmp_path):
    """A drift beyond its limit fails; a stuck axis and a temperature in raw counts leave their requirements open."""
    changes = {
        'bias_y: ["0.55", "-0.020091", "0"]': 'bias_y: ["0.55", "-0.2", "0"]',
        'drift: ["0.031", "0.017442"': 'drift: ["0", "0.017442"',
        'field_noise: {white: ["0.204", "0.204", "0.204"], flicker: ["0.048810", "0.098254", "0.015409"],\n'
        '          random_walk: ["0.00063294", ': 'field_noise: {white: ["0", "0.2", "0.2"], random_walk: ["0", ',
        **_lets("lsm1", "kind: temperature-raw, from: 340 s, until: 450 s"),
    }
    workspace = thermal_workspace(tmp_path / "workspace", LAMP, bench=changes)
    minute = {f'{{name: {name}, value: "150"': f'{{name: {name}, value: "60"' for name in ("heating", "cooling")}
    workspace.change("testplans/imu_lamp/parameters.yaml", minute)
    workspace.lock()
    ran = workspace.run(**ON_IMU)
    found = requirements_of(ran)
    assert {name: found[name] for name in ("022", "024", "025", "026")} == {
        "022": "FAIL",
        "024": "INCONCLUSIVE",
        "025": "INCONCLUSIVE",
        "026": "INCONCLUSIVE",
    }, ran.out
    assert ran.code == 1
    said = ran.reasons("test_lamp")
    assert re.search(r"drift of magnetometer.bno.x is INCONCLUSIVE: .*stuck: all samples are", said), said
    assert re.search(r"drift of gyroscope.lsm.x is INCONCLUSIVE: .*temperature", said), said


def test_a_drift_that_is_another_in_the_second_run_fails(tmp_path):
    """Both drifts are within the limit of the data sheet, and the sensor is not what it was."""
    runs = _lets("bmi1", 'kind: drifting, drift: "0.006", from: 700 s')
    ran = thermal_workspace(tmp_path / "workspace", LAMP, bench=runs).run(**ON_IMU)
    assert ran.verdicts() == {"test_lamp": "FAIL"}, ran.out
    assert requirements_of(ran) == {**LAMP_GOOD, "050": "FAIL"}, ran.out
    wrong = {str(check["of"]) for check in checks(ran, "drift_repeat") if float(check["value"]) > 3.0}
    assert wrong == {"gyroscope.bmi.x", "gyroscope.bmi.y", "gyroscope.bmi.z"}


def test_in_vacuum_every_requirement_is_met_again_from_the_bytes(vacuum):
    """Limits pass and figures are recorded, and the replay finds no difference.

    Short ramps leave some intervals so wide that a guarded limit has no room for them.
    """
    found = requirements_of(vacuum)
    if 'parameter: hottest, unit: degC, min: "40"' not in vacuum.package.text(
        "data/catalogue/imu_vacuum/requirements.yaml"
    ):
        for number in ("020", "021"):
            assert found.pop(number) in {"PASS", "INCONCLUSIVE"}
    assert found.items() <= VACUUM_GOOD.items(), vacuum.out
    assert replay(vacuum.package).differences == ()


def test_every_fragment_says_what_it_shows_or_why_nothing(vacuum):
    """Ways show drift over temperature, soaks over time; what one does not show it gives a reason for."""
    rows = fragment_table(vacuum)
    assert len({row["length s"] for row in rows}) > 1
    for row in rows:
        changed, told = float(row["temperature change K"]), bool(row["drift per K"])  # the change is rounded to 0.1 K
        assert changed >= 4.9 if told else changed <= 5.1
        assert told == (not row["why nothing is said"]), row
    found = checks(vacuum, "drift")
    assert sum(covers(check, true_drift(str(check["of"]))) for check in found) >= 0.85 * len(found)


REFERENCE = 'ref1: {truth: {temperature_offset: "0.08"}'
FROZEN = {REFERENCE: REFERENCE.replace("{truth", "{faults: [{kind: stuck, from: 350 s}], truth")}
OFF_BY_5_K = {REFERENCE: REFERENCE.replace("0.08", "5.08")}
NO_LAMP = {'lamp_board: "24"': 'lamp_board: "0"', 'lamp_box: "6"': 'lamp_box: "0"'}


def goes_wrong(device, kind):
    """Return the change of the bench that lets a device go wrong on the way."""
    return _lets(device, f"kind: {kind}, from: 350 s")


WRONG = {
    "lamp, reference frozen": (LAMP, FROZEN, "ERROR", "ref1: 16 consecutive samples are equal"),
    "lamp, reference off by 5 K": (LAMP, OFF_BY_5_K, "ERROR", "the device (is|settled) at"),
    "lamp, which does not heat": (LAMP, NO_LAMP, "FAIL", "hottest of first is FAIL: .* below the minimum of 52 degC"),
    "lamp, sensor asleep": (LAMP, goes_wrong("bmi1", "asleep"), "INCONCLUSIVE", "bmi1: .*start it again"),
    "lamp, plate that runs away": (
        LAMP,
        goes_wrong("tec1", "runaway"),
        "ERROR",
        "thermal: temperature .* is above 55 degC",
    ),
    "vacuum, reference frozen": (VACUUM, FROZEN, "ERROR", "ref1: 16 consecutive samples are equal"),
    "vacuum, reference off by 5 K": (VACUUM, OFF_BY_5_K, "FAIL", "thermometer is -5.[0-9] K from the reference"),
    "vacuum, sensor asleep": (VACUUM, goes_wrong("lsm1", "asleep"), "INCONCLUSIVE", "lsm1: no new sample within"),
    "vacuum, plate that runs away": (
        VACUUM,
        goes_wrong("tec1", "runaway"),
        "ERROR",
        "thermal: temperature .* is above 55 degC",
    ),
    "vacuum, plate that stands still": (VACUUM, goes_wrong("tec1", "stuck"), "ERROR", "the plate did not come to"),
}


@pytest.mark.parametrize("name", sweeps.sample(WRONG, 4))
def test_what_goes_wrong_on_the_bench_passes_nothing(tmp_path, name):
    """Reference, lamp, plate and sensors: the verdict is not PASS, nor is that of any requirement, and says why."""
    plan, bench, verdict, said = WRONG[name]
    ran = thermal_workspace(tmp_path / "workspace", plan, bench=bench).run(**ON_IMU)
    assert [*ran.verdicts().values()] == [verdict], ran.out
    assert ran.code != 0
    assert re.search(said, ran.reasons(f"test_{plan.removeprefix('imu_')}"))
    drifts = {"021", "022", "023", "024"} if plan == LAMP else {"020", "021"}
    assert "PASS" not in {requirements_of(ran)[number] for number in drifts}


def test_a_sensor_that_falls_silent_costs_one_log(tmp_path):
    """The log breaks off, the next one begins with sensors that were started again, and nothing passes."""
    place = "    bno1:\n      truth:"
    silent = {place: "    bno1:\n      faults: [{kind: dead, from: 200 s, until: 260 s}]\n      truth:"}
    ran = thermal_workspace(tmp_path / "workspace", VACUUM, bench=silent).run(**ON_IMU)
    assert ran.verdicts() == {"test_vacuum": "INCONCLUSIVE"}, ran.out
    logs = {row["log"] for row in fragment_table(ran)}
    assert 2 <= len(logs) < 5
