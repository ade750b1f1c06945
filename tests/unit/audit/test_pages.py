"""The page and the workbook of an audit: whole, safe to open, and the same bytes for the same document."""

from __future__ import annotations

import base64
import hashlib
import io
import re
import zipfile
from html.parser import HTMLParser
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import msgspec
import pytest
from audit_documents import document, document_of, row
from msgspec.structs import replace

from hil.audit.document import Evidence, Gap, GapKind, Planning
from hil.audit.pages.page import as_html
from hil.audit.pages.workbook import as_xlsx
from hil.audit.reasons import Code, Reason

CELL = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>&amp;"
FORMULAS = ('=HYPERLINK("http://x","y")', "+1+1", "-2", "@SUM(A1)", "\t=1", "http://example.org/", "mailto:x@y")


class Page(HTMLParser):
    """Collects what a browser would see of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.shown: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        """Note an element."""
        self.tags.append((tag, dict(attrs)))
        self._inside = tag

    def handle_endtag(self, tag):
        """Leave an element."""
        self._inside = ""

    def handle_data(self, data):
        """Note a text that is shown."""
        if self._inside not in {"script", "style"}:
            self.shown.append(data)

    def attributes(self, name: str) -> list[str]:
        """Return every value of an attribute."""
        return [value or "" for _, attributes in self.tags for key, value in attributes.items() if key == name]


def page(found, reports="../reports") -> tuple[str, Page]:
    """Return a document's page as text, and as a browser sees it."""
    text = "".join(as_html(found, reports))
    return text, Page(text)


def sheets(found) -> dict[str, list[list[str]]]:
    """Return the cells of a document's workbook as any reader of the format finds them, by sheet."""
    with zipfile.ZipFile(io.BytesIO(as_xlsx(found))) as book:
        names = re.findall(r'<sheet name="([^"]+)"', book.read("xl/workbook.xml").decode())
        return {name: list(_cells(book.read(f"xl/worksheets/sheet{at}.xml"))) for at, name in enumerate(names, 1)}


def _cells(data: bytes):
    for line in ET.fromstring(data).iter(f"{CELL}row"):  # noqa: S314 - made a line above
        yield ["".join(cell.itertext()) for cell in line.iter(f"{CELL}c")]


def hostile():
    """Return a document in which every text that somebody else wrote is markup."""
    bad = Evidence(
        package=HOSTILE,
        digest=HOSTILE,
        date=HOSTILE,
        verdict=HOSTILE,
        cases=(HOSTILE,),
        rev=1,
        source=HOSTILE,
        purpose=HOSTILE,
        dut=HOSTILE,
        eligible=False,
        closes=False,
    )
    texts = dict.fromkeys(("id", "text", "kind", "method", "source", "anomaly", "level", "stage"), HOSTILE)
    reasons = (Reason(code=Code.NOT_ELIGIBLE, text=HOSTILE, package=HOSTILE, origin=HOSTILE),)
    planning = Planning(plan=HOSTILE, document=HOSTILE, issue=HOSTILE, place=HOSTILE, cases=(HOSTILE,))
    lists = {"parents": (HOSTILE,), "children": (HOSTILE,), "evidence": (bad,), "reasons": reasons}
    one = row(1, **texts, **lists, planning=planning)
    gaps = tuple(Gap(kind=kind, name=HOSTILE, where=HOSTILE) for kind in GapKind)
    return document_of([one], workspace=HOSTILE, as_of=HOSTILE, version=HOSTILE, problems=(HOSTILE,), gaps=gaps)


def test_markup_in_any_text_is_text():
    """A requirement's text, a package's name or a reason is markup: it is shown, and nothing of it is obeyed."""
    text, seen = page(hostile())
    assert text.count("<script") == 1
    assert [tag for tag, _ in seen.tags].count("script") == 1
    assert {"img", "iframe", "object", "link"} & {tag for tag, _ in seen.tags} == set()
    assert not any(key.startswith("on") for _, attributes in seen.tags for key in attributes)
    assert "".join(seen.shown).count("<script>alert(1)</script>") > 15
    assert "&amp;amp;" in text


def test_marks_that_hide_or_reorder_text_are_shown():
    """A right-to-left override would show another verdict than there is."""
    found = document_of([row(1, text="limit \u202e9.0 TLOV\x00\ud800")])
    expected = "limit U+202E9.0 TLOVU+0000U+D800"
    assert expected in "".join(page(found)[1].shown)
    assert sheets(found)["Requirements"][1][1] == expected


def test_the_page_needs_nothing_from_elsewhere():
    """Every link leads into the page or into a package, and the only script is the one that the policy names."""
    text, seen = page(document(8))
    assert "src" not in {key for _, attributes in seen.tags for key in attributes}
    links = seen.attributes("href")
    assert all(link.startswith(("#", "../reports/2026")) for link in links), links
    anchors = set(seen.attributes("id"))
    assert {unquote(link[1:]) for link in links if link.startswith("#")} <= {unquote(name) for name in anchors}
    script = text.partition("<script>")[2].partition("</script>")[0]
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'" in text
    assert "@import" not in text
    assert "url(" not in text


def test_links_lead_into_the_packages():
    """A package is linked where it lies, whatever its name; what escapes the folder does so in no browser."""
    one = row(5, references=1)
    _, seen = page(document_of([one]))
    name = one.evidence[0].package
    assert f"../reports/{name}/data/report/report.html" in seen.attributes("href")
    odd = replace(one.evidence[0], package="a b#?\ud800")
    _, seen = page(document_of([row(1, evidence=(odd,), reasons=())]), reports="")
    assert "a%20b%23%3F%ED%A0%80/data/report/report.html" in seen.attributes("href")


def test_the_ten_columns():
    """Identifier, text, traceability, stages, methods, planning, evidence, both statuses and reasons are there."""
    found = document(5)
    _, seen = page(found)
    shown = "".join(seen.shown)
    one = found.rows[0]
    for text in (
        one.id,
        one.text,
        one.parents[0],
        one.level,
        one.stage,
        one.method,
        "ADCS-GYR 1.0",
        "test_rate[1]",
        one.evidence[0].package,
        one.compliance.value,
        one.close_out.value,
        one.reasons[0].code.value,
        one.reasons[0].text,
    ):
        assert text in shown, text
    assert sheets(found)["Requirements"][0] == [
        "Requirement",
        "Text",
        "Traceability",
        "Levels and stages",
        "Methods",
        "Planning documents",
        "References to evidence",
        "Status of compliance",
        "Close-out status",
        "Reasons of the close-out status",
    ]


def test_the_summary_says_how_much_and_why():
    """What is closed, what is open for which reason, what hardware would close, and both directions of gaps."""
    found = document(10, problems=("one package cannot be used",))
    shown = re.sub(r"\s+", " ", "".join(page(found)[1].shown))
    assert "2 of 11 closed" in shown
    for code, count in found.summary.reasons.items():
        assert f"{code}{Code(code).meaning}{count}" in shown
    assert "Requirements without a case 1" in shown
    assert "Cases without a requirement 1" in shown
    assert "one package cannot be used" in shown
    assert "CHILD_OPEN ADCS-GYR-00001 is open" in shown  # where a parent has its reason from
    other = document_of([row(1, reasons=(Reason(code=Code.FAILED, text="it failed", origin="ADCS-2"),))])
    assert "it failed from ADCS-2" in "".join(page(other)[1].shown)


def test_what_reasons_share_is_told_once():
    """A package is named once above its reasons, a code once before them, and codes that children share once."""
    told = [(Code.NOT_ELIGIBLE, "no operator is named"), (Code.NOT_ELIGIBLE, "late"), (Code.SIM_ONLY, "simulated")]
    reasons = [Reason(code=code, text=text, package="run-1") for code, text in told]
    reasons += [Reason(code=Code.CHILD_OPEN, text=f"{name} is open: FAILED", origin=name) for name in ("A-1", "A-2")]
    shown = re.sub(r"\s+", " ", "".join(page(document_of([row(1, evidence=(), reasons=tuple(reasons))]))[1].shown))
    assert "CHILD_OPEN A-1, A-2 are open: FAILEDrun-1NOT_ELIGIBLE no operator is named; lateSIM_ONLY simulated" in shown


def test_cases_of_one_function_are_told_together():
    """Parameters of a function stand behind its name once, as they are planned."""
    cases = ("p/test_a.py::test_x[a]", "p/test_a.py::test_x[b]", "p/test_a.py::test_y")
    one = row(1)
    one = msgspec.structs.replace(one, planning=msgspec.structs.replace(one.planning, cases=cases))
    assert "test_x[a, b]test_y" in "".join(page(document_of([one]))[1].shown)


@pytest.mark.parametrize("kind", GapKind)
def test_every_kind_of_gap_has_a_title(kind):
    """A kind that nobody has named would be a page that breaks."""
    assert "thing" in "".join(page(document(1, gaps=(Gap(kind=kind, name="thing"),)))[1].shown)


@pytest.mark.parametrize("text", FORMULAS)
def test_a_spreadsheet_computes_nothing(text):
    """A text that looks like a formula or a link is a text in every cell of the workbook, and stays as it is."""
    found = document_of([row(1, id=text, text=text, method=text)], gaps=(Gap(kind=GapKind.WITHOUT_CASE, name=text),))
    with zipfile.ZipFile(io.BytesIO(as_xlsx(found))) as book:
        for name in book.namelist():
            if name.startswith("xl/worksheets/"):
                assert re.search(rb"<f>|<hyperlink", book.read(name)) is None, name
    cells = sheets(found)
    assert cells["Requirements"][1][:2] == [text, text]
    assert cells["Gaps"][1][1] == text


def test_a_cell_that_is_too_long_says_so():
    """What a spreadsheet cannot hold is cut, and the cell says that it was."""
    cell = sheets(document_of([row(1, text="x" * 40_000)]))["Requirements"][1][1]
    assert len(cell) == 32_767
    assert cell.endswith("xx … (the rest is in the other formats)")


def test_equal_documents_give_equal_bytes():
    """Neither the time nor the place of an audit is in what it writes."""
    assert "".join(as_html(document(30), "r")) == "".join(as_html(document(30), "r"))
    assert as_xlsx(document(30)) == as_xlsx(document(30))


def test_an_empty_catalogue_is_shown():
    """A workspace without requirements has a page, too, and no division by zero."""
    found = document_of([row(1)])
    nothing = type(found.summary)(requirements=0, closed=0, open=0, compliance={}, reasons={}, gaps={})
    empty = replace(found, rows=(), gaps=(), summary=nothing, inputs=type(found.inputs)(catalogue=""))
    shown = "".join(page(empty)[1].shown)
    assert "0 of 0 closed" in shown
    assert "Every requirement has a case, and every case a requirement." in shown
    assert len(sheets(empty)["Requirements"]) == 1
