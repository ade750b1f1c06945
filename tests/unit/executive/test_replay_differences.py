"""What a replay is compared by."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from typed_events import event_of

from hil.executive.resuming.replaying import differences


def package(detail, *gates):
    """Return a package whose bench said this of its safe state, and passed these gates."""
    passed = [event_of("gate", name=name, ok=ok, detail=said) for name, ok, said in gates]
    return SimpleNamespace(
        outcome=lambda: SimpleNamespace(cases=(), interrupted=False),
        cut_short=False,
        events=[*passed, event_of("safe", output="supply.coil", ok=True, detail=detail)],
        state=SimpleNamespace(ended={}),
    )


@pytest.mark.parametrize(
    ("then", "same"), [("current -0 A", True), ("current -0.1 A", False), ("current x-0 A", False)]
)
def test_zero_is_zero_from_below_too(then, same):
    """Records of earlier versions say minus zero; nothing else that a bench said is taken for the same."""
    told, more, *_ = differences(package(then), package("current 0 A"))
    assert (told == (), more) == (same, 0)


@pytest.mark.parametrize(
    ("gates", "same"),
    [
        ([("envelope a", True, "trips as it must"), ("identity", True, "E36312A at 1.5 V")], True),
        (
            [("new", True, "a gate of this version"), ("envelope a", True, "x"), ("identity", True, "E36312A, 1.5 V")],
            True,
        ),
        ([("envelope a", False, "trips as it should"), ("identity", True, "E36312A at 1.5 V")], False),
        ([("envelope a", True, "trips as it should"), ("identity", True, "E36312A at 1.6 V")], False),
        ([("identity", True, "E36312A at 1.5 V")], False),
    ],
)
def test_other_words_are_not_another_bench(gates, same):
    """A later version words its gates otherwise, and has more of them; what was read and found is compared."""
    recorded = package("0 A", ("envelope a", True, "trips as it should"), ("identity", True, "E36312A at 1.5 V"))
    told, *_ = differences(recorded, package("0 A", *gates))
    assert (told == ()) == same
