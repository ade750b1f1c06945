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
    assert "charge Ah   1.706483       1.706529  1.706530    -4.7e-07  -2.7e-07\n" in text
    assert "energy Wh   6.848359       6.848537  6.848547    -1.1e-05  -1.5e-06\n" in text
    told = "1 switch between rest and current as the instrument counted: 0.000135 Ah (samples alone: ± 5.1e-05 Ah)"
    assert told in " ".join(text.split())
    assert all(len(line) <= 80 for line in text.splitlines()[1:])
    assert "\n1      charge  1.70653  6.84854  4.0131" in text
    assert "rest to charge: 0.01844 ohm within 1.28 s" in text
    assert "equivalent full cycles: 0.1707 of 5 Ah" in text
    assert "incomplete cycle" in text
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
    assert "implausible; check the unit of the time (--time-unit)" in wrong
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
    assert "note: 1 row without a time, voltage, current or cycle is left out" in text
    assert "note: the current never rises above rest" in text
    assert "no fade: 0 of 0 cycles complete" in text


def test_impossible_options_are_refused(table):
    """A range that is none, and rows without time between them."""
    with pytest.raises(Refused, match="--mean-voltage 3 is not a range"):
        run(table, *COLUMNS, "--mean-voltage", "3")
    with pytest.raises(Refused, match="--interval 0 is not possible"):
        run(table, "--interval", "0")


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--skip", "-1"), "--skip -1 is not possible"),
        (("--counted", "0"), "--counted 0 is not possible"),
        (("--remaining", "2"), "--remaining 2 is not possible"),
        (("--upper", "2", "--lower", "4"), "--upper 2 and --lower 4 do not form a range"),
        (("--mean-voltage", "3.95,3.4"), "--mean-voltage 3.95,3.4 is not a range"),
        (("--capacity", "0"), "--capacity 0 is not possible"),
        (("--capacity", "-1.4"), "--capacity -1.4 is not possible"),
        (("--energy", "nan"), "--energy nan is not possible"),
        (("--cut-off", "-0.05"), "--cut-off -0.05 is not possible"),
        (("--rest-current", "0"), "--rest-current 0 is not possible"),
    ],
)
def test_nonsense_is_refused(table, options, told):
    """What no test of a cell can have is named, with what to give."""
    with pytest.raises(Refused, match=told):
        run(table, *COLUMNS, *options)


@pytest.mark.parametrize("text", ["", "\n\n\n"])
@pytest.mark.parametrize("columns", [(), COLUMNS])
def test_an_empty_file_is_told_to_be_empty(tmp_path, text, columns):
    """No column can be named in it."""
    path = tmp_path / "e.log"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(Refused, match=r"e\.log: the file is empty"):
        run(str(path), *columns)


def test_rows_of_a_cycler_without_its_banner_name_the_format(tmp_path):
    """A log that begins after the banner, with points or commas; both ways are named."""
    path = tmp_path / "n.log"
    for mark in ".,":
        path.write_text("\n".join(cycler_rows(1)).replace(".", mark), encoding="utf-8")
        with pytest.raises(Refused, match=r"n\.log: which columns") as caught:
            run(str(path))
        assert "--format cycler" in caught.value.hint


def test_refusals_of_the_samples_name_the_file(tmp_path):
    """Too few, and a time that goes back, with singular and plural right."""
    path = tmp_path / "few.csv"
    for text, told in (
        ("0,3.7,0.7\n", "1 whole sample is too few"),
        ("0,3.7,0.7\n5,3.7,0.7\n", "2 whole samples are too few"),
        ("0,3.7,0.7\n5,3.7,0.7\n4,3.7,0.7\n", "the time, column t, goes back once, first at row 3, from 5 to 4"),
        ("5,3.7,0.7\n4,3.7,0.7\n3,3.7,0.7\n", "the time, column t, goes back 2 times, first at row 2, from 5 to 4"),
    ):
        path.write_text("t,U,I\n" + text, encoding="utf-8")
        with pytest.raises(Refused, match=rf"few\.csv: {told}"):
            run(str(path), *COLUMNS)


def test_a_time_of_the_clock_is_read(tmp_path):
    """hh:mm:ss counts seconds."""
    path = tmp_path / "c.csv"
    path.write_text("t,U,I\n" + "".join(f"00:00:{n:02d},3.7,0.7\n" for n in range(9)), encoding="utf-8")
    assert "9 rows, 0.002222 h" in run(str(path), *COLUMNS).stdout


@pytest.mark.system
def test_the_plot_is_the_same_bytes_twice(table, tmp_path):
    """Four parts drawn, without dates or random names."""
    for name in ("a.svg", "b.svg"):
        run(table, *COLUMNS, "--time-unit", "h", "--discharge-positive", "--plot", str(tmp_path / name))
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


HEADER = "=~=~= PuTTY log 2025.03.12 09:11:02 =~=~="


def cycler_rows(count, *, fade=0.01, interval=10.0):
    """Rows of a cycler and its marks, the energy of each half-cycle from zero."""
    _, voltage, current = cell.campaign(count, interval, fade=fade)
    lines, number, energy = [], 0, 0.0
    before = -1.0
    for v, i in zip(voltage, current, strict=True):
        if i > 0 and before <= 0:
            number += 1
            lines.append(f"TEST ITERATION {number}")
        energy = 0.0 if i == 0 or i * before < 0 else energy + abs(v * i) * interval / 3600.0
        lines.append(f"{v:.4f};{i:.4f};{energy:.5f};25.0")
        before = i
    return lines


def analyse(tmp_path, lines, *arguments):
    """Analyse a cycler's log of these lines as a program does."""
    path = tmp_path / "putty.log"
    path.write_text("\n".join([HEADER, "START ARDUINO", *lines, "TEST END", ""]), encoding="ascii")
    return json.loads(run(str(path), "--interval", "10", "--json", *arguments).stdout)


def ok(document):
    """The answers of the gates by name."""
    return {gate["name"]: gate["ok"] for gate in document["gates"]}


def against(document, name):
    """The cycles that a gate speaks against."""
    (cycles,) = [gate["cycles"] for gate in document["gates"] if gate["name"] == name]
    return cycles


def test_a_restart_cuts_a_cycle_and_begins_a_test(tmp_path):
    """A trial that was reset in its first discharge: not whole, in no fade, and its cycle not that of the test."""
    lines = cycler_rows(4)
    cut = [place for place, line in enumerate(lines) if ";-0.7" in line][60]
    alone = analyse(tmp_path, lines)
    assert ok(alone)["one_stretch"] is True
    for again in (["START ARDUINO"], [HEADER, "START ARDUINO"], []):
        found = analyse(tmp_path, [*lines[:cut], *again, *lines])
        assert [each["number"] for each in found["cycles"]] == [1, 2, 3, 4, 5]
        assert [each["complete"] for each in found["cycles"]] == [False, True, True, True, True]
        assert found["cycles"][1]["charge"]["charge"] == pytest.approx(alone["cycles"][0]["charge"]["charge"], rel=5e-3)
        capacity = "discharge_capacity"
        assert found["fade"][capacity]["slope"]["value"] == pytest.approx(alone["fade"][capacity]["slope"]["value"])
        assert ok(found)["one_stretch"] is False
        assert any("2 tests in the log" in remark for remark in found["remarks"])


def test_rows_that_a_closed_terminal_missed_are_doubted(tmp_path):
    """From the first discharge into the second charge nothing was logged: two cycles are not whole, and it is told."""
    lines = cycler_rows(5)
    first = [place for place, line in enumerate(lines) if ";-0.7" in line][60]
    second = lines.index("TEST ITERATION 2") + 100
    found = analyse(tmp_path, [*lines[:first], HEADER, *lines[second:]])
    assert [(each["number"], each["complete"]) for each in found["cycles"]] == [
        (1, False), (2, False), (3, True), (4, True), (5, True),
    ]  # fmt: skip
    assert ok(found)["one_stretch"] is False


def test_two_tests_with_the_same_numbers_share_none(tmp_path):
    """The cycles of the second test go on after those of the first, and the pause is doubted."""
    found = analyse(tmp_path, [*cycler_rows(3), "TEST END", HEADER, "START ARDUINO", *cycler_rows(3, fade=0.02)])
    assert [each["number"] for each in found["cycles"]] == [1, 2, 3, 4, 5, 6]
    assert all(each["complete"] for each in found["cycles"])
    assert ok(found)["one_stretch"] is False


def test_one_cycle_with_an_impossible_efficiency_is_doubted(tmp_path):
    """The median of five is sound, but half of one charge was not logged."""
    lines = cycler_rows(5, fade=0.0)
    place = lines.index("TEST ITERATION 3")
    found = analyse(tmp_path, [*lines[: place + 1], *lines[place + 120 :]])
    assert ok(found)["coulombic_efficiency"] is True
    assert ok(found)["single_coulombic_efficiency"] is False
    assert against(found, "single_coulombic_efficiency") == [3]


def test_a_column_of_cycles_that_never_changes_is_doubted(tmp_path):
    """Three cycles are taken for one, which the medians of one cycle do not show; counted, they pass."""
    time, voltage, current = cell.campaign(3, 30.0, fade=0.01)
    counted = 1 + np.cumsum(np.diff(current > 0, prepend=False) & (current > 0)) - 1
    path = tmp_path / "numbered.csv"
    for cycle, passed in ((np.ones(time.size), False), (counted, True)):
        rows = np.column_stack((time, voltage, current, cycle))
        np.savetxt(path, rows, delimiter=",", header="t,U,I,cycle", comments="", fmt="%.8f")
        found = json.loads(run(str(path), *COLUMNS, "--cycle", "cycle", "--json").stdout)
        assert ok(found)["one_alternation"] is passed
        assert against(found, "one_alternation") == ([] if passed else [1])
    without = json.loads(run(str(path), *COLUMNS, "--json").stdout)
    assert ok(without)["one_alternation"] is None


def spoilt(lines, place, column, value):
    """The lines with one cell of one row changed."""
    cells = lines[place].split(";")
    cells[column] = value
    return [*lines[:place], ";".join(cells), *lines[place + 1 :]]


@pytest.mark.parametrize(
    ("column", "value", "told"),
    [
        (0, "3.900", "voltage 3.9 V at 1990 s"),
        (1, "7.7000", "current 7.7 A at 1990 s"),
        (3, "60", "temperature 60 degC"),
    ],
)
def test_a_single_row_that_stands_out_is_doubted(tmp_path, column, value, told):
    """A changed digit that no limit shows is found between its neighbours."""
    found = analyse(tmp_path, spoilt(cycler_rows(2), 200, column, value))
    (gate,) = [gate for gate in found["gates"] if gate["name"] == "stray_rows" and gate["ok"] is False]
    assert f"1 row stands out from both neighbours; {told}" in gate["reason"]
    assert gate["cycles"] == [1]
    assert ok(analyse(tmp_path, cycler_rows(2)))["stray_rows"] is True


def test_the_last_digit_of_a_current_in_a_rest_is_no_stray_row(tmp_path):
    """A milliampere that comes and goes where nothing flows speaks against no cycle."""
    lines = cycler_rows(2)
    end = lines[-1].split(";")
    rest = [";".join([end[0], "0.0010" if number % 25 == 10 else "0.0000", "0.00000", "25.0"]) for number in range(200)]
    assert ok(analyse(tmp_path, lines + rest))["stray_rows"] is True


@pytest.mark.parametrize("value", ["-273", "151.0"])
def test_a_temperature_that_cannot_be_is_told_and_not_counted(tmp_path, value):
    """An open sensor gives no lowest or highest temperature of a cell."""
    found = analyse(tmp_path, spoilt(cycler_rows(2), 200, 3, value))
    charge = found["cycles"][0]["charge"]
    assert (charge["temperature_low"], charge["temperature_high"]) == (25.0, 25.0)
    assert ok(found)["temperature"] is False
    assert against(found, "temperature") == [1]
    assert ok(found)["stray_rows"] is True


def test_another_energy_than_the_cyclers_own_is_doubted(tmp_path):
    """A current with a gain of 1.05 in the rows, beside an energy that was counted with the true one."""
    lines = cycler_rows(2)
    assert ok(analyse(tmp_path, lines))["own_energy"] is True
    wrong = [";".join([v, f"{float(i) * 1.05:.4f}", e, t]) for v, i, e, t in (x.split(";") for x in lines if ";" in x)]
    found = analyse(tmp_path, wrong)
    assert ok(found)["own_energy"] is False
    (reason,) = [gate["reason"] for gate in found["gates"] if gate["name"] == "own_energy"]
    assert "charge 1 +5." in reason
    assert against(found, "own_energy") == [1, 2]


def test_a_current_in_ma_is_doubted(tmp_path):
    """Seven hundred amperes are no cell's; with a nominal capacity the ratio tells it."""
    lines = [
        ";".join([v, f"{float(i) * 1e3:.1f}", e, t])
        for v, i, e, t in (x.split(";") for x in cycler_rows(2) if ";" in x)
    ]
    reasons = {gate["name"]: gate["reason"] for gate in analyse(tmp_path, lines)["gates"] if gate["ok"] is False}
    assert "give --current-unit mA" in reasons["current_unit"]
    found = analyse(tmp_path, lines, "--capacity", "1.4")
    reasons = {gate["name"]: gate["reason"] for gate in found["gates"] if gate["ok"] is False}
    assert "give --current-unit mA" in reasons["capacity_ratio"]


def test_a_wrong_sign_of_the_current_is_doubted(table):
    """A charge below its discharge: the option that turns the sign is named."""
    gates = json.loads(run(table, *COLUMNS, "--time-unit", "h", "--json").stdout)["gates"]
    (reason,) = [gate["reason"] for gate in gates if gate["name"] == "current_sign" and gate["ok"] is False]
    assert "--discharge-positive" in reason


def test_a_turned_current_turns_the_own_sums_as_well(tmp_path):
    """What the cycler counted itself is held against samples of the same sign."""
    lines = cycler_rows(2)
    turned = [line.replace(";", ";-", 1).replace(";--", ";") for line in lines]
    found, expected = analyse(tmp_path, turned, "--discharge-positive"), analyse(tmp_path, lines)
    assert found["own"]["energy_Wh"] == pytest.approx(expected["own"]["energy_Wh"])
    assert found["apart"]["energy_Wh"] == pytest.approx(expected["apart"]["energy_Wh"], abs=1e-9)


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
