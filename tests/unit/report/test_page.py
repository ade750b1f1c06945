import json
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser

import evidence_runs
import msgspec
import pytest
import specimen_run
from typed_events import event_of, events_of

from hil.evidence.events import Recording
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import seal
from hil.evidence.package.verification import State, Verification
from hil.model.errors import Finding
from hil.model.verdict import Verdict
from hil.report.drawing.checks import points_of
from hil.report.drawing.recordings import recording_graphics
from hil.report.material import Material
from hil.report.page.as_run import attributed, check_row, fed_limits, recording_rows, watched_rows
from hil.report.write import HTML, JUNIT, TEMPLATES, make_reports, write_reports

VOID = {"meta", "path", "circle", "br", "use", "link", "img"}


def found_of(folder, state=State.SEALED, *findings):
    """Return a verification: the specimen has something of everything, and not all of it follows from its journal."""
    return Verification(folder=folder, state=state, findings=findings)


class Page(HTMLParser):
    """A page as its tags and the text between them."""

    def __init__(self, page):
        super().__init__(convert_charrefs=True)
        self.tags = []
        self.text = []
        self.open = []
        self.feed(page.replace("<wbr>", ""))  # where a name may be broken is no space

    def handle_starttag(self, tag, attrs):
        """Keep the tag, and that it is open."""
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        """Close the innermost element, which it must be."""
        if tag not in VOID:
            assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data):
        """Keep the text."""
        self.text.append(data)

    def all(self, tag):
        """Return the attributes of every such tag."""
        return [attrs for name, attrs in self.tags if name == tag]

    @property
    def words(self):
        """The text, with single spaces."""
        return " ".join(" ".join(self.text).split())


def one_case(verdict, **fields):
    """Return the events of a run with one case that ended so."""
    case = {"case": "plan/test_a.py::test_a", "title": "A case.", "plan": "plan", "requirements": ["ADCS-GYR-040"]}
    event = {"case": case["case"], "attempt": 1}
    end = {"verdict": verdict, "reasons": [], "requirements": {"ADCS-GYR-040": verdict}, "duration": 1.0, "used": {}}
    name = (2.0, case["case"], "ADCS-GYR-040", fields.pop("parameter", "current"))
    yield "planned", 0.0, {"cases": [case | {"max_duration": 10.0}]}
    yield "armed", 0.5, {}
    if verdict == "NOT_RUN":
        yield "not-run", 1.0, {"case": case["case"], "reason": "left out"}
    else:
        yield "case", 1.0, event
        if verdict in {"PASS", "FAIL", "INCONCLUSIVE", "RECORDED"}:
            yield specimen_run.check(*name, verdict=verdict, **fields)
        yield "case-end", 2.0, event | end
    yield "safe-end", 3.0, {"ok": True}


def page_of(tmp_path, **how):
    """Return the page of a specimen made that way."""
    folder = specimen_run.build(tmp_path, **how)
    return (folder / "data/report/report.html").read_text(encoding="utf-8")


def test_requirements_that_no_case_verifies_are_named(tmp_path, monkeypatch, html):
    """A run does not close a plan by leaving out what is reviewed or withdrawn: the page names those, with why."""
    further = (
        "- {id: ADCS-GYR-090, method: review}\n- {id: ADCS-GYR-080, method: test, withdrawn: true}\n"
        "- {id: ADCS-GYR-040, method: test}\n"
    )
    monkeypatch.setattr(specimen_run, "PLAN", specimen_run.PLAN + further)
    page = Page(page_of(tmp_path, events=list(one_case("PASS"))))
    told = "no case of this run verifies: ADCS-GYR-080 (withdrawn), ADCS-GYR-090 (review)."
    assert told in page.words.replace(" )", ")").replace(" ,", ",").replace(" .", ".")
    assert "further requirements" not in html


def test_same_package_same_bytes(folder):
    """A report made again from a sealed package is the report that was sealed."""
    for name, content in make_reports(folder, found_of(folder)).items():
        assert content == (folder / "data/report" / name).read_bytes()


@pytest.mark.system
def test_same_bytes_in_another_process(folder):
    """Neither the process nor the order of its hashes shows in a report."""
    code = (
        "import sys, hashlib; from pathlib import Path; from hil.report.write import make_reports;"
        "print(*(hashlib.sha256(made).hexdigest() for made in make_reports(Path(sys.argv[1])).values()))"
    )
    found = {
        subprocess.run(
            [sys.executable, "-c", code, str(folder)],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(sys.path)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(found) == 1


def test_copy_under_another_name_gives_the_same_report(folder, tmp_path):
    """The run keeps the name that it was sealed under."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    assert make_reports(copy, found_of(copy))[HTML] == (folder / "data/report" / HTML).read_bytes()
    assert make_reports(copy, found_of(copy))[JUNIT] == (folder / "data/report" / JUNIT).read_bytes()


def test_names_the_digest_of_the_seal(folder, html):
    """The page names the evidence digest that the sealed package has, and the content digest."""
    package = Package(folder)
    assert package.evidence_digest in html
    assert package.content_digest in html


def test_is_well_formed_and_accessible(html):
    """Elements nest, the language is named, headers have a scope, there is one landmark, and figures have words."""
    page = Page(html)
    assert page.open == []
    assert page.all("html") == [{"lang": "en"}]
    assert len(page.all("main")) == 1
    assert all(attrs.get("scope") in {"col", "row", "rowgroup"} for attrs in page.all("th"))
    figures = [attrs for attrs in page.all("svg") if "aria-hidden" not in attrs]
    assert figures
    assert all(attrs["role"] == "img" and attrs["aria-label"] for attrs in figures)


def test_reaches_for_nothing_outside(html):
    """No address of another host, no script, no import: the page can be read where there is no network."""
    assert "http" not in re.sub(r"http-equiv", "", html)
    assert "//" not in re.sub(r"/\*.*?\*/", "", html, flags=re.DOTALL)
    assert "@import" not in html
    page = Page(html)
    assert not page.all("script")
    assert not page.all("link")
    for _, attrs in page.tags:
        assert attrs.get("href", "#").startswith("#")
        assert attrs.get("xlink:href", "#").startswith("#")
        assert "src" not in attrs
    assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", html))


def test_every_reference_leads_somewhere(html):
    """Links, markers and clip paths inside the page exist."""
    page = Page(html)
    ids = {attrs["id"] for _, attrs in page.tags if "id" in attrs}
    wanted = {attrs[name][1:] for _, attrs in page.tags for name in ("href", "xlink:href") if name in attrs}
    wanted |= {target[1:] for target in re.findall(r"url\((#[^)]*)\)", html)}
    assert wanted <= ids


def test_holds_what_a_reader_asks_for(html):
    """Who, what, where, requirements, checks, procedure, instruments, wiring, notes and proofs are there."""
    words = Page(html).words
    for expected in (
        "Ada Molla",
        "GYR-007",
        "SUB-GYR-3",
        "Clean room 2, table B",
        "5 cases: 1 failed, 1 not run, 3 passed.",
        "This run can close none of its 4 requirements.",
        "The calibrated rate shall differ from the true rate by less than 0.5 deg/s from 10 to 45 degC.",
        "Anomaly in the source: The source gives the equation of axis x with the wrong sign.",
        "FAIL (-0.712 ± 0.098) deg/s -0.31 deg/s 5.1",
        "outside the limit by more than the expanded uncertainty",
        "1.1 50 deg/s 0:11:03.0 57 s rotation_table.turn(",
        "confirm: Is the board free of the table's clamps? yes by Ada Molla",
        "passed reduced-level supply.board 1.000 V set, 0.9997 V read, positive",
        "supply.board off proven current 0.0001 A, below 0.005 A 0.4 s",
        "K-2026-0418 2027-04-18 current 0 to 2 A: U = 0.0004 A + 0.0005 of the reading (k = 2)",
        "5 V, fuse 500 mA, red to J1.1",
        "Fan of the chamber is loud today. (Jane Doe)",
        "the table overshot its rate by 0.3 deg/s for 0.2 s",
        "skipped: the chamber is away (--skip)",
        "parameter gyroscope.rest_duration is 600 s, the plan says 14400 s",
        "rest_duration 14400 s How long the board is left alone.",
        "-50, 50 deg/s",
        "numeric.blas openblas Haswell",
        "6 000 0.1 s complete",
        specimen_run.CASES["extra"],
    ):
        assert expected in words


def test_empty_field_is_said_to_be_empty(tmp_path):
    """A run without operator, serial number or gates says 'not recorded' where they belong."""
    page = Page(page_of(tmp_path, run={"operator": "", "dut": {}}, events=list(one_case("PASS"))))
    assert "Operator not recorded" in page.words.replace("  ", " ")
    assert "Serial number not recorded" in page.words
    assert "Readiness gates at arm not recorded" in page.words


@pytest.mark.parametrize("verdict", [verdict.value for verdict in Verdict])
def test_every_verdict_is_shown_as_itself(tmp_path, verdict):
    """The case's verdict stands in words, with a shape of its own, and so does the run's."""
    page = page_of(tmp_path, events=list(one_case(verdict)))
    word = re.search(r'<p class="word"><svg[^>]*><use href="#is-(\w+)"></use></svg>(\w+)</p>', page)
    assert word
    assert word.groups() == (verdict, verdict)
    assert f'<symbol id="is-{verdict}"' in page
    if verdict == "NOT_RUN":  # a line among those that were not run
        assert "A case. NOT_RUN left out" in Page(page).words
        return
    case = Page(page[page.index('<article class="case"') : page.index("</article>")] + "</article>").words
    assert case.startswith(f"A case. {verdict} ")


@pytest.mark.parametrize(("source", "word"), [("simulated", "SIMULATED"), ("replayed", "REPLAYED")])
def test_what_is_not_hardware_says_so_on_every_page(tmp_path, source, word):
    """The header that printing repeats names the source, the run and the evidence digest."""
    page = page_of(tmp_path, run={"source": source}, events=list(one_case("PASS")))
    running = page[page.index('<div class="running"') : page.index('<div class="body"')]
    assert f"<b>{word}</b>" in running
    assert specimen_run.NAME in running
    assert re.search(r"\b[0-9a-f]{64}\b", running)
    assert f"<strong>{word}:</strong>" in page


def test_a_check_shows_what_stands_behind_it_and_why_it_closes_nothing(tmp_path):
    """Both in words, at the check itself."""
    found = {"provenance": ["supply.coil.voltage", "mean"], "unproven": ["made up"], "uncovered": ["psu1 has none"]}
    words = Page(page_of(tmp_path, events=list(one_case("PASS", **found)))).words
    assert "from: supply.coil.voltage, mean" in words
    assert "closes nothing: made up" in words
    assert "closes nothing: psu1 has none" in words


def test_running_header_is_repeated_by_print():
    """In print the header is a table's header group, which is repeated on every page."""
    css = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    printed = css[css.index("@media print") :]
    assert re.search(r"\.running \{ display: table-header-group;", printed)
    assert re.search(r"\.body \{ display: table-row-group;", printed)
    assert "size: A4" in css


def test_what_is_long_breaks_over_columns_in_print():
    """A list of a hundred packages that stays together leaves half a page blank, and the footer a page of its own."""
    printed = (TEMPLATES / "report.css").read_text(encoding="utf-8").partition("@media print")[2]
    assert re.search(r"dl\.lines\.small \{[^}]*columns: 3;", printed)
    kept, broken = (
        printed.index("dt, dd, .verdict .word { break-inside: avoid; }"),
        printed.index("break-inside: auto; } ul.gates"),
    )
    assert kept < broken


def hardware_page(folder, **port):
    """Return the page of a run on hardware that is in order in every way, but for what its ports are."""
    folder.mkdir()
    journal = evidence_runs.begin(folder)
    journal.write(event_of("host-gate", name="source of psu2", ok=True, detail="", instrument="psu2", **port), 0.0)
    evidence_runs.whole_case(folder, journal)
    seal(folder, journal, exit_code=0, write_reports=write_reports)
    return Page((folder / "data/report/report.html").read_text(encoding="utf-8")).words


def test_hardware_is_not_called_simulated(tmp_path):
    """A run on hardware, in order in every way, says what it can close, and what proves it."""
    words = hardware_page(tmp_path / "run")
    assert "SIMULATED" not in words
    assert "EXCEPTION" not in words
    assert "This run can close all 2 requirements." in words
    assert "can close the verdict is good, and nothing in this run weakens the evidence" in words
    assert "Proven for the whole run the run's source is hardware the purpose is qualification" in words
    assert "Proven for each of the 2 requirements one planned case carries it" in words
    assert words.count("one planned case carries it") == 1


def test_what_stands_for_hardware_is_told_on_the_page(tmp_path):
    """A port of this computer counts as hardware only with a reason, and no package hides the reason."""
    words = hardware_page(tmp_path / "run", exception="socket://localhost:1 stands for hardware: a bridge")
    assert "psu2: socket://localhost:1 stands for hardware: a bridge." in words


@pytest.mark.parametrize(
    "hostile",
    [
        "<script>alert(1)</script>",
        '"><img src=x onerror=alert(1)>',
        '=HYPERLINK("x","y")',
        "{{ 7*7 }}{% raw %}",
        "A" * 5000,
        "]]></style></svg>",
    ],
)
def test_text_from_outside_stays_text(tmp_path, hostile):
    """Whatever a title, name, reason or note holds, it is shown as it is written and does nothing."""
    run = {"operator": hostile, "deviations": [hostile]}
    run["dut"] = {"serial": hostile, "title": hostile}
    events = list(one_case("FAIL", parameter=hostile, of=hostile, reason=hostile, unit=hostile, limit_unit=hostile))
    events += [("note", 3.0, {"text": hostile, "by": hostile}), ("anomaly", 3.0, {"text": hostile})]
    page = Page(page_of(tmp_path, run=run, events=events))
    assert page.open == []
    assert not page.all("script")
    assert not page.all("img")
    assert hostile in "".join(page.text)
    assert all(not name.startswith("on") for _, attrs in page.tags for name in attrs)


def test_an_attachment_is_shown_with_what_is_said_of_it(tmp_path):
    """File, text, author and hash stand among the notes; whoever said nothing has no colon."""
    events = list(one_case("PASS"))
    for name, said in (("1-nc-photo.txt", "a photo"), ("2-log.csv", "")):
        events.append(("attachment", 3.0, {"file": name, "sha256": "0" * 64, "by": "Ada", "text": said}))
    words = Page(page_of(tmp_path, events=events)).words
    assert f"1-nc-photo.txt: a photo (Ada), sha256 {'0' * 64}" in words
    assert f"2-log.csv (Ada), sha256 {'0' * 64}" in words


def test_a_case_that_made_a_file_is_not_among_the_people(tmp_path):
    """The section of people names who attached a file, and no case; the file stands among the notes."""
    events = list(one_case("PASS"))
    case = "plan/test_a.py::test_a"
    for name, by in (("table.csv", case), ("photo.jpg", "Ada")):
        events.append(("attachment", 3.0, {"file": name, "sha256": "0" * 64, "by": by, "text": ""}))
    page = page_of(tmp_path, events=events)
    people = page[page.index('id="people"') : page.index('id="parameters"')]
    assert "Ada" in people
    assert case not in people
    assert f"table.csv ({case})" in Page(page).words


def test_marks_that_reorder_text_are_shown_by_number(tmp_path):
    """A bidirectional override cannot turn a FAIL into something else; it is printed as its number."""
    page = page_of(tmp_path, run={"operator": "Ada\u202eSSAP\u0007"}, events=list(one_case("FAIL", reason="\u2066x")))
    assert "\u202e" not in page
    assert "\u2066" not in page
    assert "\u0007" not in page
    assert "Ada[U+202E]SSAP[U+0007]" in page


def test_can_be_mailed(tmp_path):
    """Three channels over thirty thousand rows still make a page below one megabyte."""
    assert len(page_of(tmp_path, rows=30_000)) < 1_000_000


def test_earlier_attempts_are_kept_and_named(tmp_path):
    """The checks of an attempt that was made again stand in the page, as those of that attempt."""
    events = list(one_case("PASS"))
    again = [event for event in events if event[0] in {"case", "check", "case-end"}]
    first = [(kind, t, fields | {"verdict": "FAIL"} if kind != "case" else fields) for kind, t, fields in again]
    second = [(kind, t, fields | {"attempt": 2} if kind != "check" else fields) for kind, t, fields in again]
    words = Page(page_of(tmp_path, events=[*events[:2], *first, *second, events[-1]])).words
    assert "2 attempts: FAIL, PASS" in words
    assert "test_a , attempt 1" in words
    assert "test_a , attempt 2" in words


def verdict_box(page):
    """Return the words of the box that holds the verdict."""
    box = page[page.index('<section class="verdict') : page.index("</section>")]
    return " ".join(re.sub(r"<[^>]*>", " ", box.replace("<wbr>", "")).split())


def test_failed_checks_stand_beside_the_verdict(html):
    """Requirement, parameter, value, limit and reason of each check that is not good; no good one."""
    box = verdict_box(html)
    for word in (
        "FAIL 5 cases",
        "ADCS-GYR-030 rate_error [z] -0.712 ± 0.098 -0.5 to 0.5 deg/s guarded FAIL",
        "ADCS-GYR-030 rate_error [y] 0.461 ± 0.098",
        "closer to it than the expanded uncertainty",
    ):
        assert word in box.replace("(", "").replace(") deg/s", "")
    assert "[x]" not in box
    assert "ADCS-GYR-040" not in box


def test_cases_that_broke_stand_beside_the_verdict_by_reason(tmp_path):
    """Cases of which no check says why they are not good share a row with their reason."""
    cases = [specimen_run.CASES[key] for key in ("rest", "rate", "power")]
    events = [specimen_run.planned(), ("case", 1.0, {"case": cases[0], "attempt": 1})]
    events.append(("case-end", 2.0, specimen_run._end("rest", "ERROR", {}, 1.0, "psu1 fell silent")))
    events += [("not-run", 3.0, {"case": case, "reason": "the bench tripped"}) for case in cases[1:]]
    box = verdict_box(page_of(tmp_path, events=events))
    assert "psu1 fell silent ERROR test_noise_at_rest" in box
    assert box.count("the bench tripped") == 1
    assert "the bench tripped NOT_RUN test_rate_error[45 degC], test_supply_current" in box.replace(" ,", ",")


def test_several_reasons_of_one_case_are_a_list(tmp_path):
    """A case that was aborted for more than one reason has a line for each, beside the verdict."""
    end = specimen_run._end("power", "ABORTED", {}, 1.0, "stopped by Ada") | {
        "reasons": ["stopped by Ada", "A-1 got no check of u"]
    }
    events = [specimen_run.planned(), ("case", 1.0, {"case": specimen_run.CASES["power"], "attempt": 1})]
    page = page_of(tmp_path, events=[*events, ("case-end", 2.0, end)])
    assert "<li>stopped by Ada</li><li>A-1 got no check of u</li>" in page


def test_what_keeps_every_requirement_open_is_told_once(html):
    """The badge stands once, with `all 4`; the requirements below name their own reasons and point to the chapter."""
    words = Page(html).words
    assert words.count("cannot close Why") + words.count(" cannot close the run's source is simulated all 4") == 1
    assert html.count("<p>This run can close none of its 4 requirements.</p>") == 1
    chapter = words[words.index("Text, limits, source") :]
    assert "the run's source is simulated" not in chapter
    assert "This run cannot close it: its verdict is FAIL" in chapter
    assert "and the reasons that apply to all 4" in chapter


def test_a_case_that_never_began_is_one_line(html):
    """It stands among those that were not run, where its links lead, and has no procedure of its own."""
    page = Page(html)
    assert sum(attrs.get("class") == "case" for tag, attrs in page.tags if tag == "article") == 4
    assert page.words.count("skipped: the chamber is away (--skip)") <= 2
    (row,) = [attrs for tag, attrs in page.tags if tag == "tr" and str(attrs.get("id", "")).startswith("case-")]
    assert row["id"] in {attrs["href"][1:] for _, attrs in page.tags if "href" in attrs}


def placed(bodies):
    """Return the events of a journal, placed."""
    return attributed(events_of(bodies))


def test_recordings_of_a_case_that_are_alike_share_a_row():
    """Nine equal recordings are one row with their numbers and the span of their gaps; others keep theirs."""
    channel = {"name": "x", "unit": "uT", "instrument": "mag1"}
    events = []
    for number, name, gap in ((1, "field", 0.1), (2, "field", 0.2), (3, "rest", 0.1), (4, "field", 0.3)):
        identifier = f"00{number}-c-{name}"
        begun = {"case": "c", "recording": identifier, "name": name, "channels": [channel], "rate": 40.0}
        events.append({"kind": "recording", **begun, "duration": 1.0, "source": "simulated"})
        end = {"recording": identifier, "rows": 40, "gaps": gap, "complete": True}
        events.append({"kind": "recording-end", **end})
    field, rest = recording_rows(placed(events))
    assert (field.id, field.count, field.gap, field.rows) == ("001 to 002, 004-c-field", 3, "0.1 s to 0.3 s", "40")
    assert (rest.id, rest.count, rest.gap) == ("003-c-rest", 1, "0.1 s")


def test_limits_that_rows_fed_have_no_gap_and_one_sentence():
    """Readings of their own stood still meanwhile, which is no hole in the watch; alike ones are told together."""
    channel = {"name": "x", "unit": "V", "instrument": "cycler1"}
    events = []
    for name in ("cell-voltage", "polarity", "plate"):
        begun = {"case": None, "recording": f"envelope-{name}", "name": name, "channels": [channel], "rate": 0.02}
        events.append({"kind": "recording", **begun, "duration": None, "source": "simulated"})
        end = {"recording": f"envelope-{name}", "rows": 61, "gaps": 290_000.0, "complete": True}
        events.append({"kind": "recording-end", **end})
    events += [{"kind": "fed", "limit": name, "recording": "001-c-test"} for name in ("cell-voltage", "polarity")]
    assert [row.gap for row in watched_rows(placed(events))] == ["judged on rows", "judged on rows", "80 h 33 min"]
    (sentence,) = fed_limits(placed(events))
    assert sentence == (
        "cell-voltage, polarity were judged on every row of recording 001-c-test; they were not read"
        " separately while rows arrived in time."
    )


def test_narrow_screens_and_paper_are_foreseen(html):
    """Every table stacks on a narrow screen, so that no verdict is off it; the digests follow their heading at once."""
    tables = [attrs.get("class") for tag, attrs in Page(html).tags if tag == "table"]
    assert all("stack" in table for table in tables)
    assert "@media screen and (max-width: 40rem)" in html
    after = html[html.index("Software and digests</h2>") :]
    assert after.index('class="digest"') < after.index('class="lines small"')


def test_a_good_run_has_nothing_to_explain(tmp_path):
    """Nothing stands beside a verdict that is good."""
    assert "Why not PASS" not in page_of(tmp_path, events=list(one_case("PASS")))


def test_requirements_show_their_place_and_their_limits(html):
    """Document, parents, level, stage, limits and variants come from the frozen catalogue."""
    shown = " ".join(re.sub(r"<[^>]*>", " ", html).split())
    for word in (
        "gyroscope: ADCS-GYR , issue 1.3, Gyroscope characterisation",
        "Parents: ADCS-001",
        "Level: equipment. Stage: qualification.",
        "rate_error [x, y, z] -0.5 to 0.5 deg/s, guarded, TUR at least 2",
        "for each temperature of 10, 45",
    ):
        assert word in shown


def test_a_count_that_is_zero_has_no_drawing():
    """Nothing is drawn of words and of counts that are zero; of an exact value there is a mark without a bar."""
    zero, one = (
        event_of("check", **specimen_run.check(1.0, "c", "A-1", "lost", expanded=0, uncertainty=0, value=value)[2])
        for value in (0.0, 1.0)
    )
    assert points_of([zero, zero]) == (None, None)
    assert [point.expanded for point in points_of([zero, one])] == [None, None]


def test_incidents_are_told(tmp_path):
    """Stops, trips, faults, gaps and a bench left unsafe stand first and in their table."""
    events = [
        *one_case("PASS"),
        ("trip", 3.0, {"limit": "board-current", "value": 0.6, "unit": "A", "text": "above 0.5 A"}),
        ("stop", 3.1, {"reason": "SIGTERM", "urgent": True}),
        ("fault", 3.2, {"device": "psu1", "dut": False, "error": "NoReply", "message": "silent", "hint": "look"}),
        ("safe", 3.3, {"output": "supply.board", "state": "off", "ok": False, "detail": "0.2 A", "duration": 2.0}),
        ("safe-end", 3.4, {"ok": False}),
        (
            "rest",
            3.45,
            {"output": "relays", "state": "released", "ok": False, "detail": "still closed", "duration": 1.0},
        ),
        ("rest", 3.45, {"output": "fan", "state": "off", "ok": True, "detail": "read back", "duration": 1.0}),
        ("recovered", 3.5, {"torn_bytes": 12, "text": "sealed as it is"}),
    ]
    words = Page(page_of(tmp_path, events=events)).words
    for expected in (
        "INTERRUPTED:",
        "TRIPPED:",
        "NOT SAFE:",
        "trip board-current: above 0.5 A (0.6 A)",
        "stop SIGTERM, at once",
        "fault psu1 (the bench): NoReply: silent; look",
        "supply.board off not proven 0.2 A 2 s",
        "rest state relays not released: still closed",
        "recovery sealed as it is (12 torn bytes were cut off and kept)",
    ):
        assert expected in words
    assert "fan not off" not in words


def test_recordings_with_the_same_channels_share_a_drawing(folder):
    """Three recordings of one case are one drawing over bench time, with holes in between."""
    material = Material(Package(folder))
    (event,) = Package(folder).of(Recording)
    (graphic,) = recording_graphics(material, [event] * 3, [])[event.case]
    assert graphic.title == "rest (3 recordings)"
    assert graphic.described.startswith("x from -0.")
    assert re.findall(r'class="line c0 d0" d="([^"]*)"', graphic.svg)[1].count("M") == 3  # after the legend's


def test_what_the_envelope_watched_has_its_limits(folder):
    """A recording of no case is drawn over the limits that the bench file sets for its name."""
    (event,) = Package(folder).of(Recording)
    watched = msgspec.structs.replace(event, case=None, name="board")
    limits = [{"id": "board", "unit": "deg/s", "min": "-1", "max": "1"}, {"id": "other", "unit": "degC", "max": "99"}]
    (graphic,) = recording_graphics(Material(Package(folder)), [watched], limits, end=7200.0)[""]
    assert graphic.title == "board"
    assert graphic.svg.count('class="band"') == 1
    assert ">bench time / min<" in graphic.svg  # the axis goes over the whole run, however long it was watched


def test_what_a_recording_fed_stands_behind_it(folder):
    """Limits that a recording fed stand behind the channel that they are judged on, and behind no other quantity."""
    (event,) = Package(folder).of(Recording)
    own = {"id": "rate", "quantity": "x", "unit": "deg/s", "min": "-1", "max": "1"}
    limits = [
        own,
        {**own, "id": "difference", "against": "y"},
        {**own, "id": "slope", "of": "x"},
        {**own, "id": "not fed"},
    ]
    fed = [event_of("fed", limit=name, recording=event.recording) for name in ("rate", "difference", "slope")]
    material = Material(Package(folder))
    (with_fed,) = recording_graphics(material, [event], limits, fed)[event.case]
    (without,) = recording_graphics(material, [event], limits)[event.case]
    assert [graphic.svg.count('class="band"') for graphic in (with_fed, without)] == [1, 0]
    watched = msgspec.structs.replace(event, case=None, name="rate")
    assert "" not in recording_graphics(material, [watched], limits, fed)  # its readings ended where the rows began


def test_uncommitted_changes_are_named_not_printed(tmp_path):
    """A long difference to the commit is told by size and hash; the package holds it."""
    folder = specimen_run.build(tmp_path, events=list(one_case("PASS")))
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, copy_function=shutil.copyfile)
    for place in (copy, copy / "data"):
        place.chmod(0o755)
    (copy / "data/software.json").write_text(
        json.dumps({"format": 1, "packages": {"click": "8.5.1", "numpy": "2.4"}, "difference": "- secret\n" * 9999})
    )
    words = Page(make_reports(copy, found_of(copy))[HTML].decode()).words
    assert "difference 9999 lines with SHA-256" in words
    assert "packages click 8.5.1, numpy 2.4" in words
    assert "secret" not in words


def test_code_of_others_is_told_in_sentences(tmp_path):
    """Drivers of other packages, and what Python executed when it started, with what stands against it."""
    folder = specimen_run.build(tmp_path, events=list(one_case("PASS")))
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, copy_function=shutil.copyfile)
    for place in (copy, copy / "data"):
        place.chmod(0o755)
    told = "driver ina226 of package hil-ina226 1.2 is as it was installed from an index"
    reason = "Python executed site-packages/x.pth when it started, which is of no installed package"
    results = json.loads((copy / "data/results.json").read_text())
    results["conditions"] += [
        {"name": "others", "proven": True, "text": told},
        {"name": "start", "proven": False, "text": reason},
    ]
    (copy / "data/results.json").chmod(0o644)
    (copy / "data/results.json").write_text(json.dumps(results))
    words = Page(make_reports(copy, found_of(copy))[HTML].decode()).words
    assert f"code from other packages {told}" in words
    assert f"code run at Python start-up {reason}" in words


def test_cases_called_the_same_keep_their_files(tmp_path):
    """A table shortens the name of a case only where that leaves no doubt."""
    cases = [
        {"case": case, "title": "", "plan": "p", "requirements": ["ADCS-GYR-040"], "max_duration": 1.0}
        for case in ("p/test_a.py::test_x", "p/test_b.py::test_x", "p/test_b.py::test_y")
    ]
    page = page_of(tmp_path, events=[("planned", 0.0, {"cases": cases})]).replace("<wbr>", "")
    assert '<a class="any" href="#case-1">p/test_a.py::test_x</a>' in page
    assert '<a class="any" href="#case-3">test_y</a>' in page


def colours(block):
    """Return the colours that a block of variables gives."""
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", block))


def luminance(colour):
    """Return relative luminance as WCAG 2.2 defines it."""
    parts = [int(colour[start : start + 2], 16) / 255 for start in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("place", [0, 1, 2], ids=["light", "dark", "print"])
def test_every_colour_of_text_can_be_read(place):
    """Text stands out from what is behind it by 4.5 to 1 or more, light, dark and printed."""
    css = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    found = colours(re.findall(r":root \{(.*?)\}", css, flags=re.DOTALL)[place])
    for text, behind in [
        *((text, behind) for text in ("ink", "soft", "accent", "good", "bad", "open") for behind in ("paper", "panel")),
        ("good", "good-wash"),
        ("bad", "bad-wash"),
        ("open", "open-wash"),
        ("ink", "open-wash"),
    ]:
        light, dark = sorted((luminance(found[text]), luminance(found[behind])), reverse=True)
        assert (light + 0.05) / (dark + 0.05) >= 4.5, (text, behind)


def test_readiness_gates_are_told_per_arming(tmp_path):
    """With a heading each, and a cut path that was not tried is not said to have held."""
    path = {
        "name": "cut path of cycler: fuse",
        "ok": True,
        "detail": "within 1 s; not tried: no software is part of it",
    }
    armed = [
        ("gate", 1.0, {"name": "identity psu1", "ok": True, "detail": "X"}),
        ("gate", 1.5, path),
        ("armed", 2.0, {}),
    ]
    entry = {"boundary": 6, "void_to": 6, "operations": 0, "number": 1, "rows": [], "kept": "", "place": 6}
    resumed = ("resumed", 60.0, {"text": "interrupted", "seconds": 9.0, "deviation": "", "entry": entry})
    again = [(kind, t + 60.0, fields) for kind, t, fields in armed]
    words = Page(page_of(tmp_path, events=[*armed, resumed, *again, *one_case("PASS")])).words
    assert "Arming, at 0:00:01.0 of bench time" in words
    assert "Armed again, at 0:01:01.0 of bench time passed identity psu1 X" in words
    assert "not tried cut path of cycler: fuse within 1 s" in words


def test_a_name_breaks_between_its_words(tmp_path):
    """Beside a long reason its column keeps a width, and a long name is broken after an underscore first."""
    events = list(one_case("FAIL", reason="a reason " * 40))
    page = page_of(tmp_path, events=events)
    assert re.search(r'<td class="any name"><a class="any" href="#case-1">test_<wbr>a</a>', page)
    assert re.search(r"\.name \{ min-width: \d+rem; \}", page)


@pytest.fixture
def damaged(folder, tmp_path):
    """Return a copy of the specimen of which one file was changed."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, copy_function=shutil.copyfile)
    (copy / "data/dut.json").write_text('{"format":1}')
    return copy


def test_a_damaged_package_has_a_marked_report_without_a_verdict(damaged, html):
    """DAMAGED stands on every page and in the title; there is no verdict, no digest, and nothing that it can close."""
    finding = Finding("data/dut.json", 0, 0, "changed after the seal")
    found = make_reports(damaged, found_of(damaged, State.DAMAGED, finding))
    page, words = found[HTML].decode(), Page(found[HTML].decode()).words
    title = re.search("<title>(.*)</title>", page)[1]
    assert title.startswith("- · ")
    assert "DAMAGED" in title
    assert "DAMAGED" in re.search('<div class="running".*?</div>', page, re.DOTALL)[0]
    assert "data/dut.json: changed after the seal" in words
    assert "A damaged package closes nothing." in words
    assert "no evidence digest" in words
    assert Package(damaged).evidence_digest in html
    assert Package(damaged).evidence_digest not in page
    junit = found[JUNIT].decode()
    assert junit.count("<testcase ") == junit.count('<error type="DAMAGED"') == 1
    assert "PASS" not in junit


def test_a_run_that_is_not_sealed_has_a_marked_report(folder, tmp_path):
    """What was recorded so far can be read, and says on every page that it is no evidence."""
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy, copy_function=shutil.copyfile)
    (copy / "bagit.txt").unlink()
    page = make_reports(copy)[HTML].decode()
    assert "NOT SEALED" in re.search('<div class="running".*?</div>', page, re.DOTALL)[0]
    assert "this is what was recorded so far, not evidence" in Page(page).words


@pytest.mark.parametrize(
    ("value", "tur", "shown"), [(None, 51.0, "not known"), (None, None, "not known"), (1.0, 51.0, "51")]
)
def test_a_value_that_is_not_a_number_has_no_known_ratio(value, tur, shown):
    """Whatever an earlier version wrote down of it."""
    limit = {"min": "-1", "max": "1", "equals": None}
    check = event_of("check", value=value, tur=tur, limit=limit, limit_unit="A", unit="A", decision="guarded")
    assert check_row(check).tur == shown
    assert check_row(msgspec.structs.replace(check, limit=event_of("check", limit={"max": "1"}).limit)).tur in {
        "",
        "51",
    }
