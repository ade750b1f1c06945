"""From the evidence of one run to what a person sees of it."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

from hil.documents.canonical import parse_strict
from hil.documents.text import counted
from hil.evidence.events import Case, Chart, Check, Event, Fed, NotRun, Orphan, Recording, Run
from hil.evidence.results.outcome import OTHERS, AttemptOutcome, CaseOutcome, Outcome, RequirementOutcome
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.report.drawing.checks import short
from hil.report.drawing.curves import chart_graphics
from hil.report.drawing.panel import Graphic
from hil.report.drawing.recordings import recording_graphics
from hil.report.material import (
    Body,
    Material,
    demands,
    documents,
    flat,
    inner,
    inners,
    parse,
    plan_files,
    requirement_entries,
    text,
    texts,
    unspoken,
)
from hil.report.numbers import duration, with_unit
from hil.report.page.as_run import Placed, attributed, checks_of, fed_limits, recording_rows, watched_rows
from hil.report.page.given import given_rows
from hil.report.page.grouping import case_groups, check_groups, headlines
from hil.report.page.incidents import armings, guarded, happenings, people, safe_off
from hil.report.page.steps import step_rows
from hil.report.page.view import (
    BrokenRow,
    CaseName,
    CaseView,
    CheckRow,
    DocumentRow,
    Fact,
    Happening,
    ParameterRow,
    RequirementRow,
    RunView,
)
from hil.report.page.wiring import instruments, wiring
from hil.report.sentences import (
    closing_sentence,
    closings,
    common_proofs,
    common_reasons,
    headline,
    holds,
    proofs,
    safe_word,
    source_word,
    subject,
    warnings,
)

__all__ = ["assemble", "facts"]

_LONGEST = 300
_BENCH = "bench/bench.yaml"
# What an empty field of the software's identity says: no variable in the environment, no change beside the commit.
_ABSENT = {"numeric": "not set", "workspace": "none"}


def assemble(material: Material, evidence_digest: str) -> RunView:
    """Return the view of a run.

    Args:
        material: the run's evidence.
        evidence_digest: the digest that the page names; it covers everything but `data/report/`.

    Raises:
        EvidenceError: where the results say what this version does not know.
    """
    events, results = material.events(), material.results()
    run, bench = results.run, parse(material.text(_BENCH), _BENCH)
    checks, others = _checks_and_others(events)
    entries, names, drawn = requirement_entries(material), _names(results), _drawn(material, events, bench)
    return RunView(
        title=", ".join(run.plans) if run else "",
        subject=subject(results),
        run=material.run(),
        source_word=source_word(results),
        verdict=results.verdict,
        headline=headline(results),
        closing=closing_sentence(results),
        warnings=warnings(results),
        counts=tuple((word.value, results.counts[word]) for word in reversed(Verdict) if results.counts.get(word)),
        closings=closings(results),
        common=common_reasons(results),
        proofs=proofs(results.conditions),
        common_proofs=common_proofs(results),
        facts=facts(material, run, inner(bench, "bench"), events),
        documents=_documents(material),
        failed=_failed(checks, names),
        broken=_broken(results, names),
        held=_held(results, names),
        requirements=tuple(_requirement(entry, entries.get(entry.id, {}), names) for entry in results.requirements),
        unspoken=unspoken(entries, {entry.id for entry in results.requirements}),
        headlines=headlines(checks),
        charts=chart_graphics(_charts(others)),
        checks=check_groups(checks, names),
        cases=(cases := _cases(others, results, drawn)),
        procedure=case_groups(cases),
        watched=watched_rows(others),
        watched_graphics=drawn.get("", ()),
        fed=fed_limits(others),
        not_run=_not_run(events, results),
        orphans=tuple(case for event in events if isinstance(event, Orphan) for case in event.cases),
        armings=armings(each.event for each in others),
        safe=safe_off(each.event for each in others),
        safe_word=safe_word(results),
        instruments=instruments(bench, inner(_json(material, "bench/calibration.json"), "instruments")),
        wiring=wiring(bench),
        people=people(run, others),
        given=given_rows(others, names, material),
        happenings=_told_once(happenings(others, names, guarded(material.guardian()), material.sent()), entries),
        deviations=run.deviations if run else (),
        parameters=_parameters(material),
        software=_software(results, _json(material, "software.json"), _json(material, "place.json")),
        content_digest=results.content_digest,
        evidence_digest=evidence_digest,
        ledger_head=material.ledger_head(),
    )


def _checks_and_others(events: Sequence[Event]) -> tuple[list[Placed], list[Placed]]:
    """Return the checks among the events, and all other events, each with the case and step that it belongs to."""
    placed = attributed(events)
    checks = [each for each in placed if isinstance(each.event, Check)]
    return checks, [each for each in placed if not isinstance(each.event, Check)]


def _drawn(material: Material, events: Sequence[Event], bench: Body) -> Mapping[str, tuple[Graphic, ...]]:
    """Return the drawings of the recordings by case, see `recording_graphics`."""
    begun = [event for event in events if isinstance(event, Recording)]
    fed = [event for event in events if isinstance(event, Fed)]
    return recording_graphics(material, begun, inners(bench, "envelope"), fed, events[-1].t if events else 0.0)


def facts(material: Material, run: Run | None, bench: Body, events: Sequence[Event]) -> tuple[Fact, ...]:
    """Return who, what, when and where: label and value, empty where it is not recorded.

    Args:
        material: the run's evidence.
        run: what it was asked for, None where it never began.
        bench: the head of its bench file.
        events: its events, in order.
    """
    began, ended = (_instant(stamp) for stamp in material.stamps())
    when = [("Started (UTC)", began), ("Ended (UTC)", ended)]
    return tuple(
        Fact(label=label, value=value)
        for label, value in (
            *(_asked(run, bench) if run else ()),
            *when,
            ("Bench time", _span(run, duration(events[-1].t) if events else "")),
            ("Plans", ", ".join(run.plans) if run else ""),
            ("Run", material.run()),
        )
    )


def _asked(run: Run, bench: Body) -> tuple[tuple[str, str], ...]:
    served = ", served by another process" if run.live and run.live.served else ""
    return (
        ("Device under test", run.dut.title),
        ("Part number", run.dut.part),
        ("Serial number", run.dut.serial),
        ("Model", run.dut.model),
        ("Hardware revision", run.dut.hardware),
        ("Firmware revision", run.dut.firmware),
        ("Purpose", run.purpose),
        ("Source", f"{run.source}{served}"),
        ("Operator", run.operator),
        ("Bench", " · ".join(part for part in (run.bench, text(bench, "title")) if part)),
        ("Place", text(bench, "place")),
    )


def _span(run: Run | None, lasted: str) -> str:
    """Return how long a run lasted in bench time, and what kind of time that was."""
    if run is None or not lasted or run.source is Source.HARDWARE:
        return lasted
    if run.live is None:
        return f"{lasted}, virtual{f' from {run.epoch}' if run.epoch else ''}"
    return lasted if run.live.speed == 1 else f"{lasted}, at {run.live.speed:g} times real time"


def _instant(stamp: str) -> str:
    """Return a timestamp in readable form, to the second."""
    return f"{stamp[:10]} {stamp[11:19]}" if len(stamp) > 19 else stamp


def _failed(checks: Sequence[Placed], names: Mapping[str, CaseName]) -> tuple[CheckRow, ...]:
    """Return the checks of the last attempts that are not good."""
    rows = checks_of([each for each in checks if each.counted], names)
    return tuple(row for row in rows if not row.verdict.good)


def _charts(placed: Sequence[Placed]) -> list[Chart]:
    return [each.event for each in placed if each.counted and isinstance(each.event, Chart)]


def _told_once(found: Sequence[Happening], entries: Mapping[str, Body]) -> tuple[Happening, ...]:
    """Return the incidents, with anomalies in requirements' sources as one: they are listed with the requirements."""
    sources = [anomaly for entry in entries.values() if (anomaly := text(entry, "anomaly"))]
    known = [each for each in found if each.kind == "anomaly" and any(each.text.endswith(own) for own in sources)]
    if len(known) < 2:
        return tuple(found)
    told = f"{counted(len(known), 'requirement')} with an anomaly in the source: see section 3"
    first = replace(known[0], text=told, case=None)
    rest = [first if each is known[0] else each for each in found if each is known[0] or each not in known]
    return tuple(rest)


def _documents(material: Material) -> tuple[DocumentRow, ...]:
    return tuple(
        DocumentRow(plan=plan, id=text(named, "id"), issue=text(named, "issue"), title=text(named, "title"))
        for plan, named in documents(material)
    )


def _names(results: Outcome) -> dict[str, CaseName]:
    """Return how tables name each case: what follows its file, unless another case is called the same."""
    shorts = Counter(short(entry.case) for entry in results.cases)
    return {
        entry.case: CaseName(
            shown=short(entry.case) if shorts[short(entry.case)] == 1 else entry.case, anchor=f"case-{place}"
        )
        for place, entry in enumerate(results.cases, 1)
    }


def _requirement(entry: RequirementOutcome, catalogued: Body, names: Mapping[str, CaseName]) -> RequirementRow:
    return RequirementRow(
        result=entry,
        parents=", ".join(texts(catalogued, "parents")),
        level=text(catalogued, "level"),
        stage=text(catalogued, "stage"),
        demands=demands(catalogued),
        cases=tuple((names[case.case], case.verdict) for case in entry.cases),
        anomaly=text(catalogued, "anomaly"),
        proofs=proofs(entry.conditions),
    )


def _broken(results: Outcome, names: Mapping[str, CaseName]) -> tuple[BrokenRow, ...]:
    """Return the reasons of failed cases that no check explains, the worst first; one row per verdict and reason."""
    groups: dict[tuple[Verdict, tuple[str, ...]], list[CaseName]] = {}
    for case in results.cases:
        if not case.verdict.good and all(check.verdict.good for check in case.checks):
            groups.setdefault((case.verdict, case.reasons), []).append(names[case.case])
    return tuple(
        BrokenRow(verdict=word, reasons=reasons, named=tuple(cases))
        for worst in reversed(Verdict)
        for (word, reasons), cases in groups.items()
        if word is worst
    )


def _held(results: Outcome, names: Mapping[str, CaseName]) -> tuple[tuple[CaseName, str], ...]:
    """Return when the bench was held during cases that are not good, as a possible cause."""
    bad = [case for case in results.cases if not case.verdict.good]
    return tuple((names[case.case], sentence) for case in bad for sentence in holds(case))


def _cases(
    events: Sequence[Placed], results: Outcome, drawn: Mapping[str, tuple[Graphic, ...]]
) -> tuple[CaseView, ...]:
    by_case: dict[str, list[Placed]] = {}
    for each in events:
        by_case.setdefault(each.case, []).append(each)
    return tuple(
        _case(place, entry, by_case.get(entry.case, []), drawn.get(entry.case, ()))
        for place, entry in enumerate(results.cases, 1)
    )


def _case(place: int, entry: CaseOutcome, events: Sequence[Placed], graphics: tuple[Graphic, ...]) -> CaseView:
    steps = step_rows(events)
    told = [exchange for row in steps for exchange in row.exchanges]
    return CaseView(
        anchor=f"case-{place}",
        begun=entry.verdict is not Verdict.NOT_RUN or any(isinstance(each.event, Case) for each in events),
        result=entry,
        duration=duration(entry.duration),
        attempts=_attempts(entry.attempts),
        used=", ".join(f"{name} ({source})" for name, source in sorted(entry.used.items())),
        steps=steps,
        tally=_tally(entry),
        recordings=recording_rows(events),
        graphics=graphics,
        variant=entry.case.partition("[")[2].rstrip("]"),
        answers=tuple(f"{each.answer or 'not answered'} by {each.by or 'nobody'}" for each in told),
    )


def _tally(entry: CaseOutcome) -> str:
    """Return the number of checks of a case by verdict, the worst first."""
    counts = Counter(check.verdict for check in entry.checks)
    return ", ".join(f"{counts[word]} {word}" for word in reversed(Verdict) if counts[word])


def _attempts(attempts: Sequence[AttemptOutcome]) -> str:
    """Return how often a case was tried and how each attempt ended; empty for a single attempt."""
    if len(attempts) < 2:
        return ""
    return f"{len(attempts)} attempts: {', '.join(map(_attempt, attempts))}"


def _attempt(attempt: AttemptOutcome) -> str:
    """Return how an attempt ended; if it was given up, also what it had read."""
    if attempt.verdict is None and attempt.read:
        return f"not ended ({'; '.join(attempt.reasons)})"
    return attempt.verdict or "not ended"


def _not_run(events: Sequence[Event], results: Outcome) -> tuple[tuple[str, str, str], ...]:
    """Return case, title and reason of every planned case that did not run."""
    said = {event.case: event.reason for event in events if isinstance(event, NotRun)}
    return tuple(
        (entry.case, entry.title, said.get(entry.case) or "; ".join(entry.reasons))
        for entry in results.cases
        if entry.verdict is Verdict.NOT_RUN
    )


def _parameters(material: Material) -> tuple[ParameterRow, ...]:
    return tuple(
        ParameterRow(
            plan=plan,
            name=text(entry, "name"),
            value=with_unit(text(entry, "value") or ", ".join(texts(entry, "values")), text(entry, "unit")),
            text=text(entry, "text"),
        )
        for plan, file in plan_files(material, "parameters.yaml")
        for entry in inners(file, "parameters")
    )


_OTHER_CODE = {
    OTHERS: "code from other packages",
    "start": "code run at Python start-up",
    "environment": "environment variables",
    "executed": "code that ran",
}
_TOLD_APART = frozenset({"format", "packages", "others", "start", "strays", "changing"})


def _software(results: Outcome, software: Body, place: Body) -> tuple[Fact, ...]:
    run = results.run
    named = (("hil version", run.version), ("seed", run.seed)) if run else ()
    files = {"catalogue": run.catalogue, "parameters": run.parameters, "sources": run.sources} if run else {}
    digests = tuple((f"{name} sha256", digest) for name, digest in files.items())
    packages = ", ".join(f"{name} {version}" for name, version in flat(inner(software, "packages")))
    rest = (
        (name, value or _ABSENT.get(name.split(".")[0], ""))
        for name, value in flat({key: value for key, value in software.items() if key not in _TOLD_APART})
    )
    where = ((f"place.{name}", value) for name, value in flat(place) if name != "format")
    others = ((_OTHER_CODE[each.name], each.text) for each in results.conditions or () if each.name in _OTHER_CODE)
    told = ((name, _short(value)) for name, value in rest)
    pairs = (*named, *digests, *told, *others, ("packages", packages), *where)
    return tuple(Fact(label=label, value=value) for label, value in pairs)


def _short(value: str) -> str:
    """Return a value that fits a line; for a longer one, such as uncommitted changes, its size and hash."""
    if len(value) <= _LONGEST and "\n" not in value:
        return value
    digest = hashlib.sha256(value.encode("utf-8", errors="surrogatepass")).hexdigest()
    return f"{counted(len(value.splitlines()), 'line')} with SHA-256 {digest}; stored in the package"


def _json(material: Material, relative: str) -> Body:
    content = material.text(relative)
    value = parse_strict(content.encode()) if content else {}
    return value if isinstance(value, Mapping) else {}
