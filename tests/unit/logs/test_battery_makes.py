"""Battery logs of other makes, each read by the mapping that the page gives, against a cell that is known."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import HilError
from tests.support import cell

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "battery-mappings.md"
EXAMPLES = {
    part.split(maxsplit=1)[0].rstrip(","): found[1]
    for part in PAGE.read_text(encoding="utf-8").split("\n## ")
    if (found := re.search(r"```yaml\n(.*?)```", part, re.DOTALL))
}
TRUTH = cell.truth()[0]


class Test:
    """Two cycles of the cell, and what cyclers write of them: steps, cycles, counters, clocks."""

    __test__ = False

    def __init__(self, count=2, interval=60.0):
        self.time, self.voltage, self.current = cell.campaign(count, interval)
        self.state = np.sign(self.current).astype(int)
        starts = np.append(True, np.diff(self.state) != 0)
        self.step = np.cumsum(starts)
        self.cycle = np.cumsum(starts & (self.state > 0))
        before = np.append(0.0, self.time[:-1])
        self.of_step = self.time - np.maximum.accumulate(np.where(starts, before, 0.0))
        self.charge, self.energy = (
            {way: self.counter(np.clip(way * rate, 0.0, None)) for way in (1, -1)}
            for rate in (self.current, self.current * self.voltage)
        )

    def counter(self, rate):
        """Return what has flowed up to each row."""
        return np.append(0.0, np.cumsum(np.diff(self.time) * (rate[:-1] + rate[1:]) / 7200.0))

    def per_step(self, counters):
        """Return a counter of both directions that starts over with each step."""
        both = counters[1] + counters[-1]
        first = np.append(True, np.diff(self.step) != 0)
        base = np.append(0.0, both[:-1])[np.maximum.accumulate(np.where(first, np.arange(both.size), 0))]
        return both - base


def clock(seconds, form="{:02d}:{:02d}:{:06.3f}"):
    """Return seconds as hours, minutes and seconds."""
    return form.format(int(seconds // 3600), int(seconds % 3600 // 60), seconds % 60)


def lines(separator, *columns):
    """Return rows of cells."""
    return "".join(separator.join(map(str, row)) + "\n" for row in zip(*columns, strict=True))


def fixed(values, digits=6):
    """Return numbers as a cycler writes them."""
    return [f"{value:.{digits}f}" for value in values]


def arbin():
    """A table of records with counters that run through the test, and a sign."""
    made = Test()
    return (
        "Data_Point,Date_Time,Test_Time(s),Step_Index,Cycle_Index,Current(A),Voltage(V),Charge_Capacity(Ah),"
        "Discharge_Capacity(Ah),Charge_Energy(Wh),Discharge_Energy(Wh)\n"
    ) + lines(
        ",", range(1, made.time.size + 1), [f"03/12/2025 {clock(t)}" for t in made.time], fixed(made.time, 4),
        made.step, made.cycle, fixed(made.current), fixed(made.voltage), fixed(made.charge[1]),
        fixed(made.charge[-1]), fixed(made.energy[1]), fixed(made.energy[-1]),
    )  # fmt: skip


def neware():
    """Records with the time and a counter of each step, words for states, in mA."""
    made = Test()
    words = np.select([made.voltage > 4.199, made.state > 0, made.state < 0], ["CV_Chg", "CC_Chg", "CC_DChg"], "Rest")
    return "Cycle ID,Step ID,Record ID,Time(h:min:s.ms),Voltage(V),Current(mA),Capacity(mAh),Energy(mWh),Status\n" + (
        lines(
            ",", made.cycle, made.step, range(made.time.size), map(clock, made.of_step), fixed(made.voltage, 4),
            fixed(1e3 * np.abs(made.current), 2), fixed(1e3 * made.per_step(made.charge), 4),
            fixed(1e3 * made.per_step(made.energy), 4), words,
        )
    )  # fmt: skip


def maccor():
    """Text between tabs with letters for states, unsigned, and days before the time."""
    made = Test()
    letters = np.select([made.state > 0, made.state < 0], ["C", "D"], "R")
    days = [f"{int(t // 86400)}d {clock(t % 86400, '{:02d}:{:02d}:{:05.2f}')}" for t in made.time]
    return (
        "Today's Date\t03/12/2025\tDate of Test:\t03/10/2025\nFilename:\tC:\\data\\cell7.015\tProcedure:\tageing.000\n"
        "Rec#\tCyc#\tStep\tTestTime\tAmp-hr\tWatt-hr\tAmps\tVolts\tState\tES\n"
    ) + lines(
        "\t", range(1, made.time.size + 1), made.cycle, made.step, days, fixed(made.per_step(made.charge), 9),
        fixed(made.per_step(made.energy), 9), fixed(np.abs(made.current), 9), fixed(made.voltage, 8), letters,
        np.ones(made.time.size, dtype=int),
    )  # fmt: skip


def biologic():
    """Lines above the names, decimal commas, a tab at the end of each row, in mA."""
    made = Test()
    head = "EC-Lab ASCII FILE\nNb header lines : 4\n\n"
    head += "mode\tox/red\tNs\ttime/s\tEwe/V\tI/mA\tQ discharge/mA.h\tQ charge/mA.h\t"
    head += "Energy charge/W.h\tEnergy discharge/W.h\t\n"
    return head + lines(
        "\t", np.ones(made.time.size, dtype=int), (made.state > 0).astype(int), made.step, fixed(made.time, 3),
        fixed(made.voltage), fixed(1e3 * made.current, 4), fixed(1e3 * made.charge[-1], 4),
        fixed(1e3 * made.charge[1], 4), fixed(made.energy[1]), fixed(made.energy[-1]), [""] * made.time.size,
    ).replace(".", ",")  # fmt: skip


def discharges(fade=0.0):
    """Discharges alone, each with its own time; what lies between is not there."""
    rows = []
    for number in range(5):
        time, voltage, current = cell.cycle(20.0, capacity=1.4 * (1.0 - fade * number))
        part = slice(np.flatnonzero(current < 0)[0] - 1, np.flatnonzero(current < 0)[-1] + 10)
        rows.append((np.full(time[part].size, 2 * number + 2), 24.0 + 0 * time[part], time[part] - time[part][0],
                     fixed(voltage[part]), fixed(current[part])))  # fmt: skip
    head = "cycle,Temperature_measured,Time,Voltage_measured,Current_measured\n"
    return head + "".join(lines(",", *row) for row in rows)


def calce():
    """Two files of a tester, one after the other."""
    made = Test()
    head = "Data_Point,Test_Time(s),Date_Time,Current(A),Voltage(V),Charge_Capacity(Ah),Discharge_Capacity(Ah)\n"
    rest = [f"{n},{60.0 * n:.4f},-,0,3.0,0,0\n" for n in range(5)]
    one = "".join(rest) + lines(
        ",", range(5, made.time.size + 5), fixed(made.time + 300, 4), ["2010-08-26 12:18:53"] * made.time.size,
        fixed(made.current), fixed(made.voltage), fixed(made.charge[1]), fixed(made.charge[-1]),
    )  # fmt: skip
    return head + one + one


def digatron():
    """Semicolons, decimal commas, and a line of units below the names."""
    made = Test()
    words = np.select([made.state > 0, made.state < 0], ["CHA", "DCH"], "PAU")
    return "Test;7\n\nStep;Status;Prog Time;Cycle;Voltage;Current\n;;;;V;A\n" + lines(
        ";", made.step, words, map(clock, made.time), made.cycle, fixed(made.voltage), fixed(np.abs(made.current))
    ).replace(".", ",")


MAKES = {
    "Arbin": arbin, "Neware": neware, "Maccor": maccor, "BioLogic": biologic, "CALCE": calce, "Digatron": digatron,
}  # fmt: skip


def analyse(folder, text, mapping, *options):
    """Analyse a log with a mapping, as a program does."""
    log, how = folder / "log.txt", folder / "mapping.yaml"
    log.write_text(text, encoding="utf-8")
    how.write_text(mapping, encoding="utf-8")
    result = CliRunner().invoke(
        command, ["battery", str(log), "--mapping", str(how), "--json", *options], catch_exceptions=False,
        standalone_mode=False,
    )  # fmt: skip
    return json.loads(result.stdout)


@pytest.mark.parametrize("make", MAKES)
def test_a_make_is_read_by_its_mapping_alone(tmp_path, make):
    """Whole cycles with the charge that is known, whatever the file looks like, and the counters agree."""
    found = analyse(tmp_path, MAKES[make](), EXAMPLES[make], "--mean-voltage", "3.3,3.95")
    assert [each["complete"] for each in found["cycles"]] == [True] * (4 if make == "CALCE" else 2)
    for each in found["cycles"]:
        for way in ("charge", "discharge"):
            assert each[way]["charge"] == pytest.approx(TRUTH, abs=0.7 * 60 / 3600)
        assert each["discharge"]["mean_voltage"] == pytest.approx(3.4, abs=0.02)
        assert each["charge"]["time_to_limit"] == pytest.approx(cell.truth()[1], abs=120.0)
    if make not in {"Digatron", "CALCE"}:  # the one has no counter, the other counts no energy
        assert found["own"]["charge_Ah"] == pytest.approx(found["net"]["charge_Ah"], abs=0.003)
    assert (found["status"], found["reasons"]) == ("conclusive", [])


def test_discharges_alone_are_read_by_their_mapping(tmp_path):
    """Every discharge keeps its number, and what lies between them is not counted."""
    found = analyse(tmp_path, discharges(0.02), EXAMPLES["Discharges"])
    assert found["compared"] == [each["number"] for each in found["cycles"]] == [2, 4, 6, 8, 10]
    slope = found["fade"]["discharge_capacity"]["slope"]["value"]
    assert slope == pytest.approx(-0.02 * 0.8 * 1.4 / 2, rel=0.05)
    assert (found["status"], found["reasons"]) == ("conclusive", [])


def test_accuracies_are_in_the_uncertainties_and_told(tmp_path):
    """Bounds of the mapping, of which the option replaces one: each over the root of three, in quadrature."""
    mapping = EXAMPLES["Arbin"] + 'accuracy:\n  current_gain: "0.5"\n  current_offset: "0.002"\n'
    found = analyse(tmp_path, arbin(), mapping, "--current-gain", "0.001")
    discharge, told = found["cycles"][0]["discharge"], found["cycles"][0]["uncertainty"]
    gain, offset = 0.001 * discharge["charge"], 0.002 * discharge["duration"] / 3600.0
    assert told["discharge_Ah"] == pytest.approx(np.hypot(gain, offset) / np.sqrt(3.0), rel=1e-3)
    assert told["coulombic_efficiency"] > offset / discharge["charge"]
    assert "± 0.001 of the current, ± 0.002 A, each over the root of three" in found["uncertainty"]["from"]


def test_what_a_mapping_lacks_is_named_with_line_and_column(tmp_path):
    """A word that no list holds, a list of no words, a column that is not there, a key that is none."""
    for text, mapping, told in (
        (
            maccor(),
            EXAMPLES["Maccor"].replace("[R, P, S, O]", "[P]"),
            r"log.txt:\d+:\d+: 'R' in column 9 is not a state that",
        ),
        (
            maccor(),
            re.sub(r"states:.*", "", EXAMPLES["Maccor"], flags=re.DOTALL),
            "no word that says charge or discharge",
        ),
        (
            arbin(),
            EXAMPLES["Arbin"].replace("Current(A)", "Curent(A)"),
            r"no column 'Curent\(A\)', did you mean 'Current\(A\)'",
        ),
        (
            arbin(),
            EXAMPLES["Arbin"].replace("time:", "tme:"),
            r"mapping.yaml:3:3: unknown key 'tme', did you mean 'time'",
        ),
        (
            neware(),
            EXAMPLES["Neware"].replace("time_restarts: step", ""),
            r"column Time\(h:min:s.ms\), goes back 7 times, first at row 177, from 10500 to 60",
        ),
    ):
        with pytest.raises(HilError, match=told):
            analyse(tmp_path, text, mapping)


def test_a_current_against_its_state_is_doubted(tmp_path):
    """A current that flows in what is called a rest, and one whose sign is not that of its state."""
    rests = EXAMPLES["Neware"].replace("[CC_DChg]\n  rest: [Rest]", "[x]\n  rest: [Rest, CC_DChg]")
    found = analyse(tmp_path, neware(), rests)
    assert any(reason.startswith("state: ") for reason in found["reasons"])
    swapped = EXAMPLES["Digatron"].replace("CHA", "x").replace("DCH", "CHA").replace("x", "DCH")
    signed = digatron().replace("DCH;", "DCH;").replace(";0,700000", ";-0,700000")
    assert any(reason.startswith("state: ") for reason in analyse(tmp_path, signed, swapped)["reasons"])


@pytest.mark.parametrize(
    ("make", "old", "new"),
    [("BioLogic", "700,0000", "nan"), ("CALCE", ",-0.700000", ",-inf"), ("Arbin", "0.700000,", "nan,")],
)
@pytest.mark.filterwarnings("error")
def test_rows_without_a_number_are_left_out_and_told(tmp_path, make, old, new):
    """Infinite and missing numbers in three rows."""
    found = analyse(tmp_path, MAKES[make]().replace(old, new, 3), EXAMPLES[make])
    assert "3 rows without a time, voltage, current or cycle are left out" in found["remarks"]
    assert found["cycles"][-1]["discharge"]["charge"] == pytest.approx(TRUTH, abs=0.7 * 60 / 3600)


def test_a_counter_that_never_moves_is_left_out(tmp_path):
    """It would say that nothing flowed where the current was switched."""
    text = re.sub(r"^((?:[^\t]*\t){4})\d[^\t]*", r"\g<1>0", maccor(), flags=re.MULTILINE)
    found = analyse(tmp_path, text, EXAMPLES["Maccor"])
    assert "the counter of charge never moves: left out" in found["remarks"]
    assert found["own"]["charge_Ah"] is None
    assert found["cycles"][0]["discharge"]["charge"] == pytest.approx(TRUTH, abs=0.5 * 0.7 * 60 / 3600)


def test_numbers_that_cannot_be_are_refused_with_their_row(tmp_path):
    """A voltage of a million million volts, and a time that is none."""
    with pytest.raises(HilError, match="a voltage of 1e\\+12, in row 41, cannot be"):
        analyse(tmp_path, digatron().replace("3,500000", "1e12"), EXAMPLES["Digatron"])
    with pytest.raises(HilError, match=r"log.txt:\d+:\d+: '0-' in column 4 is not a time"):
        analyse(tmp_path, neware().replace("0:04:00.000", "-"), EXAMPLES["Neware"])


def test_a_state_in_two_lists_is_refused(tmp_path):
    """Nobody can tell whether it charges or discharges."""
    mapping = tmp_path / "mine.yaml"
    mapping.write_text(EXAMPLES["Digatron"].replace("[CHA]", "[CHA, DCH]"), encoding="utf-8")
    log = tmp_path / "test.csv"
    log.write_text("Prog Time,Voltage,Current,Cycle,Status\n0,3,1,1,CHA\n1,3,1,1,CHA\n", encoding="utf-8")
    with pytest.raises(HilError, match="the state 'DCH' is listed twice in `states:`; list each word once"):
        CliRunner().invoke(
            command, ["battery", str(log), "--mapping", str(mapping)], catch_exceptions=False, standalone_mode=False
        )


@pytest.mark.parametrize("head", ["t,Voltage [mV],Q/mA\n", "t,U (mV),I_1/mA\n", "t,U,I\ns,mV,mA\n"])
def test_units_after_a_space_or_in_a_line_of_their_own(tmp_path, head):
    """Millivolts and milliamperes are understood, and said."""
    log = tmp_path / "test.csv"
    rows = "".join(f"{10 * n},{3600 + n},{0 if n < 5 else 1500}\n" for n in range(100))
    log.write_text(head + rows, encoding="utf-8")
    names = ("--time", "1", "--voltage", "2", "--current", "3")
    result = CliRunner().invoke(command, ["battery", str(log), *names], standalone_mode=False)
    assert "note: voltage is in mV, as the column's name" in result.stdout
    assert "note: current is in mA, as the column's name" in result.stdout
    assert "highest_voltage: 3.699 V" in result.stdout
