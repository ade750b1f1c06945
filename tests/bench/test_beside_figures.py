"""What a recording beside a case costs: one turn of a stream that sends one row after the other, for weeks."""

from __future__ import annotations

import numpy as np
import pytest
from case_parts import limit, monitor, scheduler
from cell_stream import adopt, beside

ROWS = 5_000
BLOCK = np.array([[0.0, 3.7]])


class Ready:
    """A stream that has its next row at once."""

    longest_pause = 5.0

    def __init__(self, role) -> None:
        self.channels, self.sample, self.begin, self.end = role.channels, role.sample, role.begin, role.end
        self._turn = 0

    def drain(self):
        """Return the next row."""
        self._turn += 1
        BLOCK[0, 0] = self._turn * 5.0
        return BLOCK


@pytest.mark.parametrize(("fed", "others"), [(0, 0), (3, 0), (3, 5)])
def test_a_turn_beside_the_case(cost, tmp_path, fed, others):
    """Time passes, one row is fetched, stored and judged by the limits that it feeds; others are read once a minute."""
    case, role, facade = beside(tmp_path)
    facade.__dict__["_role"] = Ready(role)
    specs = [limit(f"fed{number}", output="cycler", period=30.0, max_age=60.0) for number in range(fed)]
    specs += [limit(f"other{number}", period=60.0, max_age=300.0) for number in range(others)]
    monitors = [monitor(case.clock, spec, takes=0.0) for spec in specs]
    adopt(case, scheduler(case.clock, *monitors, flags=case.flags, watch=case.watch))
    case.scheduler.deadline_ns = 2**62
    what = f"turn beside the case, {fed} limits fed, {others} read"
    with case.run.record.during("test", facade, rate=0.2) as test:
        cost(what, lambda: case.scheduler.sleep(5.0 * ROWS), units=ROWS, rounds=4)
    assert len(test.recording) >= ROWS
    assert len(case.watch.feeds) == fed
