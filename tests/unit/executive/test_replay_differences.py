"""What a replay is compared by."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from typed_events import event_of

from hil.executive.resuming.replaying import differences


def package(detail):
    """Return a package whose bench said this of its safe state."""
    return SimpleNamespace(
        outcome=lambda: SimpleNamespace(cases=(), interrupted=False),
        events=[event_of("safe", output="supply.coil", ok=True, detail=detail)],
        state=SimpleNamespace(ended={}),
    )


@pytest.mark.parametrize(
    ("then", "same"), [("current -0 A", True), ("current -0.1 A", False), ("current x-0 A", False)]
)
def test_zero_is_zero_from_below_too(then, same):
    """Records of earlier versions say minus zero; nothing else that a bench said is taken for the same."""
    told, more = differences(package(then), package("current 0 A"))
    assert (told == (), more) == (same, 0)
