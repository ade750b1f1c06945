"""From the evidence of one run to what a person sees of it."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Mapping, Sequence

from hil.documents.canonical import parse_strict
from hil.evidence.events import Case, Check, Event, Fed, NotRun, Orphan, Recording, Run
from hil.model.identity import Source
from hil.model.verdict import Verdict
from hil.report.drawing.checks import charts
from hil.report.drawing.panel import Graphic
from hil.report.drawing.recordings import recording_graphics
from hil.report.frozen import demands, documents, parse, plan_files, requirement_entries, unspoken
from hil.report.material import Body, Material, checks_in, flat, inner, inners, text, texts, verdict
from hil.report.numbers import duration, with_unit
from hil.report.page.as_run import Placed, attributed, checks_of, fed_limits, recording_rows, step_rows, watched_rows
from hil.report.page.bench import armings, instruments, safe_off, wiring
from hil.report.page.incidents import guarded, happenings, people
from hil.report.page.view import (
    BrokenRow,
    CaseName,
    CaseView,
    DocumentRow,
    Fact,
    ParameterRow,
    RequirementRow,
    RunView,
)
from hil.report.sentences import (
    closing_sentence,
    closings,
    common_reasons,
    counted,
    headline,
    holds,
    safe_word,
    source_word,
    subject,
    warnings,
)

__all__ = ["assemble", "facts"]

_LONGEST = 300
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
    placed = attributed(events)
    run = inner(results, "run")
    asked = next((event for event in events if isinstance(event, Run)), None)
    bench = parse(material.text("bench/bench.yaml"), "bench/bench.yaml")
    entries, names = requirement_entries(material), _names(results)
    begun = [event for event in events if isinstance(event, Recording)]
    counting = [each for each in placed if each.counted and isinstance(each.event, Check)]
    checks = [each.event for each in counting if isinstance(each.event, Check)]
    fed = [event for event in events if isinstance(event, Fed)]
    drawn = recording_graphics(material, begun, checks, inners(bench, "envelope"), fed)
    return RunView(
        title=", ".join(texts(run, "plans")),
        subject=subject(results),
        run=material.run(),
        source_word=source_word(results),
        verdict=verdict(results),
        headline=headline(results),
        closing=closing_sentence(results),
        warnings=warnings(results),
        counts=_counts(results),
        closings=closings(results),
        common=common_reasons(results),
        facts=facts(material, run, inner(bench, "bench"), events),
        documents=_documents(material),
        failed=tuple(row for row in checks_of(counting, names) if not row.verdict.good),
        broken=_broken(results, names),
        held=_held(results, names),
        requirements=tuple(
            _requirement(entry, entries.get(text(entry, "id"), {}), names) for entry in inners(results, "requirements")
        ),
        unspoken=unspoken(entries, {text(entry, "id") for entry in inners(results, "requirements")}),
        checks=checks_of(placed, names),
        charts=charts(checks),
        cases=_cases(placed, results, drawn),
        watched=watched_rows(placed),
        watched_graphics=drawn.get("", ()),
        fed=fed_limits(placed),
        not_run=_not_run(events, results),
        orphans=tuple(case for event in events if isinstance(event, Orphan) for case in event.cases),
        armings=armings(events),
        safe=safe_off(events),
        safe_word=safe_word(results),
        instruments=instruments(bench),
        wiring=wiring(bench),
        people=people(asked, placed),
        happenings=happenings(placed, names, guarded(material.guardian()), material.sent()),
        deviations=texts(run, "deviations"),
        parameters=_parameters(material),
        software=_software(run, _json(material, "software.json"), _json(material, "place.json")),
        content_digest=text(results, "content_digest"),
        evidence_digest=evidence_digest,
    )


def facts(material: Material, run: Body, bench: Body, events: Sequence[Event]) -> tuple[Fact, ...]:
    """Return who, what, when and where: label and value, empty where it is not recorded.

    Args:
        material: the run's evidence.
        run: what it was made of, from its results.
        bench: the head of its bench file.
        events: its events, in order.
    """
    dut = inner(run, "dut")
    span = _span(run, duration(events[-1].t) if events else "")
    began, ended = material.stamps()
    return tuple(
        Fact(label=label, value=value)
        for label, value in (
            ("Device under test", text(dut, "title")),
            ("Part number", text(dut, "part")),
            ("Serial number", text(dut, "serial")),
            ("Model", text(dut, "model")),
            ("Hardware revision", text(dut, "hardware")),
            ("Firmware revision", text(dut, "firmware")),
            ("Purpose", text(run, "purpose")),
            ("Source", f"{text(run, 'source')}, served by another process" if _served(run) else text(run, "source")),
            ("Operator", text(run, "operator")),
            ("Bench", " · ".join(part for part in (text(run, "bench"), text(bench, "title")) if part)),
            ("Place", text(bench, "place")),
            ("Began (UTC)", _instant(began)),
            ("Ended (UTC)", _instant(ended)),
            ("Bench time", span),
            ("Plans", ", ".join(texts(run, "plans"))),
            ("Run", material.run()),
        )
    )


def _served(run: Body) -> bool:
    return bool(inner(run, "live").get("served"))


def _span(run: Body, lasted: str) -> str:
    """Return how long a run lasted in bench time, and what that time was."""
    live, epoch = inner(run, "live"), text(run, "epoch")
    if not lasted or text(run, "source") == Source.HARDWARE:
        return lasted
    if not live:
        return f"{lasted}, virtual{epoch and ' from '}{epoch}"
    speed = text(live, "speed").removesuffix(".0")
    return lasted if speed in {"", "1"} else f"{lasted}, at {speed} times real time"


def _instant(stamp: str) -> str:
    """Return a stamp as a person reads it, to the second."""
    return f"{stamp[:10]} {stamp[11:19]}" if len(stamp) > 19 else stamp


def _documents(material: Material) -> tuple[DocumentRow, ...]:
    return tuple(
        DocumentRow(plan=plan, id=text(named, "id"), issue=text(named, "issue"), title=text(named, "title"))
        for plan, named in documents(material)
    )


def _names(results: Body) -> dict[str, CaseName]:
    """Return how tables name each case: what follows its file, unless another case is called the same."""
    cases = [text(entry, "case") for entry in inners(results, "cases")]
    shorts = Counter(case.rsplit("::", 1)[-1] for case in cases)
    return {
        case: CaseName(shown=short if shorts[short] == 1 else case, anchor=f"case-{place}")
        for place, case in enumerate(cases, 1)
        for short in (case.rsplit("::", 1)[-1],)
    }


def _counts(results: Body) -> tuple[tuple[str, int], ...]:
    counts = inner(results, "counts")
    return tuple((word.value, int(text(counts, word))) for word in reversed(Verdict) if counts.get(word))


def _requirement(entry: Body, catalogued: Body, names: Mapping[str, CaseName]) -> RequirementRow:
    return RequirementRow(
        id=text(entry, "id"),
        rev=text(entry, "rev"),
        text=text(entry, "text"),
        kind=text(entry, "kind"),
        method=text(entry, "method"),
        source=text(entry, "source"),
        parents=", ".join(texts(catalogued, "parents")),
        level=text(catalogued, "level"),
        stage=text(catalogued, "stage"),
        demands=demands(catalogued),
        verdict=verdict(entry),
        cases=tuple((names[text(case, "case")], verdict(case)) for case in inners(entry, "cases")),
        checks=int(text(entry, "checks") or 0),
        eligible=entry.get("eligible") is True,
        reasons=texts(entry, "reasons"),
        anomaly=text(catalogued, "anomaly"),
    )


def _broken(results: Body, names: Mapping[str, CaseName]) -> tuple[BrokenRow, ...]:
    """Return why cases did not end well of which no check says it, the worst first; one row per verdict and reason."""
    groups: dict[tuple[Verdict, tuple[str, ...]], list[CaseName]] = {}
    for case in inners(results, "cases"):
        if not verdict(case).good and all(check.verdict.good for check in checks_in(case)):
            why = (verdict(case), texts(case, "reasons"))
            groups.setdefault(why, []).append(names[text(case, "case")])
    return tuple(
        BrokenRow(verdict=word, reasons=reasons, named=tuple(cases))
        for worst in reversed(Verdict)
        for (word, reasons), cases in groups.items()
        if word is worst
    )


def _held(results: Body, names: Mapping[str, CaseName]) -> tuple[tuple[CaseName, str], ...]:
    """Return when the bench was held in the course of cases that are not good: it may be why."""
    bad = [case for case in inners(results, "cases") if not verdict(case).good]
    return tuple((names[text(case, "case")], sentence) for case in bad for sentence in holds(case))


def _cases(events: Sequence[Placed], results: Body, drawn: Mapping[str, tuple[Graphic, ...]]) -> tuple[CaseView, ...]:
    by_case: dict[str, list[Placed]] = {}
    for each in events:
        by_case.setdefault(each.case, []).append(each)
    return tuple(
        _case(place, entry, by_case.get(text(entry, "case"), []), drawn.get(text(entry, "case"), ()))
        for place, entry in enumerate(inners(results, "cases"), 1)
    )


def _case(place: int, entry: Body, events: Sequence[Placed], graphics: tuple[Graphic, ...]) -> CaseView:
    used = inner(entry, "used")
    return CaseView(
        anchor=f"case-{place}",
        begun=verdict(entry) is not Verdict.NOT_RUN or any(isinstance(each.event, Case) for each in events),
        case=text(entry, "case"),
        title=text(entry, "title"),
        plan=text(entry, "plan"),
        verdict=verdict(entry),
        reasons=texts(entry, "reasons"),
        requirements=tuple(flat(inner(entry, "requirements"))),
        duration=duration(entry.get("duration")),
        attempts=_attempts(inners(entry, "attempts")),
        used=", ".join(f"{name} ({source})" for name, source in sorted(used.items())),
        steps=step_rows(events),
        checks=checks_of(events, {}),
        recordings=recording_rows(events),
        graphics=graphics,
    )


def _attempts(attempts: Sequence[Body]) -> str:
    """Return how often a case was tried and how each ended; the ordinary one attempt needs no words."""
    if len(attempts) < 2:
        return ""
    told = ", ".join(text(attempt, "verdict") or "not ended" for attempt in attempts)
    return f"{len(attempts)} attempts: {told}"


def _not_run(events: Sequence[Event], results: Body) -> tuple[tuple[str, str, str], ...]:
    """Return case, title and reason of everything that was planned and did not run."""
    said = {event.case: event.reason for event in events if isinstance(event, NotRun)}
    return tuple(
        (text(entry, "case"), text(entry, "title"), said.get(text(entry, "case")) or "; ".join(texts(entry, "reasons")))
        for entry in inners(results, "cases")
        if verdict(entry) is Verdict.NOT_RUN
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


def _software(run: Body, software: Body, place: Body) -> tuple[Fact, ...]:
    named = (("hil version", text(run, "version")), ("seed", text(run, "seed")))
    digests = tuple((f"{name} sha256", text(run, name)) for name in ("catalogue", "parameters", "sources"))
    packages = ", ".join(f"{name} {version}" for name, version in flat(inner(software, "packages")))
    rest = (
        (name, value or _ABSENT.get(name.split(".")[0], ""))
        for name, value in flat({key: value for key, value in software.items() if key not in {"format", "packages"}})
    )
    where = ((f"place.{name}", value) for name, value in flat(place) if name != "format")
    pairs = (*named, *digests, *((name, _short(value)) for name, value in rest), ("packages", packages), *where)
    return tuple(Fact(label=label, value=value) for label, value in pairs)


def _short(value: str) -> str:
    """Return a value that fits a line; of a longer one, such as uncommitted changes, its size and hash."""
    if len(value) <= _LONGEST and "\n" not in value:
        return value
    digest = hashlib.sha256(value.encode("utf-8", errors="surrogatepass")).hexdigest()
    return f"{counted(len(value.splitlines()), 'line')} with sha256 {digest}; stored in the package"


def _json(material: Material, relative: str) -> Body:
    content = material.text(relative)
    value = parse_strict(content.encode()) if content else {}
    return value if isinstance(value, Mapping) else {}
