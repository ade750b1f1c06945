from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.documents.declared import read_document, validated
from hil.documents.findings import Findings
from hil.documents.strict_yaml import parse_yaml
from hil.model.notation import DecimalText, Number, Plain
from hil.requirements.units import UnitError, check_unit, convert


@dataclass(frozen=True, slots=True, kw_only=True)
class Anything:
    """A model of a few notations."""

    text: DecimalText = "0"
    numbers: tuple[Number, ...] = ()
    rest: Mapping[str, Plain] = field(default_factory=dict)


steady = settings(derandomize=True)

_JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53) + 1, 2**53 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


@steady
@given(_JSON)
def test_canonical_json_is_its_own_canonical_form(value):
    """What is read back writes the same bytes, and any JSON reader understands them."""
    data = canonical(value)
    assert canonical(parse_strict(data)) == data
    assert json.loads(data, parse_int=float) == parse_strict(data)


@steady
@given(st.binary(max_size=200))
def test_any_bytes_are_a_document_or_findings(data):
    """Nothing that is in a file becomes a traceback."""
    findings = Findings()
    node = parse_yaml(data, "any.yaml", findings)
    assert node is not None or len(findings) > 0


@steady
@given(st.binary(max_size=200))
def test_any_document_is_a_model_or_findings(tmp_path_factory, data):
    """Whatever a file says is read into the model, or told, and nothing else happens."""
    file = tmp_path_factory.getbasetemp() / "any.yaml"
    file.write_bytes(b"schema: hil/any/1\nnumbers: " + data)
    findings = Findings()
    document = read_document(file, "any.yaml", findings, Anything, schema="hil/any/1")
    assert document is not None or len(findings) > 0


@steady
@given(st.text(alphabet="aAbB01.-+_:~!&*<>[]{}#|\"'\n \tyesnoNO%@`,?=", max_size=60))
def test_any_text_is_a_document_or_findings(text):
    """The characters that mean something in YAML, in any order."""
    findings = Findings()
    node = parse_yaml(text.encode(), "any.yaml", findings)
    assert node is not None or len(findings) > 0


@steady
@given(st.binary(max_size=60))
def test_any_bytes_are_json_or_one_error(data):
    """The strict reader raises its own error only."""
    with contextlib.suppress(JsonError):
        parse_strict(data)


@steady
@given(st.decimals(allow_nan=False, allow_infinity=False, places=6, min_value=-(10**9), max_value=10**9))
def test_quoted_decimals_come_back_as_written(number):
    """The text is kept, and the float is the nearest one."""
    found = validated(Anything, {"text": str(number), "numbers": [str(number)]}, "limit")
    assert found.text == str(number)
    assert found.numbers == (float(number),)


@steady
@given(st.text(alphabet="VAWhsmkdegrC1/*.^()√²-% ", max_size=20))
def test_any_text_is_a_unit_or_an_error(text):
    """The parser behind never shows through."""
    if check_unit(text) is None:
        assert convert(1.0, text, text) == 1.0
    else:
        with pytest.raises(UnitError):
            convert(1.0, text, text)


@steady
@given(st.floats(-1e6, 1e6), st.sampled_from([("deg", "rad"), ("mV", "V"), ("W.h", "J"), ("deg/√h", "deg/s/√Hz")]))
def test_conversions_run_backwards(value, units):
    """There and back is the same number, within rounding."""
    one, other = units
    assert convert(convert(value, one, other), other, one) == pytest.approx(value, rel=1e-12, abs=1e-300)
