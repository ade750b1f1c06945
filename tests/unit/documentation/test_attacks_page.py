"""Every attack on a verdict has tests that exist, and that quote its response."""

from __future__ import annotations

import re

import pytest
from proven_tables import proofs_of, rows_of, texts_in, why_none
from workspaces import ROOT

PAGE = ROOT / "docs" / "explanations" / "attacks.md"
COLUMNS = ["no", "attack", "response", "proven by"]
ROWS = rows_of(PAGE, COLUMNS)
READERS = re.compile(
    r"^\s*(?:from|import) (?:zipfile|tarfile|shelve|pickle|defusedxml|lxml|xml\.sax|xml\.dom)\b"
    r"|\bET\.(?:parse|fromstring|XML|iterparse|XMLParser)\b|\bunpack_archive\b|\bpickle\.load|allow_pickle=True",
    re.MULTILINE,
)


def missing(row):
    """Return the sentences of a row that stand in none of its tests."""
    texts = tuple(texts_in(proofs_of(row)))
    sentences = re.findall(r"`([^`]+)`", row["response"])
    parts = [part for sentence in sentences for part in sentence.split("…") if part]
    return [part for part in parts if not any(part in text for text in texts)]


def test_no_row_is_missing():
    """Both tables are read whole, and in order."""
    numbers = [row["no"] for row in ROWS]
    assert numbers == [f"A{number}" for number in range(1, 26)] + [f"B{number}" for number in range(1, 29)]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["no"])
def test_an_attack_has_its_tests_and_its_sentences(row):
    """The tests are there, and each sentence is part of one of them."""
    assert all(row.values())
    assert [why_none(proof) for proof in proofs_of(row) if why_none(proof)] == []
    assert missing(row) == []


def test_a_sentence_that_nothing_asserts_is_found():
    """The look at sentences is no formality."""
    assert missing({**ROWS[0], "response": "`SIMULATED: psu1` … `all is well`"}) == ["all is well"]


def test_nothing_unpacks_archives_reads_xml_or_makes_objects_of_bytes():
    """No bomb, no entity and no path of an archive has anybody to read it; a report's XML and workbooks are written."""
    found = {
        path.relative_to(ROOT).as_posix(): READERS.findall(path.read_text(encoding="utf-8"))
        for path in (ROOT / "src/hil").rglob("*.py")
    }
    assert len(found) > 300
    assert {path: names for path, names in found.items() if names} == {}
