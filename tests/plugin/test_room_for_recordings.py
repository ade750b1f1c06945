"""A plan whose recordings cannot hold on this bench is refused before anything is energised."""

from __future__ import annotations

import pytest
from told_as_json import bodies
from workspaces import make

from hil.plugin.rehearsing import procedure, replay

pytestmark = pytest.mark.system

REQUIREMENTS = """\
- {id: T-030, rev: 1, text: The field shall be recorded for 20 s., kind: record, method: test,
   records: {recording: field, channels: [x, y, z], rate: RATE, duration: 20 s, max_gap: GAP}}
"""

CASES = """
@pytest.mark.requirement("T-030")
def test_field(field, record):
    record("field", field, duration=20.0, rate=40.0)
"""

REFUSED = (
    "room for recordings: 'field' of T-030: coil-current has to be read at least every 4 s (its maximum age less its"
    " period), and the recording lasts 19.99 s; its reading takes "
)


def workspace(root, *, rate, gap):
    """Return a workspace with a case that records for 20 s."""
    return make(root / "workspace", CASES, requirements=REQUIREMENTS.replace("RATE", rate).replace("GAP", gap))


def test_a_plan_without_room_is_refused_before_anything_is_energised(tmp_path):
    """No case is run, no output is touched, the reason has the arithmetic, and `hil plan` says the same."""
    made = workspace(tmp_path, rate="100 Hz", gap="0.012 s")
    ran = made.run()
    assert set(ran.verdicts().values()) == {"NOT_RUN"}
    assert ran.code == 1
    reason = ran.reasons("test_field")
    assert REFUSED in reason
    assert "where 12 ms are allowed: lower the rate" in reason
    (gate,) = [each for each in bodies(ran.package, "gate") if not each["ok"]]
    assert gate["name"] == "room for recordings"
    for kind in ("safe", "rest", "armed", "recording", "effect"):
        assert not list(bodies(ran.package, kind)), kind
    assert any(REFUSED in line for line in procedure(made.request()))
    assert replay(ran.package).differences == ()


def test_a_plan_with_room_runs_with_what_was_seen_in_its_evidence(tmp_path):
    """Rate and gap hold in it, and so they do where the case that finds no room is left out."""
    made = workspace(tmp_path, rate="40 Hz", gap="0.1 s")
    ran = made.run()
    assert set(ran.verdicts().values()) == {"RECORDED"}
    (gate,) = [each for each in bodies(ran.package, "gate") if each["name"] == "room for recordings"]
    assert "one is due every 25 ms; with a quarter to spare, readings take: coil-current " in gate["detail"]
    assert replay(ran.package).differences == ()


def test_cases_that_are_left_out_need_no_room(tmp_path):
    """Who takes them out of the run need not change the plan."""
    made = workspace(tmp_path, rate="100 Hz", gap="0.012 s")
    ran = made.run(skips={"test_field": "no room"})
    assert not [each for each in bodies(ran.package, "gate") if each["name"] == "room for recordings"]
