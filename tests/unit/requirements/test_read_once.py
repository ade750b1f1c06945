"""Equal files are read once, and nothing that differs is taken for equal."""

from __future__ import annotations

from hil.documents import declared
from hil.documents.findings import Findings
from hil.requirements.schema import parse_requirements

TEXT = """\
schema: hil/requirements/1
document: {id: LOAD, issue: "1.0"}
requirements:
- id: LOAD-777
  rev: 1
  text: The load shall be there.
  kind: limit
  method: test
  limits:
  - {parameter: resistance, unit: ohm, min: "90", max: "110"}
"""


def test_equal_contents_are_read_once(monkeypatch):
    """The second time nothing is parsed, and what is returned knows its own place."""
    first = parse_requirements(TEXT.encode(), "a.yaml", "load", Findings())
    monkeypatch.setattr(declared, "parse_document", None)
    again = parse_requirements(TEXT.encode(), "b.yaml", "load", Findings())
    assert first is not None
    assert again is not None
    assert [item.place.path for item in (*first.requirements, *again.requirements)] == ["a.yaml", "b.yaml"]
    assert again.requirements[0].place.line == 4
    assert again.requirements[0].fingerprint == first.requirements[0].fingerprint


def test_what_differs_is_read():
    """One digit of a limit, and the plan."""
    limits = [
        parse_requirements(text.encode(), "a.yaml", plan, Findings()).requirements[0]
        for text, plan in ((TEXT, "load"), (TEXT.replace("110", "111"), "load"), (TEXT, "other"))
    ]
    assert [(item.limits[0].maximum, item.plan) for item in limits] == [
        ("110", "load"),
        ("111", "load"),
        ("110", "other"),
    ]


def test_what_is_wrong_is_told_every_time():
    """Both readers of a damaged file hear of it, each with its own path."""
    told = []
    for path in ("a.yaml", "b.yaml"):
        findings = Findings()
        parse_requirements(TEXT.replace("rev: 1", "rev: one").encode(), path, "load", findings)
        told.append([(each.path, each.line) for each in findings])
    assert told == [[("a.yaml", 5)], [("b.yaml", 5)]]
