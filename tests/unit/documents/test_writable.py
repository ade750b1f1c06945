"""What a case says is shown as it is, and does nothing to a terminal or a file."""

from __future__ import annotations

import pytest

from hil.documents.text import one_line, writable


@pytest.mark.parametrize("text", ["", "Charge at 40 °C", "12\u202f500 µV", "Batterie prüfen", "電池"])
def test_what_people_write_stays(text):
    """Other alphabets, narrow spaces and signs are no control characters."""
    assert writable(text) == one_line(text) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\x1b[2Jb", "a\\x1b[2Jb"),
        ("a\rPASS", "a\\rPASS"),
        ("caf\udce9", "caf\\udce9"),
        ("\x9b2J", "\\x9b2J"),
        ("tab\there", "tab\\there"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(text, shown):
    """Nothing is left out, and every text can be encoded."""
    assert writable(text) == shown
    assert shown.encode().decode() == shown


def test_only_a_text_of_several_lines_has_them():
    """A title that went on in the next line could show a verdict there."""
    assert writable("a\n  PASS") == "a\n  PASS"
    assert one_line("a\n  PASS") == "a\\n  PASS"
