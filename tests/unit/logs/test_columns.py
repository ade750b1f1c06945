"""Reading foreign text tables, good and bad."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pytest

from hil.logs.columns import read
from hil.model.errors import Refused

SLICE = Path(__file__).parents[3] / "docs" / "data" / "gyroscope-xsens-rest.txt"


@pytest.fixture
def written(tmp_path):
    """Write a table and give its path."""

    def write(text, name="log.txt"):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return path

    return write


@pytest.mark.parametrize(
    "text",
    [
        "1 2.5 3\n4 5.5 6\n",
        "  1   2.5\t3\n\n  4 5.5 6\n\n",
        "1,2.5,3\n4,5.5,6\n",
        "1, 2.5, 3\n4, 5.5, 6\n",
        "1\t2.5\t3\n4\t5.5\t6\n",
        "1;2.5;3\n4;5.5;6\n",
        "1;2,5;3\n4;5,5;6\n",
        "1,0 2,5 3,0\n4,0 5,5 6,0\n",
        "1\t2,5\t3\n4\t5,5\t6\n",
        "1e0 +2.50E+00 0.3e1\n4 5.5 6\n",
        "# made by a logger\n1 2.5 3\n% a note\n4 5.5 6\n",
        '"1","2.5","3"\n"4","5.5","6"\n',
        "1,2.5,3\r\n4,5.5,6\r\n",
        "\ufeff1,2.5,3\n4,5.5,6\n",
        "1 2.5 3\n4 5.5 6",
    ],
)
def test_tables_in_many_writings_are_read_alike(written, text):
    """Spaces, tabs, semicolons, commas, decimal commas, exponents, comments, quotes, line ends, a byte-order mark."""
    table = read(written(text))
    assert table.values.tolist() == [[1.0, 2.5, 3.0], [4.0, 5.5, 6.0]]
    assert table.names == ("1", "2", "3")
    assert table.remarks == ()


@pytest.mark.parametrize(
    "text",
    [
        "t,gx,gy\n1,2,3\n",
        "Logger 7\nserial: 12, rev B\nt,gx,gy\n1,2,3\n",
        "# t gx gy\n1 2 3\n",
        "t;gx;gy\n1;2,0;3\n",
    ],
)
def test_columns_are_chosen_by_name_or_number_in_any_order(written, text):
    """The header's names count; numbers count from 1."""
    table = read(written(text), ["gy", "1"])
    assert table.names == ("gy", "t")
    assert table.values.tolist() == [[3.0, 1.0]]


def test_a_first_column_is_put_before_the_others(written):
    """Without a choice the others follow in their order."""
    assert read(written("a,b,c\n1,2,3\n"), first="b").names == ("b", "a", "c")
    assert read(written("a,b,c\n1,2,3\n"), ["c"], first="b").names == ("b", "c")


def test_text_in_a_column_that_nobody_asked_for_is_no_error(written):
    """A cycler's table begins with date and time."""
    table = read(written("Date,V,I\n2025-07-19 15:26:20,3.8,0.5\n2025-07-19 15:26:21,3.9,0.5\n"), ["V"])
    assert table.values.tolist() == [[3.8], [3.9]]


def test_a_table_of_one_column_is_read(written):
    """One number a line."""
    assert read(written("1.5\n2.5\n3.5\n")).values.tolist() == [[1.5], [2.5], [3.5]]


@pytest.mark.parametrize("torn", ["7 8", "7 8 9e", "7 8 -"])
def test_a_torn_last_line_is_left_out_with_a_remark(written, torn):
    """The logger died while writing: the whole rows count, and the loss is told."""
    table = read(written(f"1 2 3\n4 5 6\n{torn}"))
    assert table.values.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert table.remarks == ("line 3, the last, is torn off and left out",)


def test_a_last_line_that_is_still_a_row_is_compared_with_those_above(written):
    """Its last cell is too short: left out where many rows show it, only told where few do; a full one stays."""
    rows = "".join(f"{row} {row % 7 + 0.25:.3f}\n" for row in range(30))
    table = read(written(f"{rows}30 0.2"))
    assert len(table.values) == 30
    assert "shorter than all cells above it: torn off, and left out" in table.remarks[0]
    few = read(written("1 2.50\n2 2.51\n3 2.49\n4 2.50\n5 2.5"))
    assert few.values[-1].tolist() == [5.0, 2.5]
    assert "check whether it is whole" in few.remarks[0]
    assert read(written(f"{rows}30 0.250")).remarks == ()


@pytest.mark.parametrize(
    ("text", "columns", "why"),
    [
        ("", [], "the file is empty"),
        ("  \n \n", [], "the file is empty"),
        ("only\nwords\n", [], "no row of numbers"),
        (b"\x89PNG\0\0\1", [], "not a text file"),
        (gzip.compress(b"1 2\n3 4\n", mtime=0), [], "not a text file in UTF-8, but packed by gzip"),
        (b"PK\x03\x04", [], "but a ZIP archive or a workbook"),
        ("1 2\n3 4\n".encode("utf-16"), [], "but in UTF-16"),
        ("1 2 3\n4 5\n6 7 8\n9 10 11\n", [], r"log.txt:2:1: 2 cells, where the rows above have 3"),
        ("1 2 3\n4 5 6 7\n6 7 8\n9 10 11\n", ["1"], r"log.txt:2:1: 4 cells, where the rows above have 3"),
        ("1 2 3\n4 x5 6\n6 7 8\n", [], r"log.txt:2:3: 'x5' in column 2 is not a number"),
        ("a,b\n1,2\n\n3, oops\n4,5\n6,7\n", ["b"], r"log.txt:4:4: 'oops' in column 2 is not a number"),
        ("1,2,3\n4,,6\n7,8,9\n", [], r"log.txt:2:3: '' in column 2 is not a number"),
        ("1 2\n3 1_000\n5 6\n", [], r"'1_000' in column 2 is not a number"),
        ("time,rate\n1,2\n", ["rat"], r"no column 'rat', did you mean 'rate'\?; there are 2 columns"),
        (
            "1 2\n3 4\n",
            ["3"],
            r"no column '3'; there are 2 columns, numbered from 1 \(without names, or with names that repeat\)",
        ),
        ("1 2\n3 4\n", ["0"], "no column '0'"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(written, text, columns, why):
    """Empty, binary, ragged, not a number, no such column: file, line, column, and what was found."""
    with pytest.raises(Refused, match=why):
        read(written(text), columns)


@pytest.mark.parametrize(
    ("first", "second", "apart"),
    [
        ("00:00:01", "00:01:02.5", 61.5),
        ("23:59:59.250", "3 days 00:00:00", 172800.75),
        ("1d 02:03:04", "1d 02:03:05", 1.0),
        ("2026-01-31T23:59:59.9", "2026-02-01 00:00:00", 0.1),
        ("2026-01-31T23:59:59Z", "2026-01-31T23:00:00-01:00", 1.0),
        ("2026-12-31 23:59", "2027-01-01 00:00", 60.0),
        ("2026/01/31 23:59:59", "2026/02/01 00:00:01", 2.0),
        ("31.01.2026 23:59:59,5", "1.2.2026 00:00:00,5", 1.0),
        ("1.5", "2.5", 1.0),
    ],
)
def test_times_are_read_as_they_are_written(written, first, second, apart):
    """Times of day, days, ISO 8601 with zones, dates with slashes or points, plain numbers; all of them as seconds."""
    table = read(written(f"t;x\n{first};1\n{second};2\n"), ["x"], first="t", clock=True)
    assert table.values[1, 0] - table.values[0, 0] == pytest.approx(apart)
    assert table.values[:, 1].tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    "cell",
    ["01/02/2026 10:00:00", "2026/01-02 10:00:00", "32.01.2026 10:00:00", "01:30", "2026-13-01T00:00:00", "noon"],
)
def test_a_time_that_could_mean_several_is_refused(written, cell):
    """The line, and how times are written."""
    with pytest.raises(Refused, match="log.txt:3:1: .* is not a time") as caught:
        read(written(f"t;x\n10:00:00;1\n{cell};2\n10:00:02;3\n"), first="t", clock=True)
    assert "hh:mm:ss.sss" in caught.value.hint


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    """The system's own words, after the path."""
    with pytest.raises(Refused, match="nowhere.txt: No such file or directory"):
        read(tmp_path / "nowhere.txt")
    with pytest.raises(Refused, match="Is a directory"):
        read(tmp_path)


def test_a_bad_cell_far_down_is_found(written):
    """Beyond the lines from which the layout was recognised."""
    rows = [f"{row} {row + 1}" for row in range(2000)]
    rows[1500] = "1500 NULL"
    with pytest.raises(Refused, match=r"log.txt:1501:6: 'NULL' in column 2"):
        read(written("\n".join(rows) + "\n"))


def test_the_example_log_is_read_whole():
    """The committed slice of a real gyroscope: 5598 rows of time and three axes."""
    table = read(SLICE)
    assert table.values.shape == (5598, 4)
    assert table.values[0].tolist() == [0.02984, 32786.0, 32429.0, 32499.0]
    assert (np.diff(table.values[:, 0]) > 0.0).all()


@pytest.mark.parametrize(
    ("units", "names"),
    [
        ("ms;rad/s;V", ("t [ms]", "gx [rad/s]", "U [V]")),
        ("[ms];[deg/s];[]", ("t [ms]", "gx [deg/s]", "U")),
        ("(s);(°/s);-", ("t [s]", "gx [°/s]", "U")),
        ("hh:mm:ss;m/s^2;mV", ("t [hh:mm:ss]", "gx [m/s^2]", "U [mV]")),
    ],
)
def test_a_line_of_units_is_not_taken_for_names(written, units, names):
    """The names above it stay, and each column is found by its own; its unit is told beside it."""
    table = read(written(f"t;gx;U\n{units}\n1;2,5;3\n4;5,5;6\n"), ["gx", "U"], first="t")
    assert table.names == names
    assert table.values.tolist() == [[1.0, 2.5, 3.0], [4.0, 5.5, 6.0]]


def test_a_line_of_words_below_others_is_taken_for_names(written):
    """A single word that is no unit makes it a line of names, and units alone are names where nothing stands above."""
    assert read(written("my,log\nV,time\n1,2\n")).names == ("V", "time")
    assert read(written("s,V\n1,2\n")).names == ("s", "V")


def test_empty_columns_are_left_out_and_need_no_name(written):
    """A separator at the end of each row; a column that has a name is told."""
    rows = "".join(f"{row},{row / 8},\n" for row in range(30))
    for head in ("t,x\n", "t,x,\n"):
        table = read(written(head + rows), ["x"], first="t")
        assert table.names == ("t", "x")
        assert table.remarks == ()
    table = read(written("t,x,y\n" + rows))
    assert table.names == ("t", "x")
    assert table.remarks == ("column y is empty, and left out",)


def test_letters_of_windows_are_read(tmp_path):
    """µ and ° in the names."""
    path = tmp_path / "log.txt"
    path.write_bytes("t [µs];x [°/s]\n1;2\n2;3\n".encode("cp1252"))
    assert read(path).names == ("t [µs]", "x [°/s]")


def test_a_comment_below_the_names_does_not_replace_them(written):
    """Above them it may hold other words, and alone it holds the names."""
    assert read(written("# a, b\nt,x\n# by, hand\n1,2\n")).names == ("t", "x")
    assert read(written("# t,x\n1,2\n")).names == ("t", "x")


def test_thousands_in_quotes_are_named_with_their_place(written):
    """They are no separators, and no numbers."""
    with pytest.raises(Refused, match=r"log.txt:3:1: '1,000' in column 1 is not a number"):
        read(written('t,x\n"999",1\n"1,000",2\n'))


def test_bytes_that_cannot_be_shown_do_not_reach_an_error(written):
    """A block of zeros, as a file system leaves it after a crash."""
    rows = "".join(f"{row} {row}\n" for row in range(2000))
    with pytest.raises(Refused, match=r"'1\?{39}' in column 2 is not a number"):
        read(written(rows + "2000 1" + "\0" * 500 + "\n2001 3\n"))
