"""Readers of battery tests: Novonix files and terminal logs of a cycler."""

from __future__ import annotations

from binascii import crc_hqx
from pathlib import Path

import numpy as np
import pytest

from hil.logs import cycler, novonix
from hil.logs.battery import lines_of, made_by
from hil.model.errors import Refused

NOVONIX = Path(__file__).parents[3] / "docs" / "data" / "battery-novonix.csv"
HEADER = "=~=~=~=~= PuTTY log 2023.06.02 10:11:12 =~=~=~=~=\r\nSTART ARDUINO\r\n"


def rows(count, *, volts=3.7, amperes=0.7, start=0.0):
    """Rows of a steady half-cycle with decimal commas, the energy to 0.1 mWh."""
    each = abs(volts * amperes) * 5.0 / 3600.0
    return [f"{volts:.3f};{amperes:.3f};{start + each * n:.4f};25.1".replace(".", ",") for n in range(1, count + 1)]


def log(tmp_path, lines, *, header=HEADER, end="\r\n"):
    """A log file of these lines."""
    path = tmp_path / "putty.log"
    path.write_bytes((header + "\r\n".join(lines) + end).encode("ascii"))
    return path


def test_a_novonix_file_is_read_with_its_own_sums():
    """207 rows, the declared capacity, and the cycler's own charge and energy to every digit."""
    read = novonix.read(NOVONIX)
    assert read.time.size == 207
    assert read.capacity == 5.0
    assert (read.own_charge, read.own_energy) == (1.70652976, 6.84854718)
    assert read.time[-1] == pytest.approx(3.4131889 * 3600.0)
    assert read.temperature[0] == 24.644
    assert read.remarks == ()


def test_torn_rows_and_end_marks_of_a_novonix_file(tmp_path):
    """A torn last row is left out and told; a section mark after the data is no row."""
    path = tmp_path / "n.csv"
    text = NOVONIX.read_text(encoding="utf-8")
    path.write_text(text[:-60] + "\n[End Data]\n", encoding="utf-8")
    read = novonix.read(path)
    assert read.time.size == 206
    assert read.remarks == ("1 torn row is left out",)


def test_a_novonix_file_without_data_or_column_is_refused(tmp_path):
    """What is missing is named, with what to do."""
    path = tmp_path / "n.csv"
    text = NOVONIX.read_text(encoding="utf-8")
    path.write_text(text.replace("[Data]", "[Dat]"), encoding="utf-8")
    with pytest.raises(Refused, match=r"no section \[Data\]"):
        novonix.read(path)
    path.write_text(text.replace("Potential (V)", "Potental (V)"), encoding="utf-8")
    with pytest.raises(Refused, match=r":21:1: no column 'Potential \(V\)'; did you mean|:21:1: no column 'Potential"):
        novonix.read(path)


def test_a_cyclers_log_is_read_with_marks_and_decimal_commas(tmp_path):
    """Rows each 5 s, iterations as cycles, nothing to remark on but the counted time."""
    lines = [
        "TEST ITERATION 1", *rows(4), "CHARGE END", *rows(4, amperes=-0.7), "TEST ITERATION 2", *rows(2), "TEST END",
    ]  # fmt: skip
    read = cycler.read(log(tmp_path, lines))
    assert read.time.tolist() == [5.0 * n for n in range(10)]
    assert read.cycle.tolist() == [1.0] * 8 + [2.0] * 2
    assert read.current[5] == -0.7
    assert read.voltage[0] == 3.7
    assert read.temperature[0] == 25.1
    assert read.remarks == ("the time is counted from rows, 5 s each",)


def test_torn_rows_keep_their_time(tmp_path):
    """A row without its end, its beginning or its line end is left out, and the next one comes when it came."""
    lines = rows(8)
    lines[2], lines[4], lines[6] = lines[2][:9], lines[4][3:] + ";;", lines[6][:12] + lines[6]
    read = cycler.read(log(tmp_path, [*lines, "TEST END"]))
    assert read.time.tolist() == [0.0, 5.0, 15.0, 25.0, 35.0]
    assert "3 torn rows are left out, their intervals are counted" in read.remarks


def test_a_torn_row_with_a_control_character_is_one_row(tmp_path):
    """A disturbed line may hold a form feed, which ends no line: one interval has passed, not two."""
    lines = rows(4)
    lines[1] = lines[1][:9] + "\f" + lines[1][12:]
    read = cycler.read(log(tmp_path, [*lines, "TEST END"]))
    assert read.time.tolist() == [0.0, 10.0, 15.0]
    assert "1 torn row is left out, its interval is counted" in read.remarks


def test_missing_rows_are_seen_in_the_energy(tmp_path):
    """Three rows that never came leave a jump of the energy, and the time goes on as it went."""
    lines = rows(20)
    del lines[10:13]
    read = cycler.read(log(tmp_path, [*lines, "TEST END"]))
    assert np.flatnonzero(np.diff(read.time) > 6.0).tolist() == [9]
    assert read.time[-1] == 95.0
    assert any(remark.startswith("3 missing rows") for remark in read.remarks)


def test_a_log_that_was_broken_off_says_so(tmp_path):
    """No TEST END, a second header and a torn last row are all told."""
    path = log(tmp_path, [*rows(5), HEADER.strip(), *rows(3), rows(1)[0][:16]], end="")
    told = " ".join(cycler.read(path).remarks)
    assert "no TEST END" in told
    assert "began 2 times" in told
    assert "1 torn row" in told


def test_own_energy_of_the_cycler_is_net(tmp_path):
    """The accumulated energy starts from zero with each half; its steps count with the sign of the current."""
    read = cycler.read(log(tmp_path, [*rows(100), *rows(50, amperes=-0.7)]))
    each = 3.7 * 0.7 * 5.0 / 3600.0
    assert read.own_energy == pytest.approx((99 - 50) * each, abs=2e-4)


def sealed(text):
    """A line with the CRC of the cycler's second level."""
    return f"{text}*{crc_hqx(text.encode('ascii'), 0xFFFF):04X}"


def test_sealed_rows_tell_their_time_and_are_checked(tmp_path):
    """Rows with device time and CRC: lost ones need no guess, a changed digit is torn, marks hold semicolons."""
    lines = [sealed(f"{row.replace(',', '.')};{n};{5000 * n};C") for n, row in enumerate(rows(6), start=1)]
    lines[2] = lines[2].replace("3.700", "3.800")
    del lines[3]
    marks = [sealed("TEST ITERATION 1;1;0"), sealed("TEST END;9;40000")]
    read = cycler.read(log(tmp_path, [marks[0], *lines, marks[1]]))
    assert read.time.tolist() == [0.0, 5.0, 20.0, 25.0]
    assert read.cycle.tolist() == [1.0] * 4
    assert read.remarks == ("1 torn row is left out, its interval is counted",)


def test_the_devices_clock_may_wrap_or_restart(tmp_path):
    """After 49.7 days the time runs on; after a reset one interval is counted, and the reset told."""
    stamps = [2**32 - 5000, 0, 5000]
    lines = [sealed(f"3.7;0.7;0.1;25.0;{n};{stamp};C") for n, stamp in enumerate(stamps)]
    lines += ["START ARDUINO", sealed("3.7;0.7;0.1;25.0;1;900;C")]
    read = cycler.read(log(tmp_path, lines))
    assert read.time.tolist() == [0.0, 5.0, 10.0, 15.0]
    assert any(remark.startswith("the cycler started 2 times") for remark in read.remarks)


def test_a_log_without_rows_is_refused(tmp_path):
    """Marks alone are no test; a missing file and a binary one neither."""
    with pytest.raises(Refused, match="no row"):
        cycler.read(log(tmp_path, ["TEST END"]))
    with pytest.raises(Refused, match="name a log"):
        lines_of(tmp_path / "none")
    (tmp_path / "b").write_bytes(b"\0\1")
    with pytest.raises(Refused, match="not a text file"):
        lines_of(tmp_path / "b")


def test_the_maker_is_recognised(tmp_path):
    """A Novonix file, a terminal log, and anything else."""
    assert made_by(lines_of(NOVONIX)) == "novonix"
    assert made_by(lines_of(log(tmp_path, rows(2)))) == "cycler"
    assert made_by(["time,U,I\n", "0,3.7,0.7\n"]) == "table"


def test_a_start_begins_a_new_test(tmp_path):
    """A second start in a half-cycle: another test and stretch, and the energy is not carried across."""
    lines = ["TEST ITERATION 1", *rows(6), "START ARDUINO", "TEST ITERATION 1", *rows(4), "TEST END"]
    read = cycler.read(log(tmp_path, lines))
    assert read.test.tolist() == [0] * 6 + [1] * 4
    assert read.stretch.tolist() == [0] * 6 + [1] * 4
    assert read.own_energy == pytest.approx((5 + 3) * 3.7 * 0.7 * 5.0 / 3600.0, abs=2e-4)


@pytest.mark.parametrize(("second", "tests"), [("1", 2), ("2", 1), ("4", 2)])
def test_an_iteration_that_does_not_follow_on_begins_a_new_test(tmp_path, second, tests):
    """The first again, or one that leaves some out; the next one goes on."""
    lines = ["TEST ITERATION 1", *rows(6), f"TEST ITERATION {second}", *rows(4), "TEST END"]
    read = cycler.read(log(tmp_path, lines))
    assert np.unique(read.test).size == tests
    assert np.unique(read.stretch).size == tests


def test_a_header_in_the_middle_begins_a_stretch_of_the_same_test(tmp_path):
    """What came while the terminal was off is not known: the rows after it are of the cycle before the next mark."""
    lines = ["TEST ITERATION 1", *rows(6), HEADER.splitlines()[0], *rows(4), "TEST ITERATION 3", *rows(3), "TEST END"]
    read = cycler.read(log(tmp_path, lines))
    assert set(read.test.tolist()) == {0}
    assert read.stretch.tolist() == [0] * 6 + [1] * 7
    assert read.cycle.tolist() == [1.0] * 6 + [2.0] * 4 + [3.0] * 3


def test_an_energy_that_goes_back_is_a_bad_row(tmp_path):
    """One watt-hour more, or less, for one row: the row is left out, no row is missing, and no energy is added."""
    lines = rows(40)
    for place, energy in ((9, "1,0360"), (30, "0,0001")):
        lines[place] = ";".join([*lines[place].split(";")[:2], energy, "25,1"])
    read = cycler.read(log(tmp_path, [*lines, "TEST END"]))
    assert read.time.size == 38
    assert read.time[-1] == 195.0
    assert read.own_energy == pytest.approx(39 * 3.7 * 0.7 * 5.0 / 3600.0, abs=2e-4)
    assert not any("missing" in remark for remark in read.remarks)
    assert any(
        remark.startswith("2 rows with an accumulated energy that the next takes back") for remark in read.remarks
    )


def test_a_torn_row_takes_nothing_from_the_own_energy(tmp_path):
    """The field at the end less that at the beginning, whatever row is torn, the first and the last as well."""
    rest = [";".join(["3,700", "0,000", *row.split(";")[2:]]) for row in rows(20)[-1:] * 3]
    whole = [*rows(20), *rows(20, amperes=-0.7), *rest]
    expected = cycler.read(log(tmp_path, whole)).own_energy
    for place in (10, 20, 30, 39):
        torn = [row[:9] if place == each else row for each, row in enumerate(whole)]
        assert cycler.read(log(tmp_path, torn)).own_energy == pytest.approx(expected, abs=1e-9)
