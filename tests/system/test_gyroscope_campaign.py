"""Whole gyroscope campaigns: the calibration is true, the evidence repeats, and doubts reach every check."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from gyroscope_runs import CALIBRATION, committed_workspace, faulty, gyroscope_workspace, run_one
from told_as_json import results_as_json
from workspaces import ROOT

from hil.analysis.gyroscope.interchange import from_json
from hil.bench.file.reading import load_bench
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

SHORTENED = {
    "rest_duration": 'value: "1200"',
    "temperatures": 'values: ["-16", "10", "25", "40"]',
    "scale_temperatures": 'values: ["-16", "40"]',
    "other_temperatures": 'values: ["-16", "40"]',
}
CLEAR_MINIMUM = {
    'flicker: ["0.0015", "0.0012", "0.0018"]': 'flicker: ["0.0002", "0.0002", "0.0002"]',
    'random_walk: ["0.0001", "0.0001", "0.0001"]': 'random_walk: ["0.0002", "0.0002", "0.0002"]',
}
"""With less flicker and more random walk the Allan deviation is lowest within a minute: twenty minutes show it."""

GOOD = {
    "ADCS-GYR-010": "RECORDED",
    "ADCS-GYR-011": "PASS",
    "ADCS-GYR-012": "PASS",
    "ADCS-GYR-013": "PASS",
    "ADCS-GYR-014": "RECORDED",
    "ADCS-GYR-015": "PASS",
    "ADCS-GYR-020": "RECORDED",
    "ADCS-GYR-021": "RECORDED",
    "ADCS-GYR-022": "PASS",
    "ADCS-GYR-030": "PASS",
}
ARTIFACT = "data/attachments/test_calibration-calibration.json"


def found(package):
    """Return the verdict of every requirement of a run."""
    return {
        name: verdict for case in results_as_json(package)["cases"] for name, verdict in case["requirements"].items()
    }


def campaign(folder):
    """Run the shortened campaign in a workspace of its own."""
    return gyroscope_workspace(folder / "workspace", parameters=SHORTENED, changes=CLEAR_MINIMUM).run()


@pytest.fixture(scope="module")
def healthy(tmp_path_factory):
    """Run the shortened campaign."""
    return campaign(tmp_path_factory.mktemp("campaign"))


@pytest.fixture(scope="module")
def truth():
    """Return what the simulated gyroscope of the bench really is."""
    bench = load_bench(ROOT / "fixtures/benches", "adcs", ROOT)
    return next(peer.truth for peer in bench.simulated.peers if peer.device == "gyro1")


def polynomial(truth, name, temperature):
    """Return a polynomial of the truth at a temperature [degC] that the sensor tells."""
    above = temperature - float(truth["temperature_offset"]) - 25.0
    return sum(float(each) * above**power for power, each in enumerate(truth[name]))


def test_a_healthy_campaign_passes_and_is_sealed(healthy):
    """All requirements are good, the exit code is 0, and the package verifies."""
    assert (healthy.code, found(healthy.package)) == (0, GOOD), healthy.out
    checked = verify(healthy.package.folder)
    assert (checked.findings, checked.state) == ((), "SEALED")


@pytest.mark.soak
def test_the_same_campaign_gives_the_same_evidence(healthy, tmp_path):
    """Two runs in two folders have one content digest."""
    one, other = healthy.package, campaign(tmp_path).package
    assert one.content_digest == other.content_digest
    assert one.text(ARTIFACT) == other.text(ARTIFACT)


def test_the_campaign_is_the_same_on_its_recorded_bytes(healthy):
    """The replay asks for every byte again, and comes to every verdict, value, row and file."""
    replayed = replay(healthy.package)
    assert (replayed.cases, replayed.differences) == (2, ())


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("temperature", [-15.0, 10.0, 25.0, 42.0])
def test_the_exported_bias_is_true(healthy, truth, axis, temperature):
    """At every temperature it is within three stated standard uncertainties of the article's, and these are small."""
    bias = from_json(healthy.package.text(ARTIFACT)).axes[axis].bias.figure(temperature)
    assert abs(bias.value - polynomial(truth, f"bias_{axis}", temperature)) < 3 * bias.uncertainty
    assert bias.uncertainty < 0.02


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("temperature", [-15.0, 25.0, 42.0])
def test_the_exported_scale_is_true(healthy, truth, axis, temperature):
    """It is one over the article's gain, within three stated standard uncertainties, and these are below 0.1 %."""
    scale = from_json(healthy.package.text(ARTIFACT)).axes[axis].scale.figure(temperature)
    true = 1 / (1 + polynomial(truth, f"scale_{axis}", temperature))
    assert abs(scale.value - true) < 3 * scale.uncertainty
    assert scale.uncertainty < 0.001


def test_the_exported_alignment_is_true(healthy, truth):
    """It undoes the article's misalignment, within the stated uncertainty and the tilt of the table's axis."""
    calibration = from_json(healthy.package.text(ARTIFACT))
    article = np.eye(3)
    article[[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]] = [float(each) for each in truth["misalignment"]]
    difference = np.abs(np.asarray(calibration.alignment) - np.linalg.inv(article))
    tilt = 0.0022  # rad, in the truth of the table
    assert (difference < tilt + 3 * np.asarray(calibration.alignment_uncertainty)).all()


@pytest.mark.parametrize(
    ("device", "fault", "verdicts", "said"),
    sweeps.sample(
        [
            (
                "obc1",
                "{kind: lose-frames, from: 415 s}",
                {"020": "FAIL", "021": "INCONCLUSIVE", "022": "PASS", "030": "INCONCLUSIVE"},
                "rate_error of x is INCONCLUSIVE: frames lost: 1; gaps: 1 gaps",
            ),
            (
                "obc1",
                "{kind: lose-frames, from: 433 s}",
                {"020": "RECORDED", "021": "INCONCLUSIVE", "022": "PASS", "030": "INCONCLUSIVE"},
                "scale of z is INCONCLUSIVE: frames lost: 1; gaps: 1 gaps",
            ),
            (
                "gyro1",
                "{kind: saturated, from: 420 s}",
                dict.fromkeys(("020", "021", "022", "030"), "INCONCLUSIVE"),
                "bias of x is INCONCLUSIVE: finite of x: ",
            ),
            (
                "gyro1",
                "{kind: temperature-raw, from: 410 s, until: 414 s}",
                dict.fromkeys(("020", "021", "022", "030"), "INCONCLUSIVE"),
                "bias of x is INCONCLUSIVE: finite of temperature: ",
            ),
        ],
        1,
    ),
    ids=sweeps.sample(["frame lost at rest", "frame lost while turning", "saturated", "temperature in counts"], 1),
)
def test_doubts_about_one_recording_reach_the_whole_calibration(tmp_path, device, fault, verdicts, said):
    """A calibration is made of all of its recordings: where one is in doubt, nothing of it passes."""
    ran = run_one(gyroscope_workspace(tmp_path / "workspace", changes=faulty(device, fault)), CALIBRATION)
    assert ran.requirements == verdicts
    assert ran.code == 1
    assert said in ran.reasons
    assert ran.left_safe()


@pytest.mark.soak
@pytest.mark.timeout(900)
def test_the_plan_as_committed_passes(tmp_path):
    """Four hours at 100 Hz and the whole calibration, in a process of its own with less than 600 MB."""
    workspace = committed_workspace(tmp_path / "workspace")
    ended, peak = workspace.hil_measured(*workspace.run_arguments, timeout=600)
    (folder,) = workspace.folders()
    assert (ended.code, found(Package(folder))) == (0, GOOD), ended.err
    assert verify(folder).findings == ()
    assert peak < 600_000
