"""`hil resume` on the command line: what it hands on."""

from __future__ import annotations

import pytest
from click.testing import CliRunner
from typed_events import event_of

from hil.cli.commands.resume import command
from hil.cli.supervision import Invocation
from hil.evidence.journal.reader import JournalLine
from hil.executive.resuming.earlier import Earlier

RUN = {
    "plans": ["p"],
    "bench": "b",
    "dut": {"serial": "d"},
    "source": "hardware",
    "purpose": "development",
    "operator": "",
    "skips": {},
    "overrides": {},
    "epoch": "2026-01-01T00:00:00Z",
    "live": {"served": False, "speed": 1},
    "unattended": True,
    "on_call": "Ada",
}


class Heard:
    """A word that nobody hears."""

    def listen(self):
        """Do nothing."""


@pytest.mark.parametrize(("options", "seconds"), [((), 600.0), (("--acknowledge-within", "0.5"), 30.0)])
def test_the_person_on_call_has_the_time_that_is_given(tmp_path, monkeypatch, options, seconds):
    """An unattended run reaches that person again when it is resumed."""
    requests = []

    def resume(folder, request, *_, **__):
        line = JournalLine(number=1, event=event_of("run", **RUN), wall={}, raw=b"", rest=b"")
        requests.append(request(Earlier(folder=folder, head=(line,), lines=(), size=0)))
        return 0

    monkeypatch.setattr("hil.cli.commands.resume.find_run", lambda _: tmp_path)
    monkeypatch.setattr("hil.plugin.running.resume", resume)
    ended = CliRunner().invoke(command, ["x", *options], obj=Invocation((), Heard()), standalone_mode=False)
    assert ended.exception is None
    (request,) = requests
    assert (request.unattended, request.on_call, request.acknowledge_within_s) == (True, "Ada", seconds)
