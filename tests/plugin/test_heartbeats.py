"""An instrument's own watchdog in a run: kept from opening while the run lives, whatever the case does."""

from __future__ import annotations

import pytest
from told_as_json import bodies
from workspaces import agreed, make

from hil.plugin.rehearsing import replay

pytestmark = pytest.mark.system  # each test is a whole run

WIRE = 'contacts: {a: "1", b: "2"}, hazardous: false,'
HELD = 'contacts: {a: "1", b: "2"}, settings: {beat: 6 s},'
PATHS = "cut_paths:\n- {output: relays, watchdog: relays, within: 6 s}\n"
CASE = """
    @pytest.mark.requirement("T-010")
    def test_held(relays, clock, record, supply, magnetometer, check):
        relays.close("a")
        clock.sleep(25.0)
        closed = relays.closed()
        supply.sensor.configure(3.3, 0.02)
        supply.sensor.enable()
        clock.sleep(0.1)
        magnetometer.start()
        record("field", magnetometer, duration=12.0, rate=10.0)
        check("T-010", "ratio", Figure(value=float(closed == relays.closed() == ("a",)), unit="1", uncertainty=0.01))
    """


def test_a_contact_is_held_for_as_long_as_the_run_lives(tmp_path):
    """The board's time is 6 s; the case waits and records for 37 s. The record replays, heartbeats included."""
    workspace = make(tmp_path / "workspace", CASE)
    file = workspace.root / "fixtures/benches/adcs/bench.yaml"
    text = file.read_text(encoding="utf-8")
    assert WIRE in text
    assert "cut_paths" not in text
    file.write_text(text.replace(WIRE, HELD).replace("\nsimulated:", f"\n{PATHS}\nsimulated:"), encoding="utf-8")
    ran = workspace.run()
    agreed(ran, {"test_held": "PASS"}, "PASS", 0)
    sent = (ran.package.folder / "data/transcript.tsv").read_text(encoding="utf-8")
    assert sent.count("01050200003c") > 15
    assert replay(ran.package).differences == ()
    gates = {body["name"]: body["detail"] for body in bodies(ran.package, "gate")}
    assert gates["watchdog of relays for relays"] == "opens relays 6 s after its last heartbeat"
    assert gates["if run and guardian end at once"] == "relays off within 6 s (watchdog of relays)"
