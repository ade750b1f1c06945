"""The command `hil analyse battery`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import Refused
from tests.support import cell

NOVONIX = str(Path(__file__).parents[3] / "docs" / "data" / "battery-novonix.csv")
COLUMNS = ("--time", "t", "--voltage", "U", "--current", "I")


def run(*arguments):
    """Run the command; what it raises is raised here."""
    return CliRunner().invoke(command, ["battery", *arguments], catch_exceptions=False)


@pytest.fixture
def table(tmp_path):
    """Five fading cycles as a table of another make: time in h, current above zero in discharge."""
    time, voltage, current = cell.campaign(5, 30.0, fade=0.01)
    path = tmp_path / "test.csv"
    rows = np.column_stack((time / 3600.0, voltage, -current, np.full(time.size, 25.0)))
    np.savetxt(path, rows, delimiter=";", header="t;U;I;T", comments="", fmt="%.8f")
    return str(path)


def test_a_novonix_file_needs_no_option():
    """Charge and energy beside the cycler's own, and no verdict on what one charge cannot tell."""
    text = run(NOVONIX).stdout
    assert text.startswith(f"{NOVONIX} (novonix): 207 rows, 3.413 h, 1 cycle\n")
    assert "charge Ah       1.706483       1.706529      1.706530      -4.7e-07  -2.7e-07\n" in text
    assert "energy Wh       6.848359       6.848537      6.848547      -1.1e-05  -1.5e-06\n" in text
    assert (
        "1 switch between rest and current as the instrument counted: 0.000135 Ah (samples alone: ± 5.1e-05 Ah)" in text
    )
    assert "1  charge      1.70653   6.84854" in text
    assert "rest to charge: 0.01844 ohm within 1.28 s" in text
    assert "equivalent full cycles: 0.1707 of 5 Ah" in text
    assert "not a whole cycle" in text
    assert "unknown  coulombic_efficiency" in text


def test_a_program_reads_both_sums_and_their_difference():
    """The sums agree with the published counts to five digits; what the count stands for is told apart."""
    document = json.loads(run(NOVONIX, "--json").stdout)
    assert [f"{each:.5g}" for each in document["net"].values()] == ["1.7065", "6.8485"]
    assert document["net"] == pytest.approx({"charge_Ah": 1.70652976, "energy_Wh": 6.84854718}, rel=2e-6)
    assert document["own"] == {"charge_Ah": 1.70652976, "energy_Wh": 6.84854718}
    assert document["apart"]["charge_Ah"] == pytest.approx(-4.7e-7, abs=1e-8)
    assert document["sums"]["charge_Ah"]["counted"] == pytest.approx(0.00013502)
    assert document["sums"]["charge_Ah"]["samples"] == pytest.approx(1.7064832, abs=1e-7)


def test_a_forgotten_time_unit_is_doubted(table):
    """Hours read as seconds: a cell emptied in ten seconds, and samples each few milliseconds, cannot be."""
    wrong = run(table, *COLUMNS, "--discharge-positive").stdout
    assert "DOUBT    time_unit: samples each 0.00833 s; a charge or discharge in" in wrong
    assert "this cannot be; is the unit of the time right (--time-unit)?" in wrong
    right = run(table, *COLUMNS, "--discharge-positive", "--time-unit", "h").stdout
    assert "good     time_unit: samples each 30 s; a charge or discharge in" in right


def test_another_make_needs_a_mapping_only(table):
    """Columns by name, hours, and the other sign: five whole cycles and their fade."""
    document = json.loads(
        run(table, *COLUMNS, "--temperature", "T", "--time-unit", "h", "--discharge-positive", "--capacity", "1.4",
            "--counted", "9", "--json").stdout
    )  # fmt: skip
    assert [each["complete"] for each in document["cycles"]] == [True] * 5
    assert document["cycles"][0]["charge"]["charge"] == pytest.approx(cell.truth()[0], abs=0.01)
    assert document["fade"]["discharge_capacity"]["significant"] is True
    assert document["cycles"][0]["rests"][0]["after"] == "charge"
    gates = {gate["name"]: gate["ok"] for gate in document["gates"]}
    assert gates["elapsed_time"] is False
    assert gates["energy_ratio"] is None
    assert document["equivalent_full_cycles"] == pytest.approx(5.0 * cell.truth(capacity=1.4 * 0.98)[0] / 1.4, rel=0.02)


def test_the_text_tells_fade_and_doubts(table):
    """Slope with interval and end of life, and the gate that the counted cycles trip."""
    text = run(
        table, *COLUMNS, "--time-unit", "h", "--discharge-positive", "--skip", "1", "--counted", "9"
    ).stdout  # fmt: skip
    assert "fade of discharge capacity: -0.01" in text
    assert "Ah/cycle, significant" in text
    assert "DOUBT    elapsed_time" in text
    assert "Ah at cycle" in text


def test_a_table_without_mapping_is_refused(table):
    """Nothing is guessed about columns."""
    with pytest.raises(Refused, match="name them with --time"):
        run(table)


def test_what_is_left_out_or_not_there_is_told(tmp_path):
    """Rows that hold no number, a current that never flows, and cycles too few for a fade."""
    path = tmp_path / "rest.csv"
    path.write_text("t,U,I\n" + "".join(f"{5 * n},{'nan' if n == 2 else 3.7},0\n" for n in range(6)), encoding="utf-8")
    text = run(str(path), *COLUMNS).stdout
    assert "note: 1 rows without a time, voltage or current are left out" in text
    assert "note: the current never leaves rest" in text
    assert "no fade: 0 cycles of 0 whole" in text


def test_impossible_options_are_refused(table):
    """A range that is none, and rows without time between them."""
    with pytest.raises(Refused, match="--mean-voltage 3 is no range"):
        run(table, *COLUMNS, "--mean-voltage", "3")
    with pytest.raises(Refused, match="--interval 0 is not possible"):
        run(table, "--interval", "0")


def test_the_plot_is_the_same_bytes_twice(table, tmp_path):
    """Four parts drawn, without dates or random names."""
    for name in ("a.svg", "b.svg"):
        run(table, *COLUMNS, "--time-unit", "h", "--discharge-positive", "--plot", str(tmp_path / name))
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_a_cyclers_log_is_recognised(tmp_path):
    """The terminal log of two cycles, with the energy it summed up itself beside the trapezoid."""
    time, voltage, current = cell.campaign(2, 5.0)
    energy = np.cumsum(np.abs(voltage * current)) * 5.0 / 3600.0
    lines = ["PuTTY log", "START ARDUINO"]
    lines += [f"{v:.3f};{i:.3f};{e:.4f};25.0" for v, i, e in zip(voltage, current, energy, strict=True)]
    path = tmp_path / "putty.log"
    path.write_text("\n".join([*lines, "TEST END", ""]), encoding="ascii")
    text = run(str(path)).stdout
    assert f"(cycler): {time.size} rows" in text
    assert "2 cycles" in text
    assert "\nenergy Wh  " in text
