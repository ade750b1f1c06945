"""What a bench file with a rotation table must say."""

from __future__ import annotations

import pytest
from rotation_bench import rotation_workspace

from hil.bench.file.reading import load_bench
from hil.model.errors import ConfigurationError

CASE = "def test_nothing(): pass"


def loaded(root, *changes):
    """Return the bench `table` with changes."""
    workspace = rotation_workspace(root / "workspace", CASE, changes=changes)
    return load_bench(workspace.root / "fixtures/benches", "table", workspace.root)


def test_the_bench_of_the_table_is_whole(tmp_path):
    """Rate and turns are quantities of clamps, envelope and proofs."""
    spec = loaded(tmp_path)
    assert {clamp.quantity for clamp in spec.clamps} == {"rate", "turns"}
    assert [limit.quantity for limit in spec.envelope] == ["rate", "turns"]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (
            ('- {output: rotation_table, quantity: turns, unit: turn, min: "-10", max: "10"}\n', ""),
            "rotation_table needs clamps for rate and turns",
        ),
        (('unit: deg/s, min: "-60", max: "60"', 'unit: rpm, min: "-10", max: "10"'), "rate is given in deg/s here"),
        (('unit: deg/s, min: "-60", max: "60"', 'unit: deg/s, min: "-90", max: "60"'), "exceeds the rating 80"),
    ],
)
def test_what_is_missing_is_told(tmp_path, change, match):
    """A table without the bounds of its harness, in another unit, or beyond its rating, is a finding."""
    with pytest.raises(ConfigurationError, match=match):
        loaded(tmp_path, change)
