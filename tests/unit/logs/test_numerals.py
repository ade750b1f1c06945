"""Numbers read many at once: the same bits as `float` gives, and everything unusual left to the strict way."""

from __future__ import annotations

import numpy as np
import pytest

from hil.logs import columns
from hil.logs.columns import read
from hil.logs.numerals import MARGIN, numbers, plain
from hil.model.errors import Refused

WRITINGS = ["{!r}", "{:.3f}", "{:.6f}", "{:.6e}", "{:.18e}", "{:+.9f}", " {:g} ", "{:.0f}", "{:.12g}", "{:.17g}"]


@pytest.fixture(autouse=True)
def small_blocks(monkeypatch):
    """Blocks of a few rows."""
    monkeypatch.setattr(columns, "_BLOCK", 256)


def drawn(count):
    """Numbers of every size that logs hold."""
    generator = np.random.default_rng(11)
    return (generator.standard_normal(count) * 10.0 ** generator.integers(-8, 13, count)).tolist()


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
@pytest.mark.parametrize("mixed", [False, True])
def test_numbers_are_what_float_gives_to_the_last_bit(separator, mixed):
    """Any writing, one in a column or all in one; at most a few are left to `float`."""
    values = drawn(1200)
    for place in range(len(WRITINGS)):
        cells = [
            WRITINGS[(place + row) % len(WRITINGS) * mixed or place].format(each) for row, each in enumerate(values)
        ]
        rows = [separator.join(cells[first : first + 3]) for first in range(0, len(cells), 3)]
        found = plain(
            b"\n" * MARGIN + "".join(f"{row}\n" for row in rows).encode(), separator.strip(" ") or None, ".", 3
        )
        assert found is not None
        for column in range(3):
            told, odd = numbers(found, column)
            expected = np.array([float(cell) for cell in cells[column::3]])
            plainly = np.setdiff1d(np.arange(told.size), odd)
            assert np.array_equal(told[plainly], expected[plainly])
            assert odd.size < 0.2 * told.size


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t,x\n" + "".join(f"{k},{k / 8}\r\n" for k in range(90)), 90),
        ("t,x\n" + "".join(f"{k},{k / 8}\n" + "# note\n" * (k == 50) + "\n" * (k == 60) for k in range(90)), 90),
        ("t,x\n" + "".join(f"# {k},{k}\n" if k % 9 == 4 else f"{k},{k / 8}\n" for k in range(99)), 88),
        ("t,x\n" + "".join(f"{k},{k / 8}\r" for k in range(90)), 90),
        ("t;x\n" + "".join(f"{k};{k / 8}\n".replace(".", ",") for k in range(90)), 90),
        ("t x\n" + "".join(f"   {k}  {k / 8} \n" for k in range(90)), 90),
        ('"t","x"\n' + "".join(f'"{k}","{k / 8}"\n' for k in range(90)), 90),
        ("t,x\n" + "".join(f"{k},{'nan' if k == 70 else k / 8}\n" for k in range(90)), 90),
        ("t,x\n" + "".join(f"{k},{k / 8}\n" for k in range(90)) + "90,1.5", 91),
    ],
)
def test_blocks_of_all_writings_make_one_table(tmp_path, text, expected):
    """Line ends, comments, blank lines, commas, white space, quotes and NaN, in some blocks or in all."""
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode())
    table = read(path, ["x"])
    assert table.values.shape == (expected, 1)
    kept = [k for k in range(99) if not (expected == 88 and k % 9 == 4)][:expected]
    wanted = np.array(kept)[:, None] / 8
    wanted[70 if "nan" in text else slice(0), 0] = np.nan
    if expected == 91:
        wanted[90, 0] = 1.5
    assert np.array_equal(table.values, wanted, equal_nan=True)


@pytest.mark.parametrize(
    "bad", ["1.2.3", "12a", "", "-", ".", "1_000", "1e5e", "0x10", "1e-0.", "--1", "1 2", "+-3", "\u0661"]
)
def test_a_bad_cell_is_named_by_its_line_wherever_it_is(tmp_path, bad):
    """Within blocks that are read at once, the error still tells line and column."""
    path = tmp_path / "log.csv"
    path.write_text("t,x\n" + "".join(f"{k},{bad if k == 500 else k / 8}\n" for k in range(700)), encoding="utf-8")
    with pytest.raises(Refused, match=r"log\.csv:502:"):
        read(path)


@pytest.mark.parametrize("row", ["500", "500,1,2", "500,1\n7", "500,,1"])
def test_a_row_of_another_width_is_named_by_its_line(tmp_path, row):
    """No row is dropped, joined or shifted."""
    path = tmp_path / "log.csv"
    path.write_text("".join(f"{row}\n" if k == 500 else f"{k},{k / 8}\n" for k in range(700)), encoding="utf-8")
    with pytest.raises(Refused, match=r"log\.csv:50[12]:1: \d cells?, where the rows above have 2"):
        read(path)


def test_a_file_without_an_end_is_read_as_one_with(tmp_path):
    """The last row counts where it is whole, wherever blocks end."""
    for count in range(20, 60):
        path = tmp_path / f"{count}.csv"
        path.write_text("".join(f"{k},{k / 8}\n" for k in range(count)).removesuffix("\n"), encoding="utf-8")
        assert read(path).values[:, 0].tolist() == list(range(count))


@pytest.mark.parametrize("rest", ["1.250", "1", "-0.5", "1.2e-05", "1.2.3", ""])
def test_columns_whose_signs_are_in_the_same_place_are_read_as_others(tmp_path, rest):
    """One cell that is written in another way changes no other; one that is no number is refused."""
    path = tmp_path / "log.csv"
    rows = [f"{row}.125,{row / 8:.3f},{row}" for row in range(90)]
    rows[60] = f"60.125,{rest},60"
    path.write_text("t,x,n\n" + "\n".join(rows) + "\n")
    if rest in {"", "1.2.3"}:
        with pytest.raises(Refused, match=f"'{rest}' in column 2 is not a number"):
            read(path, ["x"])
        return
    for chosen in (["x"], ["n", "t"], ["t", "x", "n"]):
        held = {"t": [row + 0.125 for row in range(90)], "x": [row / 8 for row in range(90)], "n": list(range(90))}
        held["x"][60] = float(rest)
        assert read(path, chosen).values.T.tolist() == [held[column] for column in chosen]
