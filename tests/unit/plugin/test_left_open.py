"""What is told of a run that is left open: why it was stopped, and what a person does next."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from hil.executive.journaling.events import DISK_FULL
from hil.plugin import left_open
from hil.plugin.left_open import left_open_lines, lost_lines


@pytest.mark.parametrize(
    ("unsafe", "latched", "state", "next_step"),
    [
        (False, False, "the bench is safe", "put right what was lost, then hil resume R"),
        (
            True,
            True,
            "the bench is NOT PROVEN SAFE: look at it, and switch off by hand what is on",
            'put right what was lost, then hil ack R --by NAME --text "what was seen and done", then hil resume R',
        ),
    ],
)
def test_a_loss_is_told_with_the_next_command(tmp_path, monkeypatch, unsafe, latched, state, next_step):
    """A latched bench is acknowledged before the run resumes."""
    monkeypatch.setattr(left_open, "latches_of", lambda run: {tmp_path: object()} if latched and run == "R" else {})
    told = lost_lines(tmp_path / "R", "a lost port: tec1", unsafe=unsafe)
    assert told == ["stopped by a lost port: tec1", state, next_step]


def test_a_full_disk_is_named_with_what_is_free_now(tmp_path, monkeypatch):
    """It is not resumed before there is space; any other stop is, at once."""
    monkeypatch.setattr(left_open.shutil, "disk_usage", lambda _: SimpleNamespace(free=8_056_832))
    first, second = left_open_lines(tmp_path, DISK_FULL)
    assert first.startswith("stopped by a full disk, and not sealed: /")
    assert first.endswith(" has 8 056 832 bytes free")
    assert second.startswith(f"free some space there, then resume it with hil resume {tmp_path}, or seal it")
    assert left_open_lines(tmp_path / "R", "bench needed") == [
        "stopped, and not sealed: resume it with hil resume R",
    ]
