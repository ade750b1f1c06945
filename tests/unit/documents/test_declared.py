from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Literal

import pytest
from pydantic import BaseModel, Field

from hil.documents.declared import Invalid, read_document, validated
from hil.documents.findings import Findings
from hil.model.errors import ConfigurationError
from hil.model.notation import (
    NAMED,
    AnyText,
    ByName,
    DecimalText,
    Flag,
    Hertz,
    Number,
    Plain,
    Seconds,
    Text,
    matching,
    number,
    one_of,
    whole,
)


class Colour(StrEnum):
    """An enumeration of words."""

    RED = "red"
    GREEN = "green"


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """A section."""

    low: Number | None = field(default=None, metadata={"alias": "min"})
    high: Number = field(metadata={"alias": "max"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """An entry under a name."""

    name: str = field(default="", metadata=NAMED)
    driver: Text
    truth: Mapping[str, Plain] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Everything:
    """A field of every notation."""

    note: AnyText = ""
    title: Text = ""
    decimal: DecimalText = "0"
    high: Number = 0.0
    address: Annotated[int, whole()] = 0
    rev: Annotated[int, whole(minimum=1)] = 1
    dut: Flag = False
    period: Seconds = 0.0
    rate: Hertz = 1.0
    axes: tuple[Text, ...] = ()
    serial: Annotated[str, matching("[A-Z]+-[0-9]{3}", "a serial such as EM-001")] = ""
    decision: Annotated[str, one_of("simple", "guarded")] = "simple"
    colour: Colour = Colour.RED
    side: Literal["left", "right"] = "left"
    limits: Limits | None = None
    clamps: tuple[Limits, ...] = ()
    entries: Annotated[tuple[Entry, ...], ByName()] = ()
    contacts: Mapping[str, Annotated[int, whole()]] = field(default_factory=dict)
    share: Annotated[float, number(0.0, 1.0)] = 0.0
    gain: Annotated[float, number(above=0.0)] = 1.0
    station: Annotated[int, whole(1, 247)] = 1
    field: tuple[Number, Number] = (0.0, 0.0)


@pytest.fixture
def read(tmp_path):
    """Read a text as a document of every notation; the schema is on its last line."""

    def read(text, model=Everything):
        file = tmp_path / "bench.yaml"
        file.write_text(f"{text}\nschema: hil/bench/1\n", encoding="utf-8")
        findings = Findings()
        document = read_document(file, "bench.yaml", findings, model, schema="hil/bench/1")
        return document, [str(finding) for finding in findings]

    return read


def test_values_come_in_the_type_that_is_declared(read):
    """Every notation is read, quoted or not where both are allowed."""
    document, told = read(
        "title: coil\ndecimal: '2.50'\nhigh: '2.50'\naddress: '0x1E'\nrev: 3\ndut: true\nperiod: 10 ms\nrate: 400 kHz\n"
        "axes: [x, y]\nserial: EM-001\ndecision: guarded\ncolour: green\nside: right\nlimits: {min: '-1', max: '1e3'}\n"
        "clamps: [{max: '1'}]\nentries: {psu1: {driver: korad, truth: {offset: ['1.5'], on-air: true}}}\n"
        "contacts: {k1: 0x10}"
    )
    assert told == []
    assert document.model == Everything(
        title="coil",
        decimal="2.50",
        high=2.5,
        address=30,
        rev=3,
        dut=True,
        period=0.01,
        rate=400_000.0,
        axes=("x", "y"),
        serial="EM-001",
        decision="guarded",
        colour=Colour.GREEN,
        side="right",
        limits=Limits(low=-1.0, high=1000.0),
        clamps=(Limits(high=1.0),),
        entries=(Entry(name="psu1", driver="korad", truth={"offset": ["1.5"], "on-air": True}),),
        contacts={"k1": 16},
    )


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("4 h", 14400.0), ("0.1 s", 0.1), ("90 d", 7776000.0), ("2 min", 120.0), ("250us", 0.00025), ("0 s", 0.0)],
)
def test_durations_are_exact_seconds(read, text, seconds):
    """A duration is a number with a unit of time."""
    assert read(f"period: {text}")[0].model.period == seconds


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("high: 5", "1:7: bench: 'high' must be a number in quotes, found `5`, write it in quotes: \"5\""),
        ("high: five", "1:7: bench: 'high' must be a decimal number in quotes, found `five`"),
        ("high: 'NaN'", "1:7: bench: 'high' must be a decimal number in quotes, found \"NaN\""),
        ("high: 'inf'", "1:7: bench: 'high' must be a decimal number in quotes, found \"inf\""),
        ("high: '1e-400'", "1:7: bench: 'high' is too small for a number, found \"1e-400\""),
        ("high: '5e-324'", "1:7: bench: 'high' is too small for a number, found \"5e-324\""),
        ("high: '1e400'", "1:7: bench: 'high' is too large for a number, or too long, found \"1e400\""),
        ("decimal: '0x10'", "1:10: bench: 'decimal' must be a decimal number in quotes, found \"0x10\""),
        ("high: true", "1:7: bench: 'high' must be a number in quotes, found `true`"),
        ("high: {a: b}", "1:7: bench: 'high' must be a number in quotes, found a mapping"),
        ("high: [a]", "1:7: bench: 'high' must be a number in quotes, found a list"),
        ("rev: '1.5'", "1:6: bench: 'rev' must be a whole number, decimal or with 0x, found \"1.5\""),
        ("rev: '017'", "1:6: bench: 'rev' must be a whole number, decimal or with 0x, found \"017\""),
        ("rev: true", "1:6: bench: 'rev' must be a whole number, decimal or with 0x, found `true`"),
        ("rev: 0", "1:6: bench: 'rev' must be at least 1, found `0`"),
        (f"rev: {'9' * 5000}", "1:6: bench: 'rev' must be a whole number with fewer digits, found `999"),
        ("dut: 'true'", "1:6: bench: 'dut' must be true or false without quotes, found \"true\""),
        ("dut: 1", "1:6: bench: 'dut' must be true or false without quotes, found `1`"),
        ("title: 12", "1:8: bench: 'title' must be text, found `12`, write it in quotes: \"12\""),
        ("title: true", "1:8: bench: 'title' must be text, found `true`, write it in quotes: \"true\""),
        ("title: ''", "1:8: bench: 'title' must not be empty"),
        ("title:", "1:7: bench: 'title' has no value: give it one, or leave the key out"),
        ("limits:", "1:8: bench: 'limits' has no value: give it one, or leave the key out"),
        ("title: [a]", "1:8: bench: 'title' must be text, found a list"),
        ("period: 4 hours", "the unit 'hours' is not one of us, µs, ms, s, min, h, d"),
        ("period: '4'", "1:9: bench: 'period' must be a duration such as 10 ms, 4 h or 90 d, found \"4\""),
        ("rate: 0 Hz", "1:7: bench: 'rate' must be a frequency above zero"),
        ("axes: x", "1:7: bench: 'axes' must be a list, found `x`"),
        ("axes: [a, 1]", '1:11: axes: entry 2 must be text, found `1`, write it in quotes: "1"'),
        ("serial: EM-001x", "1:9: bench: 'serial' must be a serial such as EM-001, found `EM-001x`"),
        (
            "decision: gaurded",
            "1:11: bench: 'decision' must be one of simple, guarded, found `gaurded`, did you mean 'guarded'?",
        ),
        ("colour: gren", "1:9: bench: 'colour' must be one of red, green, found `gren`, did you mean 'green'?"),
        ("side: lfet", "1:7: bench: 'side' must be one of left, right, found `lfet`, did you mean 'left'?"),
        ("limits: x", "1:9: bench: 'limits' must be a mapping, found `x`"),
        ("limits: {mni: '1', max: '2'}", "1:10: unknown key 'mni', did you mean 'min'?"),
        ("limits: {min: '1'}", "1:9: limits: key 'max' is missing"),
        ("clamps: {max: '1'}", "1:9: bench: 'clamps' must be a list, found a mapping"),
        ("clamps: [{max: '1'}, text]", "1:22: clamps: entry 2 must be a mapping, found `text`"),
        ("clamps: [{max: '1', min: 2}]", "1:26: clamps: 'min' must be a number in quotes, found `2`"),
        ("entries: {psu1: {}}", "1:17: entries psu1: key 'driver' is missing"),
        ("entries: {psu1: {driver: a, name: b}}", "1:29: unknown key 'name'"),
        ("entries: {psu1: {driver: a, truth: {gain: [3]}}}", "1:44: truth gain: entry 1 must be text, found `3`"),
        ("contacts: {k1: one}", "1:16: contacts: 'k1' must be a whole number"),
        ("share: '1.5'", "1:8: bench: 'share' must be at most 1, found \"1.5\""),
        ("share: '-1'", "1:8: bench: 'share' must be at least 0, found \"-1\""),
        ("gain: '0'", "1:7: bench: 'gain' must be above 0, found \"0\""),
        ("station: 248", "1:10: bench: 'station' must be at most 247, found `248`"),
        ("field: ['1']", "1:8: field: entry 2 is missing"),
        ("field: ['1', '2', '3']", "1:8: bench: 'field' may have 2 entries at most"),
        ("hihg: '2'", "1:1: unknown key 'hihg', did you mean 'high'?"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_a_finding_at_its_place(read, text, expected):
    """Where, what was found, and what to write instead."""
    document, told = read(text)
    assert len(told) == 1, told
    assert expected in told[0]
    assert told[0].startswith("bench.yaml:1:")
    assert document is not None


def test_everything_is_told_at_once_and_the_rest_is_read(read):
    """What can be read is there, and what cannot is blank, so that checks between sections still see the rest."""
    document, told = read("high: 5\ntitel: coil\naxes: [x, 1]\nclamps:\n- {min: '3'}\nentries: {a: {driver: 7}}")
    assert [one.partition(": ")[0] for one in told] == [
        "bench.yaml:1:7", "bench.yaml:3:11", "bench.yaml:5:3", "bench.yaml:6:23", "bench.yaml:2:1",
    ]  # fmt: skip
    assert document.model.axes == ("x", "")
    assert document.model.clamps == (Limits(low=3.0, high=0.0),)
    assert document.model.entries == (Entry(name="a", driver=""),)


def test_places_serve_findings_that_are_made_later(read):
    """A value has its place, an entry that of its name, and what is missing that of its nearest parent."""
    document, _ = read(
        "high: '2'\nlimits:\n  max: '3'\nclamps:\n- {max: '1'}\n- {max: '2'}\nentries:\n  psu1:\n    driver: x"
    )

    def position(*path):
        place = document.place(path)
        return place.line, place.column

    assert position() == (1, 1)
    assert position("high") == (1, 7)
    assert position("limits") == (3, 3)
    assert position("limits", "max") == (3, 8)
    assert position("limits", "min") == (3, 3)
    assert position("clamps", 1) == (6, 3)
    assert position("clamps", 1, "max") == (6, 9)
    assert position("clamps", 2, "max") == (5, 1)
    assert position("high", "deeper") == (1, 7)
    assert position("entries", "psu1") == (8, 3)
    assert position("entries", "psu1", "driver") == (9, 13)


def test_a_hundred_unknown_keys_are_told_and_the_others_counted(read):
    """A file that is something else altogether does not fill the screen."""
    _, told = read("\n".join(f"key{number}: x" for number in range(250)))
    assert len(told) == 101
    assert told[-1] == "bench.yaml:1:1: bench: 150 more unknown keys"


def test_a_document_says_its_schema(tmp_path):
    """The right schema opens the document; any other is a clear finding."""
    findings = Findings()

    def read(text):
        file = tmp_path / "bench.yaml"
        file.write_text(text)
        return read_document(file, "bench.yaml", findings, Everything, schema="hil/bench/1")

    assert read("schema: hil/bench/2\n") is None
    assert read("schema: hil/plan/1\n") is None
    assert read("- a\n") is None
    with pytest.raises(ConfigurationError) as error:
        findings.raise_if_any()
    text = str(error.value)
    assert "bench.yaml:1:9: this version of hil reads schema 'hil/bench/1', not 'hil/bench/2'" in text
    assert "bench.yaml:1:9: schema must be 'hil/bench/1' here, found 'hil/plan/1'" in text
    assert "bench.yaml:1:1: bench must be a mapping, found a list" in text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("title: coil\n", ["bench.yaml:1:1: bench: key 'schema' is missing"]),
        ("schema: [a]\n", ["bench.yaml:1:9: bench: 'schema' must be text, found a list"]),
        (
            "shcema: hil/bench/1\n",
            [
                "bench.yaml:1:1: bench: key 'schema' is missing",
                "bench.yaml:1:1: unknown key 'shcema', did you mean 'schema'?",
            ],
        ),
    ],
)
def test_a_document_without_schema_is_still_read(tmp_path, text, expected):
    """A forgotten schema is one finding among the others."""
    file = tmp_path / "bench.yaml"
    file.write_text(text)
    findings = Findings()
    assert read_document(file, "bench.yaml", findings, Everything, schema="hil/bench/1") is not None
    assert [str(finding) for finding in findings] == expected


class Noise(BaseModel):
    """What a package outside of hil may declare: a model of the library's own kind."""

    density: Annotated[Number, Field(gt=0)]
    seed: int = 0
    kind: Literal["white", "pink"] = "white"
    ports: list[str] = []


def test_a_part_is_validated_against_the_model_of_who_it_is_for():
    """An outside package declares its settings, and gets paths, sentences and suggestions."""
    assert validated(Noise, {"density": "0.5", "kind": "pink"}, "plant cell") == Noise(density=0.5, kind="pink")
    with pytest.raises(Invalid) as error:
        validated(
            Noise, {"density": "-1", "kidn": "pink", "ports": [True]}, "plant cell", ("simulated", "plants", "cell")
        )
    assert [(problem.path[3:], problem.message, problem.of_key) for problem in error.value.problems] == [
        (("density",), "plant cell: 'density' must be above 0, found \"-1\"", False),
        (("ports", 0), 'ports: entry 1 must be text, found `true`, write it in quotes: "true"', False),
        (("kidn",), "unknown key 'kidn', did you mean 'kind'?", True),
    ]
    assert str(error.value).startswith("plant cell: 'density' must be above 0")
