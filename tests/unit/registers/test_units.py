"""The register of devices under test: who is who, and who is not there."""

from __future__ import annotations

import pytest

from hil.documents.findings import Findings
from hil.model.errors import Refused
from hil.model.identity import Model, UnitEventKind
from hil.registers.units import find_dut, load_duts

HEAD = "schema: hil/duts/1\nduts:\n"
GOOD = '- {serial: SN-1, part: P-2, model: FM, hardware: "B", firmware: "1.4", recognised: {mag1: LIS3MDL}}\n'


def load(tmp_path, rows: str):
    """Return what a register holds, and what is wrong with it."""
    (tmp_path / "duts.yaml").write_text(HEAD + rows, encoding="utf-8")
    findings = Findings()
    duts = load_duts(tmp_path / "duts.yaml", "fixtures/duts.yaml", findings)
    return duts, [str(finding) for finding in findings]


def test_register_is_read_whole(tmp_path):
    """Every field arrives, and what is not said is empty."""
    duts, wrong = load(tmp_path, GOOD + '- {serial: SN-2, part: P-2, model: EM, hardware: "A", simulated: true}\n')
    assert wrong == []
    first, second = duts
    assert (first.serial, first.part, first.model, first.hardware) == ("SN-1", "P-2", Model.FM, "B")
    assert (first.firmware, first.simulated, first.recognised) == ("1.4", False, {"mag1": "LIS3MDL"})
    assert (second.firmware, second.title, second.simulated, second.recognised) == ("", "", True, {})


def test_serial_number_in_the_register_twice(tmp_path):
    """Two articles of one serial number are told at the second; the first stays."""
    duts, wrong = load(tmp_path, GOOD + GOOD.replace("P-2", "P-3"))
    assert wrong == ["fixtures/duts.yaml:4:12: serial number 'SN-1' is in the register twice"]
    assert [dut.part for dut in duts] == ["P-2"]
    _, wrong = load(tmp_path, GOOD + GOOD.replace("SN-1", "sn-1"))
    assert wrong == ["fixtures/duts.yaml:4:12: serial number 'sn-1' is in the register as 'SN-1' already"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FM", "XM", "3:36: duts: 'model' must be one of EM, QM, FM, found `XM`"),
        ("model: FM", "modle: FM", "3:29: unknown key 'modle', did you mean 'model'?"),
        ("SN-1", "-1 x", "duts: 'serial' must be letters, digits"),
        ('"B"', "2", "duts: 'hardware' must be text, found `2`"),
        ("{mag1: LIS3MDL}", "[mag1]", "duts: 'recognised' must be a mapping, found a list"),
    ],
)
def test_wrong_entry_has_a_place(tmp_path, old, new, message):
    """Models, keys and serial numbers that cannot be are told with their place."""
    _, wrong = load(tmp_path, GOOD.replace(old, new))
    assert any(message in line for line in wrong), wrong


def test_entries_without_serial_number_are_no_duplicates(tmp_path):
    """Two entries that lack it are told so, once each."""
    _, wrong = load(tmp_path, GOOD.replace("serial: SN-1, ", "") * 2)
    assert [line.split(": ", 1)[1] for line in wrong] == ["duts: key 'serial' is missing"] * 2


def test_file_that_is_no_register(tmp_path):
    """A missing file, or one of another schema, is a finding and holds nobody."""
    findings = Findings()
    assert load_duts(tmp_path / "none.yaml", "fixtures/none.yaml", findings) == ()
    assert [str(finding) for finding in findings] == ["fixtures/none.yaml: the file is missing"]
    (tmp_path / "other.yaml").write_text("schema: hil/bench/1\n", encoding="utf-8")
    assert load_duts(tmp_path / "other.yaml", "fixtures/other.yaml", findings) == ()
    assert "schema must be 'hil/duts/1' here" in str(list(findings)[-1])


def test_unknown_article_names_the_nearest(tmp_path):
    """A serial number that is not registered is refused, with the one that was meant, and all there are."""
    duts, _ = load(tmp_path, GOOD)
    assert find_dut(duts, "SN-1", "fixtures/duts.yaml").part == "P-2"
    expected = "no device under test 'SN1' in fixtures/duts.yaml, did you mean 'SN-1'.*registered are: SN-1"
    with pytest.raises(Refused, match=expected):
        find_dut(duts, "SN1", "fixtures/duts.yaml")
    with pytest.raises(Refused, match="registered are: none"):
        find_dut((), "SN1", "fixtures/duts.yaml")


EVENT = '{kind: repair, date: "2026-05-02", until: "2026-05-03", text: New connector, reference: NCR-7, reverify: true}'


def with_events(*events: str) -> str:
    """Return the row of an article to which this was done."""
    return GOOD[:-2].replace("LIS3MDL}", "LIS3MDL}, events: [" + ", ".join(events) + "]}") + "\n"


def test_events_of_an_article(tmp_path):
    """What was done to an article arrives, with its last day."""
    (dut,), wrong = load(tmp_path, with_events(EVENT, EVENT.replace('until: "2026-05-03", ', "")))
    assert wrong == []
    first, second = dut.events
    assert (first.kind, first.date, first.last, first.reference, first.reverify) == (
        UnitEventKind.REPAIR,
        "2026-05-02",
        "2026-05-03",
        "NCR-7",
        True,
    )
    assert second.last == "2026-05-02"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("kind: repair", "kind: repairs", "'kind' must be one of repair, rework"),
        ('"2026-05-02"', '"2026-02-30"', "SN-1: the date 2026-02-30 does not exist"),
        ("2026-05-03", "2026-05-01", "SN-1: the repair ends on 2026-05-01, before it begins on 2026-05-02"),
        (", reverify: true", "", "key 'reverify' is missing"),
        (
            "NCR-7, reverify: true",
            '"", reverify: false',
            "SN-1: the repair of 2026-05-02 leaves earlier evidence valid: give the reference that decided so",
        ),
    ],
)
def test_wrong_event_has_a_place(tmp_path, old, new, message):
    """Kinds, days and decisions that cannot be are told with their place; nobody decides without a record."""
    assert old in EVENT
    _, wrong = load(tmp_path, with_events(EVENT.replace(old, new)))
    assert any(message in line and line.startswith("fixtures/duts.yaml:3:") for line in wrong), wrong
