"""What happened to the bench of a run that was left by force is told in sentences, by time."""

from __future__ import annotations

import itertools
import json

import pytest

from hil.cli.commands.ack import moment, what_happened, written_down
from hil.evidence.folder import GUARDIAN
from hil.report.page.incidents import Sentence


@pytest.fixture
def told(tmp_path, monkeypatch):
    """Return what is told of a run whose guardian wrote these facts, a second apart."""
    monkeypatch.setattr("hil.guardian.latch.PLACES", (tmp_path / "latches",))

    def tell(*facts):
        file = tmp_path / GUARDIAN
        file.parent.mkdir(exist_ok=True)
        stamped = ({"utc": f"2026-11-21T10:00:{second:02d}.5Z"} for second in itertools.count())
        lines = [fact if isinstance(fact, str) else json.dumps({**next(stamped), **fact}) for fact in facts]
        file.write_text("".join(f"{line}\n" for line in lines))
        return [each.text for each in what_happened(tmp_path)]

    return tell


def test_an_act_of_the_guardian_is_told_from_its_reason_to_its_end(told):
    """Outputs of which the same is said are one sentence, and several latches are one."""
    outputs = [{"event": "off", "output": name, "ok": True, "detail": ""} for name in ("heater", "supply")]
    proofs = [{"event": "proof", "output": name, "ok": True, "detail": "safe"} for name in ("heater", "supply")]
    assert told(
        {"event": "acting", "why": "the executive died"},
        *outputs,
        {"event": "first pass over", "seconds": 0.005},
        {"event": "executive ended", "ok": True},
        *proofs,
        *({"event": "latched", "path": path} for path in ("a", "b")),
        {"event": "done", "unproven": []},
    ) == [
        "the guardian acted: the executive died",
        "the guardian switched off heater, supply",
        "the guardian commanded every output off within 0.005 s",
        "the process of the run was ended",
        "the guardian proved heater, supply safe",
        "the guardian latched the bench",
        "the guardian finished: every output is proven safe",
    ]


def test_what_the_guardian_could_not_do_stands_out(told):
    """Each with its reason, and what is cut off by something else with what cuts it off."""
    assert told(
        {"event": "off", "output": "supply", "ok": False, "detail": "no reply"},
        {"event": "executive ended", "ok": False},
        {"event": "failed", "why": "OSError(5)"},
        {"event": "proof", "output": "heater", "ok": True, "detail": "cut off by relay, which is safe; no reply"},
        {"event": "proof", "output": "supply", "ok": False, "detail": "not proven: no reply"},
        {"event": "not latched", "path": "a", "why": "no space"},
        {"event": "done", "unproven": ["supply"]},
    ) == [
        "supply did not take the guardian's command: no reply",
        "the process of the run could NOT be ended",
        "a step of the guardian failed: OSError(5)",
        "heater is cut off by relay, which is safe; no reply",
        "NOT PROVEN SAFE by the guardian: supply: no reply",
        "the guardian could NOT latch the bench: no space",
        "the guardian finished: NOT PROVEN SAFE: supply",
    ]


def test_what_nobody_has_words_for_is_told_as_it_stands(told):
    """Facts of another version, damaged ones, and a line that is cut off, which has no time and comes last."""
    assert told('{"event":"ac', {"event": "acting"}, {"event": "danced", "with": "the relay"}) == [
        "event acting",
        "event danced, with the relay",
        'a line of the guardian\'s journal cannot be read: {"event":"ac',
    ]


def test_what_is_written_down_in_full_is_named_as_far_as_it_is_there(told, tmp_path):
    """A run that is gone has nothing, which is no error."""
    assert (what_happened(tmp_path), written_down(tmp_path)) == ([], [])
    told({"event": "acting", "why": "it died"})
    assert written_down(tmp_path) == [tmp_path / GUARDIAN]
    assert what_happened(tmp_path) == [Sentence("2026-11-21T10:00:00.5Z", "the guardian acted: it died")]


@pytest.mark.parametrize(
    ("utc", "shown"),
    [
        ("2026-11-21T10:00:07.256789Z", "2026-11-21 10:00:07.256 UTC"),
        ("2026-11-21T10:00:07Z", "2026-11-21 10:00:07.000 UTC"),
        ("yesterday", "yesterday"),
        ("", ""),
    ],
)
def test_an_instant_is_shown_in_one_width(utc, shown):
    """What is no instant is shown as it is."""
    assert moment(utc) == shown
