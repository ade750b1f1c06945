from __future__ import annotations

import pytest

from hil.documents.findings import Findings
from hil.documents.reader import MappingReader, read_document
from hil.documents.strict_yaml import parse_yaml
from hil.model.errors import ConfigurationError


def reader_of(text):
    """Return a reader of a document."""
    findings = Findings()
    node = parse_yaml(text.encode(), "bench.yaml", findings)
    assert node is not None
    return MappingReader(node, findings, "clamp")


def messages(reader):
    """Return what was found so far."""
    return [str(finding) for finding in reader.findings]


def test_values_come_in_the_type_that_was_asked_for():
    """Texts, numbers, flags, durations and frequencies are read from their notation."""
    reader = reader_of(
        "name: coil\nhigh: '2.50'\naddress: 0x1e\nrev: 3\nquoted: '0x1E'\ndut: true\nperiod: 10 ms\n"
        "rate: 400 kHz\naxes: [x, y]\n"
    )
    assert reader.text("name") == "coil"
    assert reader.decimal("high") == "2.50"
    assert reader.number("high") == 2.5
    assert reader.integer("address") == 30
    assert reader.integer("quoted") == 30
    assert reader.integer("rev") == 3
    assert reader.flag("dut") is True
    assert reader.duration("period") == 0.01
    assert reader.frequency("rate") == 400_000.0
    assert reader.texts("axes") == ("x", "y")
    reader.done()
    assert messages(reader) == []


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("4 h", 14400.0), ("0.1 s", 0.1), ("90 d", 7776000.0), ("2 min", 120.0), ("250us", 0.00025), ("0 s", 0.0)],
)
def test_durations_are_exact_seconds(text, seconds):
    """A duration is a number with a unit of time."""
    assert reader_of(f"period: {text}\n").duration("period") == seconds


def test_missing_keys_take_their_default_or_are_findings():
    """A key without a default must be there, and reading goes on without it."""
    reader = reader_of("name: coil\n")
    assert reader.text("note", "") == ""
    assert reader.number("low", None) is None
    assert reader.number("high") == 0.0
    assert reader.child("envelope") is None
    assert reader.children("clamps", required=True) == []
    assert messages(reader) == [
        "bench.yaml:1:1: clamp: key 'high' is missing",
        "bench.yaml:1:1: clamp: key 'clamps' is missing",
    ]


@pytest.mark.parametrize(
    ("text", "method", "expected"),
    [
        ("high: 5", "number", 'must be a number in quotes, found `5`, write it in quotes: "5"'),
        ("high: five", "number", "must be a decimal number in quotes, found `five`"),
        ("high: 'NaN'", "number", "must be a decimal number in quotes"),
        ("high: 'inf'", "number", "must be a decimal number in quotes"),
        ("high: '1e400'", "number", "is too large for a number"),
        ("high: '0x10'", "decimal", "must be a decimal number in quotes"),
        ("high: true", "number", "must be a decimal number in quotes, found `true`"),
        ("high: '1.5'", "integer", "must be a whole number"),
        ("high: '017'", "integer", "must be a whole number"),
        ("high: 'true'", "flag", 'must be true or false without quotes, found "true"'),
        ("high: 1", "flag", "must be true or false without quotes"),
        ("high: 12", "text", 'must be text, found `12`, write it in quotes: "12"'),
        ("high: true", "text", "must be text, found `true`"),
        ("high: ''", "text", "must not be empty"),
        ("high:", "text", "has no value, text is expected"),
        ("high: [a]", "text", "must be text, found a list"),
        ("high: {a: b}", "number", "must be a number in quotes, found a mapping"),
        ("high: 4 hours", "duration", "the unit 'hours' is none of us, µs, ms, s, min, h, d"),
        ("high: '4'", "duration", "must be a duration such as 10 ms"),
        ("high: 0 Hz", "frequency", "must be a frequency above zero"),
        ("high: x", "texts", "must be a list of texts, found `x`"),
        ("high: [1]", "texts", "must be text, found `1`"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_a_finding_at_its_place(text, method, expected):
    """What was found and how to write it is said with the place of the value."""
    reader = reader_of(f"{text}\n")
    getattr(reader, method)("high")
    assert len(messages(reader)) == 1
    assert expected in messages(reader)[0]
    assert messages(reader)[0].startswith("bench.yaml:1:")


def test_an_unknown_key_names_the_missing_one_it_resembles():
    """A misspelt key is found, with the nearest key that nobody gave."""
    reader = reader_of("low: '1'\nhihg: '2'\n")
    reader.number("low")
    reader.number("high", None)
    reader.done()
    assert messages(reader) == ["bench.yaml:2:1: unknown key 'hihg', did you mean 'high'?"]


def test_a_wrong_choice_names_the_nearest():
    """The allowed words and the nearest of them are named."""
    reader = reader_of("decision: gaurded\n")
    assert reader.text("decision", choices=("simple", "guarded")) == ""
    assert messages(reader) == [
        "bench.yaml:1:11: clamp: 'decision' must be one of simple, guarded, found 'gaurded', did you mean 'guarded'?"
    ]


def test_a_pattern_must_match_the_whole_text():
    """A text that only begins well is refused."""
    reader = reader_of("id: ADCS-001x\n")
    reader.text("id", pattern=r"[A-Z]+-[0-9]{3}")
    assert "must look like [A-Z]+-[0-9]{3}, found 'ADCS-001x'" in messages(reader)[0]


def test_inner_mappings_are_read_by_readers_of_their_own():
    """Child, children and entries give readers; what is no mapping is a finding."""
    reader = reader_of("safe: {state: off-now}\nclamps:\n- {high: '1'}\n- text\nplants:\n  cell: {model: ocv}\n")
    child = reader.child("safe")
    assert child is not None
    assert child.text("state") == "off-now"
    first, second = reader.children("clamps")
    assert first.number("high") == 1.0
    assert second.keys() == ()
    [(name, plant)] = reader.entries("plants")
    assert (name.text, plant.text("model")) == ("cell", "ocv")
    assert messages(reader) == ["bench.yaml:4:3: clamps must be a mapping, found `text`"]


def test_a_list_of_mappings_must_be_a_list():
    """A mapping where a list belongs is named."""
    reader = reader_of("clamps: {high: '1'}\n")
    assert reader.children("clamps") == []
    assert messages(reader) == ["bench.yaml:1:9: clamp: 'clamps' must be a list of mappings, found a mapping"]


def test_a_root_that_is_no_mapping_gives_one_finding():
    """Nothing is said of keys where there cannot be any."""
    reader = reader_of("- a\n")
    reader.text("name")
    reader.done()
    assert messages(reader) == ["bench.yaml:1:1: clamp must be a mapping, found a list"]


def test_plain_data_keeps_numbers_as_quoted_text():
    """Free-form sections become plain data; a bare number has to be quoted."""
    reader = reader_of("truth: {offset: ['1.5', '-2'], on-air: true, name: em}\nother: {gain: 3}\n")
    assert reader.plain("truth") == {"offset": ["1.5", "-2"], "on-air": True, "name": "em"}
    reader.plain("other")
    assert messages(reader) == ['bench.yaml:2:15: clamp: must be text, found `3`, write it in quotes: "3"']


def test_places_serve_findings_that_are_raised_later():
    """The place of a value, or of the mapping where the key is missing."""
    reader = reader_of("low: '1'\nhigh: '2'\n")
    assert (reader.place("high").line, reader.place("high").column) == (2, 7)
    assert (reader.place("none").line, reader.place("none").column) == (1, 1)
    assert reader.has("low")
    assert not reader.has("none")


def test_a_document_says_its_schema(tmp_path):
    """The right schema opens the document; any other is a clear finding."""
    findings = Findings()

    def read(text):
        file = tmp_path / "bench.yaml"
        file.write_text(text)
        return read_document(file, "bench.yaml", findings, schema="hil/bench/1")

    reader = read("schema: hil/bench/1\nname: flight\n")
    assert reader is not None
    assert reader.text("name") == "flight"
    reader.done()
    assert list(findings) == []
    assert read("schema: hil/bench/2\n") is None
    assert read("schema: hil/plan/1\n") is None
    assert read("- a\n") is None
    with pytest.raises(ConfigurationError) as error:
        findings.raise_if_any()
    text = str(error.value)
    assert "bench.yaml:1:9: this version of hil reads schema 'hil/bench/1', not 'hil/bench/2'" in text
    assert "bench.yaml:1:9: schema must be 'hil/bench/1' here, found 'hil/plan/1'" in text
    assert "bench.yaml:1:1: bench must be a mapping, found a list" in text


def test_a_document_without_schema_is_still_read(tmp_path):
    """A forgotten schema is one finding among the others."""
    file = tmp_path / "bench.yaml"
    file.write_text("name: flight\n")
    findings = Findings()
    reader = read_document(file, "bench.yaml", findings, schema="hil/bench/1")
    assert reader is not None
    assert [str(finding) for finding in findings] == ["bench.yaml:1:1: bench: key 'schema' is missing"]


def test_a_whole_number_may_have_a_minimum():
    """A number below it is a finding, and the placeholder is the minimum."""
    reader = reader_of("rev: 0\n")
    assert reader.integer("rev", minimum=1) == 1
    assert messages(reader) == ["bench.yaml:1:6: clamp: 'rev' must be at least 1, found `0`"]
