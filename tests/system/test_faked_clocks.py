"""A plan that freezes time in its process, as tools for tests do, deceives itself and not the record."""

from __future__ import annotations

import pytest
from told_as_json import results_as_json
from workspaces import finish, make

from hil.clock import wall
from hil.evidence.folder import JOURNAL
from hil.evidence.journal.clocks import SUPERVISOR, clock_doubts
from hil.evidence.journal.reader import read_journal
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = [pytest.mark.system, pytest.mark.timeout(100)]

FREEZES = """
import datetime
import sys
import time

real = datetime.datetime


class Frozen(datetime.datetime):
    @classmethod
    def now(cls, tz=None):
        return cls(2020, 1, 1, tzinfo=tz)


def still(*_):
    return 1_577_836_800.0


fakes = {id(time.time): still, id(time.monotonic): still, id(real): Frozen}
for module in list(sys.modules.values()):
    for name, each in list(vars(module).items()):
        if id(each) in fakes:
            setattr(module, name, fakes[id(each)])


@pytest.mark.requirement("T-010")
def test_in_2020(check):
    assert datetime.datetime.now().year == 2020
    assert time.time() == 1_577_836_800.0
    check("T-010", "ratio", 1.0)
"""


def test_a_plan_that_freezes_time_is_told_and_stamped_by_the_clock_on_the_wall(tmp_path):
    """Stamps of 2020 in a journal of another year, judged PASS, and a verification that found nothing wrong."""
    before = wall.stamp()
    workspace = make(tmp_path / "workspace", FREEZES)
    ended = finish(workspace.start_run())
    (folder,) = workspace.folders()
    results = results_as_json(Package(folder))
    (case,) = results["cases"]
    assert (ended.code, case["verdict"]) == (1, "ERROR"), ended.err
    told = (
        "the case ran with replaced clocks: time.time, time.monotonic, datetime.datetime; leave the clocks of the"
        " process as they are; what the case may know of time is its fixture clock"
    )
    assert told in case["reasons"]
    (item, *_) = results["requirements"]
    assert (item["verdict"], item["eligible"]) == ("ERROR", False)
    lines = read_journal(folder / JOURNAL).lines
    assert all(before.utc <= str(line.wall["utc"]) for line in lines)
    assert all(before.boot <= float(line.wall["boot"]) <= wall.stamp().boot for line in lines)
    assert any(SUPERVISOR in line.wall for line in lines)
    assert clock_doubts(lines) == ()
    assert verify(folder).findings == ()
