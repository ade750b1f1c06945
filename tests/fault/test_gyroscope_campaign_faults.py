"""What goes wrong on the gyroscope's bench ends its cases as it should: none passes, and the reason names the cause."""

from __future__ import annotations

import pytest
import sweeps
from gyroscope_runs import CALIBRATION, NOISE, faulty, gyroscope_workspace, run_one, truth
from told_as_json import bodies, results_as_json

pytestmark = pytest.mark.system

HEALTHY = {"010": "RECORDED", "011": "PASS", "012": "PASS", "013": "PASS", "014": "INCONCLUSIVE", "015": "PASS"}
"""Five minutes tell no longest averaging time; all else is there."""

UNSAFE = 7
"""What is watched after the end does not show that everything is safe: a plate that warms, or cannot be read."""

IN_SOAK, IN_RECORD = "from: 200 s", "from: 500 s"
"""In the case of the noise: armed at 3 s, settled at about 400 s, recorded up to about 700 s."""

TURNING = "from: 433 s"
"""In the case of the calibration: within the recording of the first rate."""

LOST = {**dict.fromkeys(("011", "012", "013", "014"), "INCONCLUSIVE"), "010": "FAIL", "015": "FAIL"}


def ended(tmp_path, case, *changes):
    """Run one case on a bench with these changes."""
    merged = {old: new for change in changes for old, new in change.items()}
    return run_one(gyroscope_workspace(tmp_path / "workspace", changes=merged), case)


def all_are(ran, verdict):
    """Return whether the case and all its requirements have this verdict."""
    return {ran.verdict, *ran.requirements.values()} == {verdict}


def test_without_a_fault_the_noise_is_told(tmp_path):
    """What the other tests show comes from their faults."""
    ran = ended(tmp_path, NOISE)
    assert ran.requirements == HEALTHY
    assert ran.left_safe()


@pytest.mark.parametrize(
    ("fault", "code", "said"),
    sweeps.sample(
        [
            (f"{{kind: stuck, {IN_SOAK}}}", 1, "tec1: the output is at 100 % for 30 s, and the plate stays at 2"),
            (f"{{kind: stuck, {IN_RECORD}}}", 1, "tec1: the plate did not stay at 25 degC, it is at 23."),
            (f"{{kind: sensor-detached, {IN_SOAK}}}", 1, "tec1: the device is at 27."),
            (f"{{kind: sensor-detached, {IN_RECORD}}}", 1, "tec1: the plate did not stay at 25 degC, it is at 22."),
            (f"{{kind: sensor-open, {IN_SOAK}}}", UNSAFE, "thermal: temperature is not a number"),
            (f"{{kind: sensor-open, {IN_RECORD}}}", UNSAFE, "thermal: temperature is not a number"),
        ],
        1,
    ),
)
def test_a_cooler_or_its_sensor_that_fails_is_an_error(tmp_path, fault, code, said):
    """Whether it happens in the soak or while hours are recorded; then it is found at the latest after the record."""
    ran = ended(tmp_path, NOISE, faulty("tec1", fault))
    assert all_are(ran, "ERROR")
    assert ran.code == code
    assert said in ran.reasons
    assert ran.left_safe()


@pytest.mark.parametrize(
    ("fault", "code", "said"),
    sweeps.sample(
        [
            (f"{{kind: runaway, {IN_SOAK}}}", UNSAFE, "tec1: the plate goes away from 25 degC"),
            (f"{{kind: runaway, {IN_RECORD}}}", UNSAFE, "degC is above 60 degC"),
        ],
        1,
    ),
)
def test_a_cooler_that_runs_away_is_an_error(tmp_path, fault, code, said):
    """It is found, or trips the bench; the rest of the bench is safe, and the cooler is left to its cut-out."""
    ran = ended(tmp_path, NOISE, faulty("tec1", fault))
    assert all_are(ran, "ERROR")
    assert ran.code == code
    assert said in ran.reasons
    assert ran.left_safe(except_for=("tec",))


def test_a_welded_lamp_is_an_error(tmp_path):
    """It warms the board at a target for which nobody asked for it."""
    ran = ended(tmp_path, NOISE, truth("relay1", '{welded: ["3"]}'))
    assert all_are(ran, "ERROR")
    assert ran.code == UNSAFE
    assert "tec1: the device is at 27.8 degC" in ran.reasons
    assert "the lamp's relay" in ran.reasons
    assert ran.left_safe(except_for=("lamp",))


@pytest.mark.parametrize(
    ("fault", "said"),
    sweeps.sample(
        [
            ("{kind: slipping, from: 300 s}", "rotation_table was set to 27.2 deg/s and its encoder shows 24.48 deg/s"),
            (f"{{kind: slipping, {TURNING}}}", "the table was set to 27.2 deg/s, and turned at 2"),
            ("{kind: stalled, from: 300 s}", "rotation_table was set to 27.2 deg/s and its encoder shows 0 deg/s"),
            (f"{{kind: stalled, {TURNING}}}", "the table was set to 27.2 deg/s, and turned at "),
            (
                "{kind: no-stop, from: 300 s, power: cuts}",
                "rotation_table was stopped and went on; its motor power was cut",
            ),
        ],
        1,
    ),
)
def test_a_table_that_does_not_turn_as_it_should_is_an_error(tmp_path, fault, said):
    """Before a recording, or in its middle: no rate is taken for true that was not."""
    ran = ended(tmp_path, CALIBRATION, faulty("table1", fault))
    assert all_are(ran, "ERROR")
    assert ran.code == 1
    assert f"table1: {said}" in ran.reasons
    assert ran.left_safe()


def test_a_table_that_cannot_be_stopped_is_unsafe(tmp_path):
    """Neither a stop nor its motor power ends it: exit code 7, and everything else is safe."""
    ran = ended(tmp_path, CALIBRATION, faulty("table1", "{kind: no-stop, from: 300 s, power: stays}"))
    assert all_are(ran, "ERROR")
    assert (ran.code, results_as_json(ran.package)["safe"]) == (7, False)
    assert "its motor power was cut, and it still turns" in ran.reasons
    assert not ran.left_safe()
    assert ran.left_safe(except_for=("table",))


@pytest.mark.parametrize(
    ("fault", "said"),
    sweeps.sample(
        [
            (f"{{kind: stall, {IN_RECORD}, until: 530 s}}", "obc1: no samples for 4.00 s of gyro1, though it answers"),
            (f"{{kind: reset, {IN_RECORD}}}", "obc1: the board has restarted (boot 42, independent watchdog)"),
            (f"{{kind: dead, {IN_RECORD}}}", "obc1: asked IDENTIFY, got no reply"),
        ],
        1,
    ),
)
def test_an_obc_that_falls_silent_or_resets_is_an_error(tmp_path, fault, said):
    """It is the bench's, not the gyroscope's fault; what came before it is kept as an incomplete recording."""
    ran = ended(tmp_path, NOISE, faulty("obc1", fault))
    assert all_are(ran, "ERROR")
    assert ran.code == 1
    assert said in ran.reasons
    assert [event["complete"] for event in bodies(ran.package, "recording-end") if "rest" in event["recording"]] == [
        False
    ]
    assert ran.left_safe()


def test_an_obc_that_catches_up_loses_nothing(tmp_path):
    """Frames that waited for two seconds in its ring are all there."""
    ran = ended(tmp_path, NOISE, faulty("obc1", f"{{kind: stall, {IN_RECORD}, until: 502 s}}"))
    assert ran.requirements == HEALTHY


def test_a_lost_frame_is_a_gap_and_fails(tmp_path):
    """The frame is counted and its time stays empty; nothing that needs a record without gaps is concluded."""
    ran = ended(tmp_path, NOISE, faulty("obc1", f"{{kind: lose-frames, {IN_RECORD}}}"))
    assert (ran.verdict, ran.requirements) == ("FAIL", LOST)
    assert [check["value"] for check in ran.checks("015", "lost_frames")] == [1]
    assert [check["value"] for check in ran.checks("010", "max_gap")] == [pytest.approx(1.006, abs=0.001)]
    assert "frames lost: 1" in ran.reasons
    assert ran.left_safe()


def test_a_clock_that_drifts_is_recorded_and_fails(tmp_path):
    """100 ppm are measured within 0.1 ppm, and the noise is told all the same."""
    ran = ended(tmp_path, NOISE, {'truth: {clock_drift: "0.000012"}': 'truth: {clock_drift: "0.0001"}'})
    assert ran.requirements == {**HEALTHY, "015": "FAIL"}
    (drift,) = ran.checks("015", "clock_drift")
    assert (drift["value"], drift["unit"]) == (pytest.approx(100.0, abs=0.1), "ppm")
    assert "clock_drift is FAIL" in ran.reasons


@pytest.mark.parametrize(
    ("device", "fault", "said"),
    sweeps.sample(
        [
            ("obc1", f'{{kind: nack, address: "0x68", {IN_SOAK}}}', "gyro1: no acknowledge at address 0x68"),
            (
                "obc1",
                f'{{kind: nack, address: "0x68", {IN_RECORD}}}',
                "gyro1: no acknowledge at address 0x68 in frame ",
            ),
            ("gyro1", "{kind: asleep}", "gyro1: PWR_MGMT0 was set to 0x0c and reads back 0x00"),
            ("gyro1", f"{{kind: asleep, {IN_SOAK}}}", "gyro1: its temperature is marked invalid, it sleeps"),
            ("gyro1", f"{{kind: asleep, {IN_RECORD}}}", "gyro1: no samples for 4.00 s: it has lost its settings"),
            ("gyro1", "{kind: stuck}", "gyro1: no valid data 0.56 s after the gyroscope was switched on"),
            ("gyro1", f"{{kind: stuck, {IN_RECORD}}}", "consecutive samples are equal, the sensor is stuck"),
        ],
        2,
    ),
)
def test_a_gyroscope_that_falls_silent_is_inconclusive(tmp_path, device, fault, said):
    """It is the device under test, and no requirement says that it shall answer; it is never the bench's fault."""
    ran = ended(tmp_path, NOISE, faulty(device, fault))
    assert all_are(ran, "INCONCLUSIVE")
    assert ran.code == 1
    assert said in ran.reasons
    assert [(event["device"], event["dut"]) for event in bodies(ran.package, "fault")] == [("gyro1", True)]
    assert ran.left_safe()


def test_a_saturated_gyroscope_is_inconclusive(tmp_path):
    """Samples at the rail are no numbers: clock and frames are judged, everything that needs the samples stays open."""
    ran = ended(tmp_path, NOISE, faulty("gyro1", f"{{kind: saturated, {IN_RECORD}}}"))
    wanted = {**dict.fromkeys(HEALTHY, "INCONCLUSIVE"), "015": "PASS"}
    assert (ran.verdict, ran.requirements) == ("INCONCLUSIVE", wanted)
    assert "samples are not finite" in ran.reasons
    assert ran.left_safe()


def test_a_temperature_in_counts_is_no_sample(tmp_path):
    """Counts for degrees from the beginning are no temperature: the sensor gives no whole sample."""
    ran = ended(tmp_path, NOISE, faulty("gyro1", "{kind: temperature-raw}"))
    assert all_are(ran, "INCONCLUSIVE")
    assert "gyro1: no valid data" in ran.reasons
    assert ran.left_safe()


def test_a_temperature_in_counts_for_a_while_leaves_the_noise_open(tmp_path):
    """Counts in the middle of the record are samples that lack their temperature."""
    ran = ended(tmp_path, NOISE, faulty("gyro1", f"{{kind: temperature-raw, {IN_RECORD}, until: 600 s}}"))
    wanted = {**HEALTHY, **dict.fromkeys(("010", "011", "012", "013", "014"), "INCONCLUSIVE")}
    assert (ran.verdict, ran.requirements) == ("INCONCLUSIVE", wanted)
    assert "finite of temperature" in ran.reasons


def test_another_gyroscope_is_never_measured(tmp_path):
    """The bench is not armed with a device that says that it is something else."""
    ran = ended(tmp_path, NOISE, faulty("gyro1", '{kind: identity, value: "0x47"}'))
    assert all_are(ran, "NOT_RUN")
    assert ran.code == 1
    assert "identity of gyro1: expected model 'IIM-42652', found 'WHO_AM_I 0x47'" in ran.reasons
    assert not bodies(ran.package, "armed", "case")
    assert ran.left_safe()
