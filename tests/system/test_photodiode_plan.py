"""The plan `photodiode` on its simulated bench: it finds what was put in, and passes nothing wrong."""

from __future__ import annotations

import json
import math

import pytest
import sweeps
from photodiode_plan import ON_BENCH, photodiode_workspace
from scipy import stats
from told_as_json import bodies, results_as_json

from hil.analysis import photodiode_from_json
from hil.evidence.package.contents import Package
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

GOOD = {
    **dict.fromkeys(("012", "013", "014", "020", "021", "040", "041"), "PASS"),
    **dict.fromkeys(("010", "011", "022", "030"), "RECORDED"),
}
TRUTH = {"coefficient": (0.12, "%/K"), "saturation": (1.0, "nA"), "ideality": (1.25, "1"), "gap": (1.12, "eV")}
CALIBRATION = ("020", "021", "022", "030", "040", "041")
"""Requirements that a calibration decides."""

TRUE = '        reference: "3.2968"\n'


def put(*lines):
    """Return a change of the bench that adds lines to the truth of the box."""
    return {"bench": {TRUE: TRUE + "".join(f"        {line}\n" for line in lines)}}


FAULTS = {
    "the photodiode is shorted": put("state: shorted"),
    "a lamp that is off": put('lamp: "0"'),
    "a lamp that droops": put('droop: "0.4"'),
    "a box that leaks light": put('leak: "0.06"'),
    "a converter at full scale": {"bench": {**put('photocurrent: "0.02"', 'saturation: "1e-33"')["bench"]}},
    "a reference that is off by 5 %": {"bench": {TRUE: TRUE.replace("3.2968", "3.4616")}},
    "a thermometer in kelvin": put('offset: "273.15"'),
    "a thermometer that is frozen": {"bench": {"tmp1: {connects: {temperature: box.temperature}}": "tmp1: {}"}},
    "the photodiode is open": put("state: open"),
    "too little warmth": {
        "parameters": {'name: hottest, value: "35.5"': 'name: hottest, value: "18"'},
        **put('lamp_heat: "2"'),
    },
}


def verdicts_of(ran):
    """Return the verdict of each requirement by the number at the end of its id."""
    (case,) = results_as_json(ran.package)["cases"]
    return {name[-3:]: str(verdict) for name, verdict in case["requirements"].items()}


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.soak)], ids=["short", "whole"])
def healthy(request, tmp_path_factory):
    """Run the plan on a healthy bench."""
    root = tmp_path_factory.mktemp("photodiode") / "workspace"
    return photodiode_workspace(root, whole=request.param).run(**ON_BENCH)


def test_every_requirement_is_met_again_from_the_bytes(healthy):
    """Limits pass and figures are recorded, and the replay finds no difference."""
    assert verdicts_of(healthy) == GOOD, healthy.out
    assert replay(healthy.package).differences == ()


def test_the_plan_finds_what_was_put_in(healthy):
    """Each figure is within what it states at 99.9 %; the lamp's light is not the plant's number but nearly."""
    found = {str(check["parameter"]): check for check in bodies(healthy.package, "check")}
    for name, (true, unit) in TRUTH.items():
        check = found[name]
        assert check["unit"] == unit
        limit = float(stats.t.ppf(0.9995, float(check["dof"]))) * float(check["uncertainty"])
        assert abs(float(check["value"]) - true) < limit, name
    assert float(found["photocurrent"]["value"]) == pytest.approx(45.0, rel=0.01)
    assert abs(float(found["raw_slope"]["value"])) > 10.0 * abs(float(found["remaining_slope"]["value"]))


def test_the_exports_are_evidence(healthy):
    """JSON and C header hold one calibration, which computes the light from a reading."""
    folder = "data/attachments/test_photodiode-photodiode"
    text, header = healthy.package.text(f"{folder}.json"), healthy.package.text(f"{folder}.h")
    assert json.loads(text)["fingerprint"] in header
    diode = photodiode_from_json(text)
    volts = float(diode.voltage_of(1.0, 30.0, 20e3))
    assert math.isclose(float(diode.light_of(volts, 30.0, 20e3)), diode.photocurrent, rel_tol=1e-9)


@pytest.mark.parametrize("fault", sweeps.sample(FAULTS, 4))
def test_what_is_wrong_passes_nothing(tmp_path, fault):
    """No requirement that the calibration decides is met or recorded, and the run is not good."""
    ran = photodiode_workspace(tmp_path / "workspace", **FAULTS[fault]).run(**ON_BENCH)
    found = verdicts_of(ran)
    assert ran.code != 0
    assert not {found[number] for number in CALIBRATION} & {"PASS", "RECORDED"}, ran.out


def test_the_question_comes_before_anything_is_switched_on(tmp_path):
    """Without a terminal and answers nothing is driven; with a file of answers nobody is asked, and all is well."""
    workspace = photodiode_workspace(tmp_path / "workspace")
    words = ("run", "photodiode", "--bench", "photodiode", "--dut", ON_BENCH["dut"], "--source", "simulated")
    asked = workspace.hil(*words, "--ask")
    assert asked.code in {1, 4}
    assert "needs a person" in asked.out + asked.err
    for folder in workspace.folders():
        assert [event["name"] for event in bodies(Package(folder), "effect") if event["effect"] == "drives"] == []
    (workspace.root / "answers.yaml").write_text('schema: hil/answers/1\nanswers: {box: "yes"}\n', encoding="utf-8")
    ended = workspace.hil(*words, "--operator", "A. Person", "--answers", "answers.yaml")
    assert ended.code == 0, ended.out + ended.err
