"""What evidence costs where it is written: a row of a recording, a line of the journal."""

from __future__ import annotations

from hil.evidence.journal import Journal
from hil.evidence.rows import Rows

ROW = (1.25, 10.0, -20.5, 48.25, 21.0)
EFFECT = {
    "case": "test_polarity[x]", "step": "1.2", "name": "supply.coil.configure", "ordinal": 3, "effect": "drives",
    "arguments": [5.0, 0.5], "result": {"value": 1.2345, "unit": "V", "uncertainty": 0.001, "dof": None},
}  # fmt: skip


def test_a_row_costs_three_microseconds_at_most(benchmark, tmp_path):
    """One sample of four channels, hashing and writing included."""
    rows = Rows(
        tmp_path / "a.rows",
        recording="1",
        channels=[(name, "uT") for name in "xyzt"],
        on_block=print,
    )

    def thousand():
        for _ in range(1000):
            rows.append(ROW)

    benchmark.pedantic(thousand, rounds=50, warmup_rounds=1)
    rows.finish()
    assert benchmark.stats.stats.min / 1000 < 3e-6


def test_a_line_costs_sixty_microseconds_at_most(benchmark, tmp_path):
    """One effect, stamped, chained, and out of the process."""
    with Journal(tmp_path / "journal.jsonl") as journal:
        benchmark.pedantic(lambda: journal.write("effect", 1.5, **EFFECT), rounds=2000, warmup_rounds=10)
    assert benchmark.stats.stats.min < 60e-6
