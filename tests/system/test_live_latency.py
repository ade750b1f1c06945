"""Whole runs on a bench whose instruments reply late, steadily or more so from the middle on: armed, guarded, proven.

Its four instruments speak four families of protocols: SCPI over TCP, Korad, Modbus, and lines that come unasked.
"""

from __future__ import annotations

import re
import signal
import time
from dataclasses import replace

import pytest
import sweeps
from latency_proxy import at_a_distance
from live_runs import live_workspace, running, seconds_until, served

from hil.evidence.safed import guardian_lines, last_act

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(900)]

LATENCIES_S = [(0.04, 0.04), (0.15, 0.15), (0.45, 0.45), (0.002, 0.45)]
"""From the beginning, and from when every output is on."""

TIMEOUT = "900 ms"
"""What the bench file says of each instrument: the line's time, the instrument's own, and that of a busy machine."""

SAFE_S = 2.0
"""Within which every output is off: nothing that is sent waits for a reply, and a busy machine has its time."""

STAYS_S = 5.0
"""How long the run goes on at its latency before it is ended."""

TRIES = [
    (first_s, then_s, end) for first_s, then_s in LATENCIES_S for end in (signal.SIGKILL, signal.SIGINT, signal.SIGSTOP)
]


@pytest.mark.parametrize(
    ("first_s", "then_s", "end"), sweeps.chosen([(0.15, 0.15, signal.SIGKILL), (0.002, 0.45, signal.SIGKILL)], TRIES)
)
def test_a_run_at_a_distance(tmp_path, tmp_path_factory, first_s, then_s, end):
    """It is armed, goes on, and whatever ends it is followed by the proof of every output."""
    near, away = tmp_path_factory.mktemp("b") / "e", tmp_path_factory.mktemp("b") / "e"
    workspace = live_workspace(tmp_path / "w", watched=False)
    file = workspace.root / "fixtures/benches/battery/bench.yaml"
    told = file.read_text().replace("within: 3 s", "within: 15 s")  # some ten exchanges at a distance
    file.write_text(re.sub(r"(?m)^( +)(driver: .+)$", rf"\1\2\n\1timeout: {TIMEOUT}", told))
    with served(near) as bench, at_a_distance(near, away, first_s) as distance:
        with running(replace(bench, folder=away), workspace, limit_s=700.0) as run:
            distance.latency_s = then_s
            began = time.monotonic()
            seconds_until(lambda: time.monotonic() - began > STAYS_S or run.process.poll() is not None, 60.0, "a while")
            assert run.process.poll() is None, run.ended().out
            run.send(end)
            seconds_until(lambda: not bench.on(), SAFE_S, lambda: f"safe, {bench.on()} still on")
            ended = run.ended()
            assert ended.code == (2 if end == signal.SIGINT else 3), ended.out
        journal = run.folder / "data/guardian.jsonl"
        if end == signal.SIGINT:
            assert not journal.exists()
            return
        seconds_until(lambda: '"event": "done"' in journal.read_text(), 60.0, "the guardian's proof")
        act = last_act(guardian_lines(run.folder))
        assert act is not None
        assert act.safe
        name = run.folder.name
        seconds_until(
            lambda: not bench.on() and workspace.hil("ack", name, "--by", "Ada", "--text", "off").code == 0, 60.0, "ack"
        )
