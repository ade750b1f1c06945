"""The one rule for names that cases give: of recordings, channels and files."""

from __future__ import annotations

import pytest

from hil.documents.text import name_problem


@pytest.mark.parametrize(
    "name", ["rest", "Rest at 25 \N{DEGREE SIGN}C", "supply.coil.voltage", "a", "x" * 100, "CONTROL"]
)
def test_a_name_is_what_people_write(name):
    """Words, units and roles."""
    assert name_problem(name) == ""


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("a\0b", "a name has no character U+0000"),
        ("a\nb", "a name has no character U+000A"),
        ("a\x1b[2J", "a name has no character U+001B"),
        ("a\u202eb", "a name has no character U+202E"),
        ("a\udcffb", "a name has no character U+DCFF"),
        ("", "a name has 1 to 100 characters"),
        ("  ", "a name has 1 to 100 characters"),
        ("x" * 101, "a name has 1 to 100 characters"),
        ("a ", "a name has no space at its ends, and no dot at its end"),
        ("a.", "a name has no space at its ends, and no dot at its end"),
        ("a/b", "a name has no slash"),
        ("a\\b", "a name has no slash"),
        (7, "a name is a text, and this is a int"),
    ],
)
def test_other_names_are_refused_with_what_is_allowed(name, told):
    """NUL, controls, marks that reorder text, other systems' separators; a recording of such a name was a traceback."""
    assert name_problem(name) == told


@pytest.mark.parametrize("name", ["CON", "con.txt", "Lpt1", "com9.tar.gz"])
def test_a_file_is_not_called_as_a_device(name):
    """Windows could not copy a package with it; a recording's name is no file's."""
    assert name_problem(name, file=True) == "Windows has a device of this name"
    assert name_problem(name) == ""
