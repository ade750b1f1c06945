"""JUnit XML of a run for continuous integration, with requirements as properties."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree import ElementTree as ET

from hil.evidence.events import Check
from hil.evidence.results.outcome import CaseOutcome, Outcome
from hil.model.verdict import Verdict
from hil.report.sentences import warnings
from hil.report.summary import check_lines

__all__ = ["junit", "junit_of_damage"]

# What XML 1.0 cannot hold (its production 2), and marks that reorder text.
_UNFIT = re.compile(
    "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]|[\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
_FAILED = frozenset({Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})
_BROKEN = frozenset({Verdict.ERROR, Verdict.ABORTED})


def junit(results: Outcome, *, run: str, began: str, evidence_digest: str) -> bytes:
    """Return the run as JUnit XML: one test case per case, counted by its verdict.

    Args:
        results: the run's results.
        run: its name.
        began: UTC of its first event, ISO 8601.
        evidence_digest: what the reports name.
    """
    cases = results.cases
    verdicts = [case.verdict for case in cases]
    counts = {
        "tests": str(len(cases)),
        "failures": str(sum(word in _FAILED for word in verdicts)),
        "errors": str(sum(word in _BROKEN for word in verdicts)),
        "skipped": str(sum(word is Verdict.NOT_RUN for word in verdicts)),
        "time": _seconds(sum(case.duration or 0.0 for case in cases)),
    }
    root = ET.Element("testsuites", {"name": "hil", **counts})
    name = _line((", ".join(results.run.plans) if results.run else "") or run)
    stamp = {"timestamp": _line(began.removesuffix("Z"))} if began else {}
    suite = ET.SubElement(root, "testsuite", {"name": name, **stamp, **counts})
    _properties(suite, _facts(results, run, evidence_digest))
    for case in cases:
        _case(suite, case)
    if told := "\n".join(f"{word}: {sentence}" for word, sentence in warnings(results)):
        ET.SubElement(suite, "system-err").text = _fit(told)  # what no case tells
    return _written(root)


def _written(root: ET.Element) -> bytes:
    ET.indent(root, space="")
    return bytes(ET.tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def junit_of_damage(run: str, sentence: str) -> bytes:
    """Return JUnit XML for a damaged package: one test case in error, and nothing about its cases.

    Args:
        run: the name of the run.
        sentence: what is wrong with the package.
    """
    counts = {"tests": "1", "failures": "0", "errors": "1", "skipped": "0", "time": _seconds(0.0)}
    root = ET.Element("testsuites", {"name": "hil", **counts})
    suite = ET.SubElement(root, "testsuite", {"name": _line(run), **counts})
    _properties(suite, [("run", run), ("verdict", "-")])
    case = ET.SubElement(suite, "testcase", classname="package", name=_line(run), time=_seconds(0.0))
    ET.SubElement(case, "error", {"type": "DAMAGED", "message": _line(sentence)})
    return _written(root)


def _facts(results: Outcome, run: str, evidence_digest: str) -> list[tuple[str, str]]:
    facts = results.run
    safe = {None: "not recorded", True: "true", False: "false"}[results.safe]
    return [
        ("run", run),
        ("verdict", results.verdict.value),
        ("evidence-digest", evidence_digest),
        ("content-digest", results.content_digest),
        ("bench", facts.bench if facts else ""),
        ("source", facts.source if facts else ""),
        ("purpose", facts.purpose if facts else ""),
        ("operator", facts.operator if facts else ""),
        ("dut", " ".join(part for part in (facts.dut.part, facts.dut.serial) if part) if facts else ""),
        ("interrupted", str(results.interrupted).lower()),
        ("tripped", str(results.tripped).lower()),
        ("safe", safe),
        *(("deviation", deviation) for deviation in (facts.deviations if facts else ())),
    ]


def _case(suite: ET.Element, case: CaseOutcome) -> None:
    word = case.verdict
    element = ET.SubElement(
        suite,
        "testcase",
        classname=_line(case.plan),
        name=_line(case.case),
        time=_seconds(case.duration or 0.0),
    )
    _properties(element, [*(("requirement", name) for name in case.requirements), ("verdict", word.value)])
    how = {"type": word.value, "message": _line("; ".join(case.reasons) or word.value)}
    if word in _FAILED or word in _BROKEN:
        told = [*case.reasons, *(line for check in case.checks for line in _told(check))]
        bad = ET.SubElement(element, "failure" if word in _FAILED else "error", how)
        bad.text = _fit("\n".join(told))
    elif word is Verdict.NOT_RUN:
        ET.SubElement(element, "skipped", how)


def _told(check: Check) -> Iterable[str]:
    return () if check.verdict.good else ("", *check_lines(check))


def _properties(element: ET.Element, pairs: Iterable[tuple[str, str]]) -> None:
    inside = ET.SubElement(element, "properties")
    for name, value in pairs:
        ET.SubElement(inside, "property", name=_line(name), value=_line(value))


def _seconds(duration: float) -> str:
    return f"{duration:.3f}"


def _fit(value: str) -> str:
    """Return a text without what XML cannot hold; everything else is escaped where the document is written."""
    return _UNFIT.sub("", value)


def _line(value: str) -> str:
    return re.sub(r"[\t\r\n]+", " ", _fit(value))
