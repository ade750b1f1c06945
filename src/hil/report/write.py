"""The reports of a run, written into its folder before the seal, or derived again from a sealed one.

The page is one HTML file that needs no network and no script, on a screen and on A4.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from hil.evidence.durable import write_whole
from hil.evidence.folder import REPORT
from hil.evidence.package.contents import Package
from hil.report.junit import junit
from hil.report.material import Material
from hil.report.page.assemble import assemble
from hil.report.page.view import RunView

if TYPE_CHECKING:
    import jinja2

__all__ = ["HTML", "JUNIT", "TEMPLATES", "make_reports", "write_reports"]

HTML = "report.html"
JUNIT = "junit.xml"
_MOST_FAILED = 12  # checks, and cases, that are named beside the verdict; the sections below name all
TEMPLATES = Path(__file__).parent / "page/templates"
# Controls, and marks that reorder or hide text: they are shown by their number, never obeyed.
_UNSEEN = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)


def make_reports(folder: Path) -> dict[str, bytes]:
    """Return the reports of a run by their file names; the same package gives the same bytes.

    Args:
        folder: the run's folder, sealed or not; nothing in it is touched.

    Raises:
        EvidenceError: where journal or results cannot be read.
    """
    return _reports(Package(folder))


def write_reports(package: Package) -> None:
    """Write `data/report/` of a run whose other files are final.

    Raises:
        EvidenceError: where journal or results cannot be read.
    """
    place = package.folder / REPORT
    place.mkdir(parents=True, exist_ok=True)
    for name, content in _reports(package).items():
        write_whole(place / name, content)


def _reports(package: Package) -> dict[str, bytes]:
    digest, material = package.evidence_digest, Material(package)
    view = assemble(material, digest)
    return {
        HTML: _render(view).encode("utf-8", errors="replace"),
        JUNIT: junit(material.results(), run=material.run(), began=material.stamps()[0], evidence_digest=digest),
    }


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
