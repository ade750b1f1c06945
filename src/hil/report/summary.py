"""The last block on the terminal: what happened, what is wrong and where, and what the run can close."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from hil.documents.text import counted
from hil.evidence.events import Check
from hil.evidence.results.outcome import CaseOutcome, Outcome
from hil.model.verdict import Verdict
from hil.report.page.as_run import check_row
from hil.report.sentences import (
    closing_sentence,
    closings,
    headline,
    holds,
    in_short,
    source_word,
    uncovered_sentence,
    warnings,
)
from hil.report.tables import labelled

__all__ = ["check_lines", "closing_lines"]

_INDENT = "  "
_MOST_NAMED = 6  # requirements or cases of one group; the report names all


def closing_lines(results: Outcome) -> list[str]:
    """Return the closing block of a run, without colours; its first line begins with the verdict."""
    lines = [f"{results.verdict}  {headline(results)}"]
    lines += [f"{_INDENT}{said}: {sentence}" for said, sentence in warnings(results)]
    for cases in _alike(case for case in results.cases if not case.verdict.good):
        lines += ["", *(_case_lines(cases[0]) if len(cases) == 1 else _left_out(cases))]
    return [*lines, "", *_worth(results)]


def check_lines(check: Check) -> list[str]:
    """Return one check as a block: verdict and what it is of, then value, limit, margin, place and reason."""
    row = check_row(check)
    of = f" [{row.of}]" if row.of else ""
    value = row.value + (f", {row.coverage}" if row.coverage else "")
    limit = f"{row.limit}, {row.decision}" if row.limit else ""
    facts = (
        ("value", value),
        ("limit", limit),
        ("margin", row.margin),
        ("TUR", row.tur),
        ("case", row.case + (f", step {row.step}" if row.step else "")),
        ("instruments", row.instruments),
        ("reason", row.reason),
        ("closes nothing", "; ".join(row.closes_nothing)),
    )
    return [f"{row.verdict} {row.requirement} {row.parameter}{of}", *labelled(facts, indent=_INDENT)]


def _alike(cases: Iterable[CaseOutcome]) -> Iterable[list[CaseOutcome]]:
    """Group cases that were not run for the same reasons; every other one stays alone, and all in their order."""
    groups: dict[object, list[CaseOutcome]] = {}
    for case in cases:
        alone = case.verdict is not Verdict.NOT_RUN or bool(case.checks)
        groups.setdefault(case.case if alone else case.reasons, []).append(case)
    return groups.values()


def _left_out(cases: Sequence[CaseOutcome]) -> Iterator[str]:
    yield f"{Verdict.NOT_RUN} {counted(len(cases), 'case')}"
    yield from (f"{_INDENT}{reason}" for reason in cases[0].reasons)
    shorts = [case.case.rpartition("::")[2] for case in cases]
    yield f"{_INDENT}{_first_few(shorts)}"


def _case_lines(case: CaseOutcome) -> Iterator[str]:
    word = case.verdict
    yield f"{word} {case.case}"
    if word is Verdict.NOT_RUN or all(check.verdict.good for check in case.checks):
        short = sorted(name for name, said in case.requirements.items() if said is Verdict.NOT_EVALUATED)
        yield from labelled([("not evaluated", ", ".join(short))], indent=_INDENT)
    bad = [check for check in case.checks if not check.verdict.good]
    told = tuple(f"{check.requirement} {check.parameter}" for check in bad)
    for reason in in_short(word, case.reasons):
        if not reason.startswith(told):  # its check is written out below
            yield f"{_INDENT}{reason}"
    yield from (f"{_INDENT}{sentence}" for sentence in holds(case))
    for check in bad:
        yield from (f"{_INDENT}{line}" for line in check_lines(check))


def _worth(results: Outcome) -> Iterator[str]:
    if sentence := uncovered_sentence(results, _MOST_NAMED):
        yield sentence
    source = source_word(results)
    yield closing_sentence(results) + (f" {source}." if source else "")
    total = len(results.requirements)
    for group in closings(results):
        if not group.closes:
            some = len(group.requirements) < total
            yield f"{_INDENT}{group.reason}" + (f" ({_first_few(group.requirements)})" if some else "")


def _first_few(names: Sequence[str]) -> str:
    more = len(names) - _MOST_NAMED
    return ", ".join(names[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
