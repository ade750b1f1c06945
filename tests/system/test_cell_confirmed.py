"""The fixture `cell`: what keeps a battery from burning is asked as a safety confirmation."""

from __future__ import annotations

import pytest
from battery_runs import BatteryWorkspace, battery_workspace
from live_runs import served
from told_as_json import bodies

from hil.executive.people.answers import SIMULATED_PERSON
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(300)]

SHORTER = {
    'max: "0.02", for: 60 s': 'max: "0.02", for: 4 s',
    'tolerance: "4", within: 180 s': 'tolerance: "40", within: 8 s',
}
REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: "CELL", issue: "1.0", title: The cell has a voltage}
requirements:
- {id: CELL-010, rev: 1, text: The cell shall have a voltage., kind: limit, method: test,
   limits: [{parameter: voltage, unit: V, min: "2", max: "5"}]}
"""
PLAN = '''\
import pytest


@pytest.mark.requirement("CELL-010")
def test_cell(cell, check):
    """The cell is looked at."""
    check("CELL-010", "voltage", cell.cycler.voltage())
'''
ANSWERS = """\
schema: hil/answers/1
answers: {cell-connected: "yes", thermistor-taped: "yes"}
"""
ASKED = ["cell-connected", "thermistor-taped"]


def workspace_of(root):
    """Return a workspace whose plan uses the fixture, with prepared answers."""
    copied = battery_workspace(root, "battery_charge", SHORTER)
    plan = root / "testplans/cell"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(REQUIREMENTS, encoding="utf-8")
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n", encoding="utf-8")
    (plan / "test_cell.py").write_text(PLAN, encoding="utf-8")
    (root / "answers.yaml").write_text(ANSWERS, encoding="utf-8")
    workspace = BatteryWorkspace(root, plan, copied.environment)
    workspace.lock()
    return workspace


def test_fuse_and_thermistor_are_safety_confirmations(tmp_path):
    """In the process of the run the simulated person gives them; the package says so, and replays."""
    ran = workspace_of(tmp_path / "w").run()
    assert ran.verdicts() == {"test_cell": "PASS"}
    assert [(each["name"], each["safety"]) for each in bodies(ran.package, "question")] == [(n, True) for n in ASKED]
    assert [each["by"] for each in bodies(ran.package, "answer")] == [SIMULATED_PERSON] * 2
    assert replay(ran.package).differences == ()


def test_no_file_gives_them_on_a_served_bench(tmp_path):
    """Prepared answers of these names are not taken: nothing is opened, and the error says who has to answer."""
    workspace = workspace_of(tmp_path / "w")
    with served(tmp_path / "e", workspace.root, speed=4.0):
        ended = workspace.hil(*workspace.run_arguments, "--served", str(tmp_path / "e"), "--answers", "answers.yaml")
    assert ended.code == 4, ended.out + ended.err
    assert "is a safety confirmation: a person gives it live, by name, at each arm" in ended.err
    assert workspace.folders() == []
