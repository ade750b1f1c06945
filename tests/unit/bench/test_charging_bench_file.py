"""A supply that charges a battery in a bench file: it must not be able to charge it too high."""

from __future__ import annotations

import shutil

import pytest
from workspaces import ROOT

from hil.bench.binding import check_twin
from hil.bench.file.reading import load_bench
from hil.model.errors import ConfigurationError

FILE = "fixtures/benches/battery/bench.yaml"
KORAD = {
    "driver: rigol-dp832": "driver: korad-ka3005p",
    'settings: {over_voltage: "4.25", over_current: "0.8"}': "settings: {}",
}
SIGLENT = KORAD | {"driver: rigol-dp832": "driver: siglent-spd3303x"}
GUARD = """\
- {id: cell-voltage, output: cycler, quantity: voltage, unit: V, min: "2.5", max: "4.25",
   period: 60 s, max_age: 180 s, debounce: "2"}
"""


def found(root, changes):
    """Return what is said of the committed bench with some texts changed."""
    shutil.copytree(ROOT / "fixtures", root / "fixtures")
    file = root / FILE
    text = file.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    try:
        load_bench(root / "fixtures/benches", "battery", root, twin=check_twin)
    except ConfigurationError as error:
        return [str(finding) for finding in error.findings]
    return []


def test_the_committed_bench_is_clean(tmp_path):
    """File and twin of the battery bench are as they must be."""
    assert found(tmp_path, {}) == []


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({" charges: cycler,": ""}, "cycler: no supply charges its battery; write 'charges: cycler'"),
        ({"charges: cycler": "charges: cyclor"}, "unknown cycler 'cyclor', did you mean 'cycler'?"),
        ({'over_voltage: "4.25", ': ""}, "supply.charge charges a battery: give it the setting over_voltage"),
        (
            KORAD | {GUARD: ""},
            "a korad-ka3005p has no over-voltage protection with a level of its own: add a second guard, a limit",
        ),
        (
            SIGLENT | {GUARD: ""},
            "a siglent-spd3303x has no over-voltage protection with a level of its own: add a second guard, a limit",
        ),
        (KORAD | {', max: "4.25",': ","}, "add a second guard, a limit of the envelope with max"),
        ({"- {role: thermal, ": "- {role: thermal, charges: cycler, "}, "thermal cannot charge: only a supply can"),
    ],
)
def test_what_must_be_said_of_it(tmp_path, changes, message):
    """Without charger, protection or second guard the bench is refused, at the wire's line."""
    told = found(tmp_path, changes)
    assert any(message in line and f"{FILE}:" in line for line in told), told


def test_the_envelope_is_guard_enough_for_a_supply_without_a_level(tmp_path):
    """With the cycler's voltage in the envelope nothing is said of the supply's protection."""
    assert not any("second guard" in line or "over_voltage" in line for line in found(tmp_path, KORAD))
