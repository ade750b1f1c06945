"""The plan battery_degradation on a served bench: a few cycles of a small cell, in a minute or two of the wall."""

from __future__ import annotations

import csv
import hashlib
import re
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from battery_runs import BatteryWorkspace, battery_workspace
from live_runs import Served
from workspaces import Ended, finish, kill

from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package

__all__ = ["CYCLES", "Kept", "Part", "cycling_workspace", "events_of", "going", "kept_rows", "overrides_of"]

CYCLES = 4

_PARAMETERS = {"rest": "480", "soak": "60", "settling": "0", "lowest_voltage": "2.55", "cycles": str(CYCLES)}
"""What the plan is told instead of its own: the plates here change their temperature in three minutes."""

_CELL = (
    'place: assembly, capacity: "0.12", fade: "0.02", plate_capacity: "70", cell_capacity: "14", cell_plate: "3",'
    ' slow_resistance: "0.04", slow_time: "200", open_circuit: ["2.7", "2.85", "3.1", "3.4", "3.6", "3.698", "3.738",'
    ' "3.778", "3.838", "3.908", "3.988", "4.078", "4.128", "4.2"]'
)
_CONTROLLER = 'period: 5 s, proportional_band: "15", integral_time: "120"'

_ANSWERS = """\
schema: hil/answers/1
answers: {cell-connected: "yes", thermistor-taped: "yes", cell-place: assembly}
"""


def cycling_workspace(root: Path) -> BatteryWorkspace:
    """Return a workspace with the plan and a bench whose small cell lies in its assembly, with answers for a run.

    Time on the wall counts many times on a bench that is served fast, so that limits on it are wider here.
    """
    workspace = battery_workspace(
        root,
        "battery_degradation",
        {
            "truth: {place: container}": f"truth: {{{_CELL}}}",
            'truth: {period: 60 s, proportional_band: "60", integral_time: "240"}': f"truth: {{{_CONTROLLER}}}",
            'unit: K/min, max: "20"': 'unit: K/min, max: "60"',
        },
    )
    bench = root / "fixtures/benches/battery/bench.yaml"
    text = bench.read_text(encoding="utf-8")
    envelope, safe_off = text.index("envelope:"), text.index("cut_paths:")
    wider = re.sub(r"max_age: \d+ s", "max_age: 3600 s", text[envelope:safe_off])
    wider = re.sub(r"within: \d+ s", "within: 1200 s", wider)
    bench.write_text(text[:envelope] + wider + text[safe_off:], encoding="utf-8")
    (root / "answers.yaml").write_text(_ANSWERS, encoding="utf-8")
    return workspace


def overrides_of() -> list[str]:
    """Return the options that change the plan's parameters."""
    return [word for name, value in _PARAMETERS.items() for word in ("--set", f"{name}={value}")]
