"""A workspace with a bench of its own: a rotation table and nothing else."""

from __future__ import annotations

from workspaces import make

__all__ = ["BENCH", "CERTIFICATE", "rotation_workspace"]

CERTIFICATE = """\
Specimen certificate of the reference workspace, for a bench that exists in simulation only.

Instrument      Newport ESP301 with rotation stage URS75BPP, SN1263
Calibrated      2026-09-30, due 2027-09-30
Angle           any angle, full turns counted: U = 0.004 deg, k = 2
"""

BENCH = """\
schema: hil/bench/1
bench: {name: table, title: Rotation table}
instruments:
  table1:
    driver: newport-esp301
    port: /dev/serial/by-id/usb-Newport_ESP301-if00-port0
    baud: "921600"
    identity: {model: ESP301, serial: SN1263}
    ratings:
    - {channel: "1", quantity: rate, unit: deg/s, max: "80"}
    calibration:
      certificate: certificates/table1.txt
      due: "2027-09-30"
      ranges:
      - {quantity: angle, unit: deg, from: "-1000000", to: "1000000", absolute: "0.004"}

wiring:
- {role: rotation_table, instrument: table1, channel: "1",
   settings: {acceleration: 50 deg/s2, tolerance: 0.1 deg/s, accuracy: 0.002 deg},
   note: "axis up; positive counter-clockwise seen from above; harness with a slack of 12 turns either way"}

clamps:
- {output: rotation_table, quantity: rate, unit: deg/s, min: "-60", max: "60"}
- {output: rotation_table, quantity: turns, unit: turn, min: "-10", max: "10"}

envelope:
- {id: table-rate, output: rotation_table, quantity: rate, unit: deg/s, min: "-65", max: "65",
   period: 5 s, max_age: 20 s, debounce: "2"}
- {id: table-turns, output: rotation_table, quantity: turns, unit: turn, min: "-11", max: "11",
   period: 2 s, max_age: 20 s}

safe_off:
- {output: rotation_table, state: stopped, within: 15 s,
   proof: {output: rotation_table, quantity: rate, unit: deg/s, min: "-0.05", max: "0.05"}}

rest:
- {output: rotation_table, state: stopped, within: 15 s,
   proof: {output: rotation_table, quantity: rate, unit: deg/s, min: "-0.05", max: "0.05"}}

cut_paths:
- {output: rotation_table, hardware: interlock of the cover takes the motor's power away, within: 2 s}

simulated:
  epoch: "2026-01-01T08:00:00Z"
  seed: "20260102"
  plants:
    table:
      model: rotation-table
      grid: 100 ms
      truth: {mounting: z, ripple: "0.0003", tilt: ["0.004", "-0.003"], earth_rate: "15.041", latitude: "41.4"}
  peers:
    table1:
      truth: {serial: SN1263, maximum_velocity: "80"}
      connects: {rate: table.rate_command, acceleration: table.acceleration, grip: table.grip, angle: table.angle}
  person:
    board-on-table: table.mounting
"""


def rotation_workspace(root, *cases, changes=(), **parts):
    """Make a workspace with one plan and the bench `table`; `changes` are pairs of old and new text of its file."""
    workspace = make(root, *cases, **parts)
    folder = root / "fixtures/benches/table"
    (folder / "certificates").mkdir(parents=True)
    (folder / "certificates/table1.txt").write_text(CERTIFICATE, encoding="utf-8")
    text = BENCH
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "bench.yaml").write_text(text, encoding="utf-8")
    return workspace
