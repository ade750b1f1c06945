"""A battery test on a served bench whose executive is killed twice: it comes to what nobody disturbed comes to."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from live_cycling import CYCLES, cycling
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.soak, pytest.mark.timeout(900)]

ROW_BYTES = 8
OF_A_LINE = {"charge_time [s]": 10.0, "discharge_time [s]": 10.0, "charge_capacity [Ah]": 0.0015}
"""What a line more or less of the tester is worth; currents flow up to 0.7 A, a line comes every 5 s."""

GAPS = {"EPS-DEG-003", "EPS-DEG-004", "EPS-DEG-005"}
"""What asks for a record without a gap."""


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return the package of a run that nobody disturbed, and that of one killed twice, with its rows at each kill."""
    root = tmp_path_factory.mktemp("r")
    with cycling(root / "whole", root / "a") as whole, cycling(root / "killed", root / "b") as run:
        kept = []
        for turn, phase in ((2, "charge"), (3, "discharge")):
            run.wait_for(turn, phase)
            kept.append(run.kill())
            assert run.bench.on() == set()
            run.resume()
        ended = run.ended()
        assert ended.code == 1, ended.out
        assert whole.ended().code == 0
    return Package(whole.folder), Package(run.folder), kept


def table(package, name):
    """Return an artifact of the case as rows by column."""
    return list(csv.DictReader(package.text(f"data/attachments/test_degradation-{name}.csv").splitlines()))


def checks(package):
    """Return the check of every requirement, parameter and axis."""
    (case,) = results_as_json(package)["cases"]
    return {(each["requirement"], each["parameter"], each["of"]): each for each in case["checks"]}


def test_no_row_is_lost(runs):
    """What was in the row file right after each kill is in the package, byte by byte and in its place."""
    _, package, kept = runs
    found = package.recording("001-test_degradation-test")
    rows = np.column_stack([found.time, *found.arrays.values()])
    assert len(kept[0]) < len(kept[1]) < rows.nbytes
    for before in kept:
        written = before.partition(b"\n")[2]  # after the header
        whole = len(written) - len(written) % (ROW_BYTES * rows.shape[1])
        assert whole > 0
        assert rows.tobytes()[:whole] == written[:whole]
    assert verify(package.folder).findings == ()


def test_the_interrupted_cycles_are_void_for_the_fade(runs):
    """Each is made again after one that empties the cell, and no number comes from what was broken off."""
    undisturbed, package, _ = runs
    starts = [(row["cycle"], row["emptied_before"]) for row in table(package, "starts")]
    assert starts == [("1", "no"), ("2", "yes"), ("3", "yes")]
    rows = table(package, "cycles")
    assert [row["cycle"] for row in rows] == [str(number) for number in range(1, CYCLES + 1)]
    void = [each for event in bodies(package, "resumed") for each in event["entry"]["rows"]]
    own = [each for each in void if each["recording"] == "001-test_degradation-test"]
    assert len(own) == 2
    assert all(each["end"] > each["first"] for each in own)
    for row, was in zip(rows, table(undisturbed, "cycles"), strict=True):
        for column, limit in OF_A_LINE.items():
            aged = 0.04 * float(was[column])  # the two cycles that emptied it, and what was broken off, age a cell, too
            assert float(row[column]) == pytest.approx(float(was[column]), abs=limit + aged), (row["cycle"], column)


def test_results_agree_within_their_uncertainties(runs):
    """Only the gaps that the kills left keep requirements from their verdict."""
    undisturbed, package, _ = runs
    before, after = checks(undisturbed), checks(package)
    assert {key[1] for key in after.keys() - before.keys()} == {"stopped"}
    compared = 0
    for key, was in before.items():
        now = after[key]
        assert now["verdict"] == was["verdict"] or key[0] in GAPS, key
        if was["uncertainty"]:
            compared += 1
            both = 2 * float(np.hypot(was["uncertainty"], now["uncertainty"]))
            assert abs(now["value"] - was["value"]) <= both, key
    assert compared >= 9
    (case,) = results_as_json(package)["cases"]
    assert {name for name, verdict in case["requirements"].items() if verdict == "INCONCLUSIVE"} == GAPS


def test_the_package_tells_who_looked_and_replays(runs):
    """Acknowledgements, gaps, and what was confirmed at each arming are told; the bytes come to the same again."""
    undisturbed, package, _ = runs
    assert [event["by"] for event in bodies(package, "acknowledged")] == ["Ada", "Ada"]
    assert [event["number"] for event in bodies(package, "resumed")] == [1, 2]
    confirmed = [(event["name"], event["value"], event["by"]) for event in bodies(package, "confirmed")]
    assert confirmed == [("cell-connected", True, "Ada"), ("thermistor-taped", True, "Ada")] * 2
    assert replay(undisturbed).differences == ()
    assert replay(package).differences == ()
