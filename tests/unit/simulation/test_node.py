"""An electrical node: source, wires, what always hangs there, and a load."""

from __future__ import annotations

from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.simulation.plants.node import OFF, Load, Source, operating_point

AMOUNTS = st.floats(0.01, 100.0)


@pytest.mark.parametrize(
    ("source", "load", "shunt", "expected"),
    [
        (Source(5.0), OFF, inf, (5.0, 0.0, 0.0)),
        (Source(5.0, 1.0, 0.5), OFF, 9.5, (4.75, 0.5, 0.0)),
        (Source(12.0, 0.05), OFF, 100.0, (5.0, 0.05, 0.0)),
        (Source(12.0, 5.0, 0.1), Load("CC", 2.0), inf, (11.8, 2.0, 2.0)),
        (Source(12.0, 5.0, 0.1), Load("CC", 2.0), 118.0, (11.79, 2.0999, 2.0)),
        (Source(12.0, 1.0, 0.1), Load("CC", 2.0), inf, (0.05, 1.0, 1.0)),
        (Source(12.0, 5.0, 0.1), Load("CR", 5.9), inf, (11.8, 2.0, 2.0)),
        (Source(12.0, 5.0, 0.1), Load("CP", 23.6), inf, (11.8, 2.0, 2.0)),
        (Source(12.0, 5.0), Load("CP", 24.0), inf, (12.0, 2.0, 2.0)),
        (Source(12.0, 1.0, 0.1), Load("CP", 8.0), inf, (11.9329, 0.6704, 0.6704)),
        (Source(12.0, 1.0), Load("CP", 24.0), inf, (0.05, 1.0, 1.0)),
        (Source(12.0, 5.0, 0.1), Load("CV", 11.85), inf, (11.9, 1.0, 1.0)),
        (Source(12.0, 2.0, 0.1), Load("CV", 5.0), inf, (5.1, 2.0, 2.0)),
        (Source(12.0, 5.0, 0.1), Load("CV", 13.0), inf, (12.0, 0.0, 0.0)),
        (Source(0.0, 5.0), Load("CC", 1.0), 10.0, (0.0, 0.0, 0.0)),
        (Source(12.0, 0.0), Load("CC", 1.0), 10.0, (0.0, 0.0, 0.0)),
    ],
)
def test_known_points(source, load, shunt, expected):
    """By hand: voltage of the node, current of the source, current of the load."""
    assert operating_point(source, load, shunt) == pytest.approx(expected, abs=2e-3)


@given(
    volts=AMOUNTS, limit=AMOUNTS, ohms=st.just(0.0) | st.floats(1e-4, 2.0), shunt=st.floats(1.0, 1e6), level=AMOUNTS,
    mode=st.sampled_from(("", "CC", "CR", "CP", "CV")),
)  # fmt: skip
def test_every_point_is_one(volts, limit, ohms, shunt, level, mode):
    """Kirchhoff's laws hold, the source gives no more than it can, and the load takes what it wants or is wide open."""
    load = Load(mode, level)
    node, amperes, drawn = operating_point(Source(volts, limit, ohms), load, shunt)
    assert 0.0 <= node <= volts * (1 + 1e-9)
    assert amperes <= limit * (1 + 1e-9)
    assert amperes == pytest.approx(drawn + node / shunt, rel=1e-6, abs=1e-9)
    limiting = amperes >= limit * (1 - 1e-9)
    assert limiting or node == pytest.approx(volts - amperes * ohms, rel=1e-6, abs=1e-6)
    wide_open = node / load.least_ohms
    wanted = {"": 0.0, "CC": level, "CR": node / level, "CP": level / node, "CV": (node - level) / load.least_ohms}[
        mode
    ]
    assert drawn == pytest.approx(max(0.0, min(wanted, wide_open)), rel=1e-4, abs=1e-6)
