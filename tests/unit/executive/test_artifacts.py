"""`artifact`: files of a case, kept once, and made again in a replay."""

from __future__ import annotations

import hashlib

import pytest
from case_parts import Case
from typed_events import event_of

from hil.executive.cases.artifacts import Artifacts
from hil.executive.cases.effects import Recall
from hil.model.errors import Diverged, Misused


def artifacts_of(folder, **options):
    """Return a case and its artifact fixture."""
    case = Case(folder, **options)
    kept = folder / "attachments"
    kept.mkdir(parents=True)
    return case, Artifacts(case.run.steps, case.run.effects, case.written, kept, set())


def test_a_file_is_kept_and_named_in_the_journal(tmp_path):
    """Its bytes lie with the evidence, its hash is an event and an effect."""
    case, artifact = artifacts_of(tmp_path)
    artifact("calibration.json", '{"unit": "°C"}')
    event = case.written.of("attachment")[0]
    data = (tmp_path / "attachments" / event["file"]).read_bytes()
    assert data == '{"unit": "°C"}'.encode()
    assert event["file"] == "test_x-calibration.json"
    assert event["sha256"] == hashlib.sha256(data).hexdigest()
    assert event["by"] == "plan/test_x.py::test_x"
    assert case.written.of("effect")[0]["arguments"] == {"bytes": len(data), "sha256": event["sha256"]}


def test_an_earlier_attempt_is_not_overwritten(tmp_path):
    """A file of that name from another attempt stays, the new one has a number."""
    case, artifact = artifacts_of(tmp_path)
    (tmp_path / "attachments/test_x-a.txt").write_text("before")
    artifact("a.txt", b"now")
    assert (tmp_path / "attachments/test_x-a.txt").read_text() == "before"
    assert case.written.of("attachment")[0]["file"] == "test_x-2-a.txt"


@pytest.mark.parametrize("before", ["test_x-A.txt", "test_X-a.txt"])
def test_names_that_differ_by_the_size_of_letters_are_one_name(tmp_path, before):
    """`artifact("a")` beside `artifact("A")` of another case: a package with both could not be copied everywhere."""
    case, artifact = artifacts_of(tmp_path)
    (tmp_path / "attachments" / before).write_text("x")
    artifact("a.txt", "x")
    assert case.written.of("attachment")[0]["file"] == "test_x-2-a.txt"


@pytest.mark.parametrize(
    "name", ["", "../x", "a/b", ".hidden", "a b", "x" * 101, None, "a\0b", "NUL", "com1.txt", "a."]
)
def test_only_plain_file_names_are_taken(tmp_path, name):
    """Nothing leaves the folder of attachments, and every system can store what is in it."""
    _, artifact = artifacts_of(tmp_path)
    with pytest.raises(Misused, match="not a valid file name"):
        artifact(name, "x")


def test_content_is_text_or_bytes_and_kept_once(tmp_path):
    """Numbers are no file, and a second file of one name is a mistake."""
    _, artifact = artifacts_of(tmp_path)
    with pytest.raises(Misused, match="a float"):
        artifact("a.txt", 1.0)
    artifact("a.txt", "x")
    for name in ("a.txt", "A.txt"):
        with pytest.raises(Misused, match="already keeps"):
            artifact(name, "y")


def test_a_replay_has_to_make_the_same_bytes(tmp_path):
    """Other coefficients than those of the record are DIVERGED."""
    case, artifact = artifacts_of(tmp_path / "first")
    artifact("a.txt", "1.0690")
    recall = Recall([event_of(**event) for event in case.written.of("effect")], frozenset())
    _, again = artifacts_of(tmp_path / "again", recall=recall)
    with pytest.raises(Diverged):
        again("a.txt", "1.0691")
