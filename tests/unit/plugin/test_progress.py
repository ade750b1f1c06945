"""What a person at the running terminal sees."""

from __future__ import annotations

import io

import pytest

from hil.plugin.progress import Progress


def shown(*events):
    """Return what progress writes of these events."""
    stream = io.StringIO()
    progress = Progress(stream)
    for event in events:
        progress(event)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("event", "line"),
    [
        ({"kind": "note", "text": "door opened", "by": "Ada"}, "note: door opened (Ada)"),
        ({"kind": "note", "text": "door opened", "by": ""}, "note: door opened (not recorded by whom)"),
        (
            {"kind": "attachment", "file": "1-nc-photo.txt", "text": "a photo", "by": "Ada", "sha256": "00"},
            "attachment: 1-nc-photo.txt: a photo (Ada)",
        ),
        ({"kind": "anomaly", "text": "inbox, hold by Ada: tea"}, "anomaly: inbox, hold by Ada: tea"),
    ],
    ids=["note", "nobody", "attachment", "hold"],
)
def test_what_another_terminal_says_is_acknowledged(event, line):
    """A note, an attachment, or anything else from the inbox is a line at once."""
    assert shown(event) == f"  {line}\n"
