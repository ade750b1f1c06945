"""The inbox: messages in order, never lost, never half."""

from __future__ import annotations

import os

import pytest

from hil.evidence import inbox
from hil.evidence.folder import create
from hil.evidence.inbox import asks_for_end, poll, post, waiting
from hil.model.errors import EvidenceError, Refused


@pytest.fixture
def folder(tmp_path):
    """Return the folder of a run."""
    return create(tmp_path / "reports", bench="b", dut="d")


def test_messages_come_in_order_and_once(folder):
    """What was posted first is given first, and is gone afterwards."""
    post(folder, "note", by="Ada", text="the door was open")
    post(folder, "stop", by="Ada", text="smoke", urgent=True)
    first, second = poll(folder)
    assert (first.kind, first.by, first.text, first.urgent) == ("note", "Ada", "the door was open", False)
    assert (second.kind, second.urgent) == ("stop", True)
    assert first.utc < second.utc
    assert list(poll(folder)) == []


def test_a_message_stays_until_it_was_dealt_with(folder):
    """Whoever dies between taking a message and writing it down finds it again."""
    post(folder, "note", text="keep me")
    messages = poll(folder)
    assert next(messages).text == "keep me"
    messages.close()
    assert [message.text for message in poll(folder)] == ["keep me"]


def test_an_attachment_is_copied_hashed_and_kept(folder, tmp_path):
    """A file keeps its content and a safe name, also when its message is taken twice."""
    (tmp_path / "../photo of rig.jpg").resolve().write_bytes(b"picture")
    post(folder, "attachment", attach=tmp_path / "../photo of rig.jpg", by="Ada", text="the rig")
    taken = poll(folder)
    message = next(taken)
    taken.close()
    assert [again.file for again in poll(folder)] == [message.file]
    assert message.file.endswith("photo_of_rig.jpg")
    assert (folder / "data/attachments" / message.file).read_bytes() == b"picture"
    assert list((folder / "inbox/files").iterdir()) == []


def test_a_safe_file_name_stays_as_it_is(folder, tmp_path):
    """Hyphens and points of an attachment's name are kept, after the name of its message."""
    (tmp_path / "nc-photo.v2.txt").write_bytes(b"picture")
    name = post(folder, "attachment", attach=tmp_path / "nc-photo.v2.txt")
    assert [message.file for message in poll(folder)] == [f"{name}-nc-photo.v2.txt"]


@pytest.mark.parametrize(
    "data", [b"", b"[]", b"{}", b'{"kind":"shout"}', b'{"kind":[]}', b'{"kind":"note","text":NaN}']
)
def test_nonsense_is_told_and_removed(folder, data):
    """A message that cannot be read does not stop a run, and does not come again."""
    (folder / "inbox/1.message").write_bytes(data)
    assert [message.kind for message in poll(folder)] == ["unreadable"]
    assert list(poll(folder)) == []


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to("/dev/zero")])
def test_a_message_that_is_no_file_is_not_waited_for(folder, make):
    """A pipe, a folder or a link to something endless is told and removed, and the run goes on."""
    make(folder / "inbox/1.message")
    assert [message.kind for message in poll(folder)] == ["unreadable"]
    assert [path.name for path in (folder / "inbox").iterdir()] == ["files"]


@pytest.mark.parametrize("file", ["../../escape", "/etc/passwd", "missing.jpg", ".hidden"])
def test_a_forged_attachment_does_not_leave_the_run(folder, file):
    """A message that names a file elsewhere, or none that was sent, is unreadable."""
    (folder / "inbox/1.message").write_bytes(b'{"kind":"attachment","file":"%b","sha256":""}' % file.encode())
    assert [message.kind for message in poll(folder)] == ["unreadable"]


def test_what_cannot_be_posted_is_refused(folder, tmp_path, monkeypatch):
    """Unknown kinds, endless texts, folders and large files are refused in a sentence."""
    with pytest.raises(Refused, match="is not a message"):
        post(folder, "shout")
    with pytest.raises(Refused, match="too long"):
        post(folder, "note", text="x" * 100_001)
    with pytest.raises(Refused, match="not a file"):
        post(folder, "attachment", attach=tmp_path)
    monkeypatch.setattr(inbox, "LARGEST_ATTACHMENT", 10)
    (tmp_path / "large").write_bytes(bytes(11))
    with pytest.raises(Refused, match="larger"):
        post(folder, "attachment", attach=tmp_path / "large")


def test_a_run_without_inbox_takes_nothing(tmp_path, folder):
    """A sealed run refuses, and one that is being sealed says that it may be over."""
    (tmp_path / "data").mkdir()
    with pytest.raises(EvidenceError, match="still in progress"):
        post(tmp_path, "note")
    assert list(poll(tmp_path)) == []
    (folder / "bagit.txt").write_text("sealed")
    with pytest.raises(Refused, match="sealed"):
        post(folder, "note")


def test_what_was_asked_of_an_earlier_process_is_not_owed(folder):
    """A stop or a hold that was left for it is unheard; notes are taken, and later stops are heard."""
    post(folder, "stop", by="Ada", text="smoke")
    post(folder, "note", text="keep me")
    left = waiting(folder)
    assert (asks_for_end(folder, ()), asks_for_end(folder, left)) == (True, False)
    post(folder, "interrupt")
    assert asks_for_end(folder, left)
    assert [(message.kind, message.text) for message in poll(folder, left)] == [
        ("unheard", "stop, before the run was resumed: smoke"),
        ("note", "keep me"),
        ("interrupt", ""),
    ]
