"""The reports of a run, written into its folder before the seal, or regenerated from a sealed one.

The page is one HTML file that needs no network and no script, on a screen and on A4.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from hil.evidence.durable import write_whole
from hil.evidence.folder import REPORT
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import State, Verification, verify
from hil.report.junit import junit, junit_of_damage
from hil.report.material import Material
from hil.report.page.assemble import assemble
from hil.report.page.view import RunView

if TYPE_CHECKING:
    import jinja2

__all__ = ["HTML", "JUNIT", "TEMPLATES", "copy_junit", "make_reports", "write_reports"]

HTML = "report.html"
JUNIT = "junit.xml"
_MOST_FAILED = 12  # checks, and cases, that are listed beside the verdict; the sections below list all
TEMPLATES = Path(__file__).parent / "page/templates"
# Controls, and marks that reorder or hide text: they are shown by their number, never obeyed.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)


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
    return {HTML: _page(_damaged(view, sentence)), JUNIT: junit_of_damage(view.run, sentence)}


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
