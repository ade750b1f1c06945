"""The reports of a run, written into its folder before the seal, or regenerated from a sealed one.

The page is one HTML file that needs no network and no script, on a screen and on A4. Continuous integration reads the
results as JUnit XML, with the requirements as properties.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from hil.evidence.durable import write_whole
from hil.evidence.events import Check
from hil.evidence.folder import REPORT
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import State, Verification, verify
from hil.evidence.results.outcome import CaseOutcome, Outcome
from hil.model.verdict import Verdict
from hil.report.material import Material
from hil.report.page.assemble import assemble
from hil.report.page.view import RunView
from hil.report.sentences import warnings
from hil.report.summary import check_lines

if TYPE_CHECKING:
    import jinja2

__all__ = ["HTML", "JUNIT", "TEMPLATES", "copy_junit", "junit", "make_reports", "write_reports"]

HTML = "report.html"
JUNIT = "junit.xml"
_MOST_FAILED = 12  # checks, and cases, that are listed beside the verdict; the sections below list all
TEMPLATES = Path(__file__).parent / "page/templates"
# Controls, and marks that reorder or hide text: they are shown by their number, never obeyed.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)
# What XML 1.0 cannot hold (its production 2), and marks that reorder text.
_UNFIT = re.compile(
    "[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]|[\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
_FAILED = frozenset({Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.NOT_EVALUATED})
_BROKEN = frozenset({Verdict.ERROR, Verdict.ABORTED})


def make_reports(folder: Path, found: Verification | None = None) -> dict[str, bytes]:
    """Return the reports of a run by their file names; the same package gives the same bytes.

    Args:
        folder: the run's folder, sealed or not; nothing in it is touched.
        found: what its verification found, where that is known; what is not sealed, or damaged, is marked.

    Raises:
        EvidenceError: where journal or results cannot be read.
    """
    package, found = Package(folder), found or verify(folder)
    if found.state is State.SEALED:
        return _reports(package)
    view = assemble(Material(package), "")
    if found.state is not State.DAMAGED:
        word, sentence = (
            "NOT SEALED",
            f"the run is {found.state}; this is what was recorded so far, not evidence.",
        )
        view = replace(view, source_word=_before(word, view), warnings=((word, sentence), *view.warnings))
        return _both(package, view)
    sentence = f"this is not what was sealed, and proves nothing. {found.problem}"
    return {HTML: _page(_damaged(view, sentence)), JUNIT: _junit_of_damage(view.run, sentence)}


def write_reports(package: Package) -> None:
    """Write `data/report/` of a run whose other files are final.

    Raises:
        EvidenceError: where journal or results cannot be read.
    """
    place = package.folder / REPORT
    place.mkdir(parents=True, exist_ok=True)
    for name, content in _reports(package).items():
        write_whole(place / name, content)


def copy_junit(folder: Path, place: Path | None) -> str:
    """Write the results of a run as JUnit XML to a requested file as well; return why that failed, if it did.

    Args:
        folder: the run's folder, with its reports.
        place: the file to write; nothing is written where it is None.
    """
    try:
        if place is not None:
            place.write_bytes((folder / REPORT / JUNIT).read_bytes())
    except OSError as error:
        return f"{place} could not be written: {error.strerror}; the package has {REPORT}/{JUNIT}"
    return ""


def _reports(package: Package) -> dict[str, bytes]:
    return _both(package, assemble(Material(package), package.evidence_digest))


def _both(package: Package, view: RunView) -> dict[str, bytes]:
    material, digest = Material(package), view.evidence_digest
    return {
        HTML: _page(view),
        JUNIT: junit(material.results(), run=material.run(), began=material.stamps()[0], evidence_digest=digest),
    }


def _damaged(view: RunView, sentence: str) -> RunView:
    """Return the view of a damaged package: marked on every page, without verdict, digest, or what it can close."""
    return replace(
        view,
        verdict="-",
        source_word=_before("DAMAGED", view),
        headline="The package is damaged.",
        closing="A damaged package closes nothing.",
        warnings=(("DAMAGED", sentence), *view.warnings),
        counts=(),
        closings=(),
    )


def _before(word: str, view: RunView) -> str:
    return " · ".join(filter(None, (word, view.source_word)))


def _page(view: RunView) -> bytes:
    return _render(view).encode("utf-8", errors="replace")


def _render(view: RunView) -> str:
    """Return the page; the same view gives the same text."""
    page = _template().render(run=view, most_failed=_MOST_FAILED)
    return re.sub(r"\n\s*\n+", "\n", page)


@cache
def _template() -> jinja2.Template:
    """Return the page's template, compiled once in a process: that takes longer than anything else in a report."""
    import jinja2  # noqa: PLC0415 - only where a page is made

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=_visible,
        optimized=False,  # most processes render one page; folding its constants takes longer than it saves
    )
    return environment.get_template("report.html")


def _visible(value: object) -> object:
    """Return a text with what cannot be seen made visible; markup is ours and stays."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return _UNSEEN.sub(lambda match: f"[U+{ord(match[0]):04X}]", str(value))


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


def _junit_of_damage(run: str, sentence: str) -> bytes:
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
