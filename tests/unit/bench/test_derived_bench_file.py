"""Limits on derived quantities in a bench file: what is wrong with one is told at its line, with what was meant."""

from __future__ import annotations

import re
import shutil

import pytest
from workspaces import ROOT

from hil.bench.file.reading import load_bench
from hil.bench.self_test import self_test
from hil.model.errors import ConfigurationError

FILE = "fixtures/benches/battery/bench.yaml"
CHARGED = (
    "{id: charged, output: cycler, quantity: charge, while: charging, since: phase, "
    'threshold: "0.02", unit: A.h, max: "2.6",\n   period: 60 s, max_age: 180 s}'
)
TIMING = "period: 60 s, max_age: 180 s}"


def load(root, changes):
    """Return the committed bench with some texts changed, each of which is there once."""
    shutil.copytree(ROOT / "fixtures", root / "fixtures")
    file = root / FILE
    text = file.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    return load_bench(root / "fixtures/benches", "battery", root)


def test_the_committed_limits_are_read(tmp_path):
    """Every kind of them is there, and each one trips as it must."""
    spec = load(tmp_path, {})
    derived = {limit.id: limit for limit in spec.envelope if limit.is_derived}
    assert {limit.quantity for limit in derived.values()} == {
        "charge",
        "energy",
        "duration",
        "slope",
        "temperature",
        "unchanged",
        "voltage",
    }
    assert derived["charged"].words == "charge while charging"
    assert derived["cell-against-charger"].words == "voltage against supply.charge while charging"
    assert spec.head.dew_point == 4.0
    assert all(self_test(limit) for limit in spec.envelope)


WRONG = [
    # Keys: unknown, missing, too many, not together.
    (
        'threshold: "0.02", unit: A.h',
        'treshold: "0.02", unit: A.h',
        "unknown key 'treshold', did you mean 'threshold'?",
    ),
    ('threshold: "0.02", unit: A.h', "unit: A.h", "charged: charge needs 'threshold'"),
    ("while: charging, since: phase", "while: charging", "charged: charge needs 'since'"),
    ("since: phase", "since: phase, over: 60 s", "charged: charge takes no 'over'"),
    ("since: phase", "since: phase, of: current", "charged: charge takes no 'of'"),
    ("while: charging, since", "while: chargng, since", "'while' must be one of"),
    ("since: phase", "since: phases", "'since' must be one of"),
    ("while: charging", "while: flowing", "charged: charge adds up in one direction: while is charging or discharging"),
    ("quantity: charge, while", "quantity: chrage, while", "unknown quantity 'chrage', did you mean 'charge'?"),
    ("quantity: charge, while: charging, since: phase", "quantity: voltage, since: phase", "takes no 'since'"),
    ("quantity: charge, while: charging, since: phase", "quantity: voltage", "'while' and 'threshold' belong together"),
    ("quantity: charge, while: charging, since: phase", "quantity: current, while: charging", "condition of its own"),
    # What it is made of.
    ("output: cycler", "output: thermal", "charged: thermal has no current, of which this is made"),
    ("output: cycler", "output: cyclor", "unknown output 'cyclor', did you mean 'cycler'?"),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        "slope, of: temperatur, over: 60 s, unit: K/min",
        "unknown quantity 'temperatur', did you mean 'temperature'?",
    ),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        "voltage, against: supply.charg, unit: V",
        "unknown output 'supply.charg', did you mean 'supply.charge'?",
    ),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        "voltage, against: thermal, unit: V",
        "thermal has no voltage",
    ),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        "voltage, against: cycler, unit: V",
        "cycler cannot be held against itself",
    ),
    # Units and numbers.
    ("unit: A.h", "unit: A", "charge is given in A.h or mA.h here, not in 'A'"),
    ("unit: A.h", "unit: Ah", "not in 'Ah', did you mean 'A.h'?"),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        "slope, of: temperature, over: 60 s, unit: degC/min",
        "slope of temperature is given in K/s, K/min or K/h here, not in 'degC/min'",
    ),
    ('threshold: "0.02"', 'threshold: "0"', "'threshold' must be above 0"),
    ('max: "2.6"', 'min: "0", max: "2.6"', "charge begins at zero, it takes no min"),
    ('max: "2.6"', 'max: "0"', "the max of charge must be above zero"),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h, max',
        "slope, of: temperature, over: 60 s, unit: K/min, min",
        "what does not change has a slope of zero",
    ),
    (
        'charge, while: charging, since: phase, threshold: "0.02", unit: A.h',
        'unchanged, of: temperature, band: "-1", unit: h',
        "'band' must be at least 0",
    ),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG)
def test_what_is_wrong_is_told_at_its_line(tmp_path, old, new, message):
    """File, line and column of the limit, and what it should be."""
    assert CHARGED.count(old) == 1, old
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path, {CHARGED: CHARGED.replace(old, new)})
    told = [str(finding) for finding in caught.value.findings]
    assert any(message in line and re.match(rf"{FILE}:\d+:\d+: ", line) for line in told), told


AIR = [
    ({'dew_point: "4"': 'dew_point: "7.5"'}, "thermal: its clamp allows 5 degC, below the dew point 7.5 degC"),
    (
        {'dew_point: "4"': 'dew_point: "7.5"'},
        "the envelope needs a limit on its temperature, with min at the dew point",
    ),
    (
        {'unit: degC, min: "4", max: "55"': 'unit: degC, min: "3.9", max: "55"'},
        "the envelope needs a limit on its temp",
    ),
    ({'unit: degC, min: "4", max: "55"': 'unit: degC, max: "55"'}, "the envelope needs a limit on its temp"),
]


@pytest.mark.parametrize(("changes", "message"), AIR)
def test_nothing_is_cooled_below_the_dew_point(tmp_path, changes, message):
    """Neither a setpoint nor a plate may be below it where the bench declares it."""
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path, changes)
    assert any(message in str(finding) for finding in caught.value.findings), caught.value.findings


def test_a_bench_that_declares_no_dew_point_may_be_cooled(tmp_path):
    """Nobody knows better."""
    assert (
        load(tmp_path, {'  dew_point: "4"\n': "", 'min: "5", max: "45"}': 'min: "-5", max: "45"}'}).head.dew_point
        is None
    )
