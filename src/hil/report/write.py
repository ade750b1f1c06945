"""The reports of a run, written into its folder before the seal, or made again from a sealed one."""

from __future__ import annotations

from pathlib import Path

from hil.evidence.durable import write_whole
from hil.evidence.folder import REPORT
from hil.evidence.package.contents import Package
from hil.report.from_package import PackageMaterial
from hil.report.junit import junit
from hil.report.page.assemble import assemble
from hil.report.page.rendering import render

__all__ = ["HTML", "JUNIT", "make_reports", "write_reports"]

HTML = "report.html"
JUNIT = "junit.xml"


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
    digest, material = package.evidence_digest, PackageMaterial(package)
    view = assemble(material, digest)
    return {
        HTML: render(view).encode("utf-8", errors="replace"),
        JUNIT: junit(material.results(), run=material.run(), began=material.stamps()[0], evidence_digest=digest),
    }
