"""The plan `photodiode` on its simulated bench: it finds what was put in, and passes nothing wrong."""

from __future__ import annotations

import json
import math

import pytest
import sweeps
from live_runs import served
from photodiode_plan import ON_BENCH, photodiode_workspace
from scipy import stats
from told_as_json import bodies, results_as_json

from hil.analysis import photodiode_from_json
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

GOOD = {
    **dict.fromkeys(("012", "013", "014", "020", "021", "040", "041"), "PASS"),
    **dict.fromkeys(("010", "011", "022", "030"), "RECORDED"),
}
TRUTH = {"coefficient": (0.12, "%/K"), "saturation": (1.0, "nA"), "ideality": (1.25, "1"), "gap": (1.12, "eV")}
COMMAND = ("run", "photodiode", "--bench", "photodiode", "--dut", ON_BENCH["dut"], "--source", "simulated")
ANSWERS = 'schema: hil/answers/1\nby: Ada\nanswers: {box: "yes"}\n'
CALIBRATION = ("020", "021", "022", "030", "040", "041")
"""Requirements that a calibration decides."""

TRUE = '        reference: "3.2968"\n'


def put(*lines):
    """Return a change of the bench that adds lines to the truth of the box."""
    return {"bench": {TRUE: TRUE + "".join(f"        {line}\n" for line in lines)}}


FAULTS = {
    "the photodiode is shorted": ("FAIL", "lit of board is FAIL", put("state: shorted")),
    "a lamp that is off": ("FAIL", "lit of board is FAIL", put('lamp: "0"')),
    "a lamp that droops": ("INCONCLUSIVE", "steady: the light changed by", put('droop: "0.4"')),
    "a monitor that is dark": ("FAIL", "lit of monitor is FAIL", put('monitor: "0"')),
    "a monitor at full scale": ("FAIL", "the monitor reads 4095 LSB", put('monitor: "4"')),
    "a box that leaks light": ("FAIL", "under the lamp: look for light", put('leak: "0.06"')),
    "a converter at full scale": ("INCONCLUSIVE", "forward: ", put('photocurrent: "0.02"', 'saturation: "1e-33"')),
    "a reference that is off by 5 %": (
        "INCONCLUSIVE",
        "the board's own reference is -4.8% from the meter's",
        {"bench": {TRUE: TRUE.replace("3.2968", "3.4616")}},
    ),
    "a thermometer in kelvin": ("ERROR", "temperature is not a number", put('offset: "273.15"')),
    "a thermometer that is frozen": (
        "FAIL",
        "span: the temperatures span 0.0 K",
        {"bench": {"tmp1: {connects: {temperature: box.temperature}}": "tmp1: {}"}},
    ),
    "the photodiode is open": ("FAIL", "lit of board is FAIL", put("state: open")),
    "too little warmth": (
        "FAIL",
        "K; 10 K are needed",
        {"parameters": {'name: hottest, value: "35.5"': 'name: hottest, value: "18"'}},
    ),
}
"""By name: the verdict of the case, words of its reasons, and what is changed."""


def verdicts_of(ran):
    """Return the verdict of each requirement by the number at the end of its id."""
    (case,) = results_as_json(ran.package)["cases"]
    return {name[-3:]: str(verdict) for name, verdict in case["requirements"].items()}


@pytest.fixture(scope="module", params=[500, pytest.param(None, marks=pytest.mark.soak)], ids=["short", "whole"])
def healthy(request, tmp_path_factory):
    """Run the plan on a healthy bench."""
    root = tmp_path_factory.mktemp("photodiode") / "workspace"
    return photodiode_workspace(root, leg=request.param).run(**ON_BENCH)


def test_every_requirement_is_met_again_from_the_bytes(healthy):
    """Limits pass and figures are recorded, the package verifies, and the replay finds no difference."""
    assert verdicts_of(healthy) == GOOD, healthy.out
    assert verify(healthy.package.folder).findings == ()
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
    """The case has the verdict that this deserves, and no requirement that the calibration decides is met."""
    verdict, said, changed = FAULTS[fault]
    ran = photodiode_workspace(tmp_path / "workspace", **changed).run(**ON_BENCH)
    found = verdicts_of(ran)
    assert ran.code == (6 if verdict == "ERROR" else 1)
    assert ran.verdicts() == {"test_photodiode": verdict}, ran.out
    assert said in ran.reasons("test_photodiode")
    assert not {found[number] for number in CALIBRATION} & {"PASS", "RECORDED"}, ran.out


def test_an_unanswered_question_ends_the_command_before_anything_is_switched_on(tmp_path):
    """Without a terminal and answers: exit 4, and no run."""
    workspace = photodiode_workspace(tmp_path / "workspace")
    asked = workspace.hil(*COMMAND, "--ask")
    assert (asked.code, workspace.folders()) == (4, []), asked.out + asked.err
    assert "there is nobody to answer 'box'" in asked.err
    assert "each needs a person: give answers with --answers FILE" in asked.err


def test_nobody_is_asked_where_a_file_answers(tmp_path):
    """All is well, and the package verifies."""
    workspace = photodiode_workspace(tmp_path / "workspace")
    (workspace.root / "answers.yaml").write_text(ANSWERS, encoding="utf-8")
    ended = workspace.hil(*COMMAND, "--answers", "answers.yaml")
    assert ended.code == 0, ended.out + ended.err
    assert "answered box: yes (Ada (answers file))" in ended.out
    (folder,) = workspace.folders()
    assert verify(folder).findings == ()


@pytest.mark.alone
@pytest.mark.soak
@pytest.mark.timeout(600)
def test_a_live_run_is_answered_by_a_file(tmp_path):
    """On a served bench, in wall time, with a box that warms in 100 s: five minutes, so in the soak only.

    200 readings of cooling determine a slope less well than the plan's 8,500: by their noise alone, one such record in
    twelve cannot show that less than 0.05 %/K is left (4,000 records of white noise). The worst of them shows 0.22 %/K;
    without calibration 0.8 %/K would be left.
    """
    quick = {'dryer_heat: "30"': 'dryer_heat: "45"', 'sensor_lag: "1.5"': 'sensor_lag: "1"'}
    hotter = {'name: hottest, value: "35.5"': 'name: hottest, value: "38"'}
    coarser = {'unit: "%/K", min: "-0.05", max: "0.05", decision': 'unit: "%/K", min: "-0.3", max: "0.3", decision'}
    root = tmp_path / "workspace"
    workspace = photodiode_workspace(root, leg=100, bench=quick, parameters=hotter, requirements=coarser)
    (workspace.root / "answers.yaml").write_text(ANSWERS, encoding="utf-8")
    with served(tmp_path / "s", workspace.root, "photodiode", speed=1.0) as bench:
        ended = workspace.hil(*COMMAND, "--served", str(bench.folder), "--answers", "answers.yaml", timeout=500)
    assert ended.code == 0, ended.out + ended.err
    package = Package(workspace.folders()[-1])
    assert {str(each["verdict"]) for each in results_as_json(package)["cases"]} == {"PASS"}
    assert verify(package.folder).findings == ()
    again = workspace.hil("replay", str(package.folder))  # with the linear algebra of the run, unlike this process
    assert (again.code, "no difference" in again.out) == (0, True), again.out
