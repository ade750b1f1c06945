from __future__ import annotations

import hashlib
import math

import pytest

from hil.documents.canonical import JsonError, canonical, digest, parse_strict
from hil.documents.suggest import did_you_mean, nearest


def test_canonical_json_follows_rfc_8785():
    """The example of RFC 8785, section 3.2.2, comes out byte by byte."""
    value = {
        "numbers": [333333333.33333329, 1e30, 4.50, 2e-3, 0.000000000000000000000000001],
        "string": "\u20ac$\u000f\u000aA'\u0042\u0022\u005c\\\"/",
        "literals": [None, True, False],
    }
    assert (
        canonical(value)
        == (
            '{"literals":[null,true,false],"numbers":[333333333.3333333,1e+30,4.5,0.002,1e-27],'
            '"string":"€$\\u000f\\nA\'B\\"\\\\\\\\\\"/"}'
        ).encode()
    )


def test_a_digest_is_the_hash_of_the_canonical_bytes():
    """Order of keys does not matter, minus zero is zero."""
    assert digest({"b": 1, "a": -0.0}) == hashlib.sha256(b'{"a":0,"b":1}').hexdigest()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, [math.nan], {"a": math.inf}])
def test_what_is_no_number_is_not_written(value):
    """NaN and infinity are refused with what to write instead."""
    with pytest.raises(JsonError, match="NaN and infinity are not allowed in JSON; write null"):
        canonical(value)


@pytest.mark.parametrize("value", [2**53, {1: 2}, {"a": object()}, "\ud800", {"\ud800": 1}])
def test_what_json_cannot_hold_is_not_written(value):
    """Large integers, keys that are no text, objects and half characters are refused."""
    with pytest.raises(JsonError, match="cannot be written as canonical JSON"):
        canonical(value)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b'{"a": 1, "a": 2}', "duplicate key 'a'"),
        (b'{"a": NaN}', "NaN is not allowed"),
        (b"[Infinity]", "Infinity is not allowed"),
        (b"[-Infinity]", "-Infinity is not allowed"),
        (b"[1e400]", "1e400 is too large"),
        (b"[1,\n2", "not JSON at line 2, column 2"),
        (b'["\xff"]', "not UTF-8 at byte 2"),
        (b"[" * 200_000, "nested too deeply"),
        (b"1" * 10_000, "is too large"),
        (b"[9007199254740993]", "more digits than a number can hold"),
        (b"{", "not JSON at line 1, column 2"),
    ],
)
def test_json_that_hides_something_is_refused(data, message):
    """Duplicate keys, NaN, overflow and broken text raise one error with the reason."""
    with pytest.raises(JsonError, match=message):
        parse_strict(data)


def test_json_comes_back_as_it_was_written():
    """What was written canonically is read as the same value."""
    value = {"a": [1, 2.5, None, True, "ü", 2.0**53, -1e20, 2**53 - 1], "b": {}}
    assert parse_strict(canonical(value)) == value


def test_the_nearest_word_is_suggested():
    """A near word is named, also when only its case differs; a far one is not."""
    assert did_you_mean("hihg", ["low", "high"]) == ", did you mean 'high'?"
    assert did_you_mean("adcs-gyr-010", ["ADCS-GYR-010"]) == ", did you mean 'ADCS-GYR-010'?"
    assert did_you_mean("zzz", ["low", "high"]) == ""
    assert nearest("x", []) == ""
