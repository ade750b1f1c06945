"""JUnit XML: what continuous integration reads of a run, with requirements as properties."""

from __future__ import annotations

import re
from collections.abc import Iterable

from hil.model.verdict import Verdict
from hil.report.material import Body, flag, inner, inners, text, texts, verdict
from hil.report.sentences import warnings
from hil.report.summary import check_lines

__all__ = ["junit"]

# What XML 1.0 cannot hold (its production 2), and marks that reorder text.
_UNFIT = re.compile(
    "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]|[\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
_FAILED = frozenset({Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})
_BROKEN = frozenset({Verdict.ERROR, Verdict.ABORTED})


def junit(results: Body, *, run: str, began: str, evidence_digest: str) -> bytes:
    """Return the run as JUnit XML: one test case per case, counted by its verdict.

    Args:
        results: the run's results.
        run: its name.
        began: UTC of its first event, ISO 8601.
        evidence_digest: what the reports name.
    """
    cases = inners(results, "cases")
    verdicts = [verdict(case) for case in cases]
    counts = (
        f'tests="{len(cases)}" failures="{sum(word in _FAILED for word in verdicts)}"'
        f' errors="{sum(word in _BROKEN for word in verdicts)}"'
        f' skipped="{sum(word is Verdict.NOT_RUN for word in verdicts)}"'
        f' time="{_seconds(sum(_duration(case) for case in cases))}"'
    )
    name = _attribute(", ".join(texts(inner(results, "run"), "plans")) or run)
    stamp = f' timestamp="{_attribute(began.removesuffix("Z"))}"' if began else ""
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<testsuites name="hil" {counts}>',
        f'<testsuite name="{name}"{stamp} {counts}>',
        *_properties(_facts(results, run, evidence_digest)),
        *(line for case in cases for line in _case(case)),
        *_told_first(results),
        "</testsuite>",
        "</testsuites>",
    ]
    return ("\n".join(lines) + "\n").encode()


def _facts(results: Body, run: str, evidence_digest: str) -> list[tuple[str, str]]:
    facts = inner(results, "run")
    dut = inner(facts, "dut")
    safe = results.get("safe")
    return [
        ("run", run),
        ("verdict", text(results, "verdict")),
        ("evidence-digest", evidence_digest),
        ("content-digest", text(results, "content_digest")),
        ("bench", text(facts, "bench")),
        ("source", text(facts, "source")),
        ("purpose", text(facts, "purpose")),
        ("operator", text(facts, "operator")),
        ("dut", " ".join(part for part in (text(dut, "part"), text(dut, "serial")) if part)),
        ("interrupted", _flag(flag(results, "interrupted"))),
        ("tripped", _flag(flag(results, "tripped"))),
        ("safe", "not recorded" if safe is None else _flag(safe is True)),
        *(("deviation", deviation) for deviation in texts(facts, "deviations")),
    ]


def _told_first(results: Body) -> Iterable[str]:
    """Give what no case tells: that the run was interrupted, tripped, or did not leave the bench safe."""
    told = "\n".join(f"{word}: {sentence}" for word, sentence in warnings(results))
    if told:
        yield f"<system-err>{_content(told)}</system-err>"


def _case(case: Body) -> Iterable[str]:
    word = verdict(case)
    name, plan = _attribute(text(case, "case")), _attribute(text(case, "plan"))
    yield f'<testcase classname="{plan}" name="{name}" time="{_seconds(_duration(case))}">'
    yield from _properties([*(("requirement", name) for name in inner(case, "requirements")), ("verdict", word.value)])
    reasons = texts(case, "reasons")
    message = _attribute("; ".join(reasons) or word.value)
    if word in _FAILED or word in _BROKEN:
        element = "failure" if word in _FAILED else "error"
        told = "\n".join([*reasons, *(line for check in inners(case, "checks") for line in _told(check))])
        yield f'<{element} type="{word}" message="{message}">{_content(told)}</{element}>'
    elif word is Verdict.NOT_RUN:
        yield f'<skipped type="{word}" message="{message}"/>'
    yield "</testcase>"


def _told(check: Body) -> Iterable[str]:
    return () if verdict(check).good else ("", *check_lines(check))


def _properties(pairs: Iterable[tuple[str, str]]) -> Iterable[str]:
    yield "<properties>"
    for name, value in pairs:
        yield f'<property name="{_attribute(name)}" value="{_attribute(value)}"/>'
    yield "</properties>"


def _duration(case: Body) -> float:
    duration = case.get("duration")
    return float(duration) if isinstance(duration, int | float) else 0.0


def _seconds(duration: float) -> str:
    return f"{duration:.3f}"


def _flag(value: bool) -> str:
    return "true" if value else "false"


def _content(value: str) -> str:
    safe = _UNFIT.sub("", value)
    return safe.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _attribute(value: str) -> str:
    return re.sub(r"[\t\r\n]+", " ", _content(value)).replace('"', "&quot;")
