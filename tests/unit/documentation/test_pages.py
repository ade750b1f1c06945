"""What the documentation promises of itself."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
RECORDS = sorted((DOCS / "explanations" / "decisions").glob("*.md"))
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def shown(path):
    """Return a path as the test's name shows it."""
    return path.relative_to(ROOT).as_posix()


def anchors(page):
    """Return the anchors that a page's headings give."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=shown)
def test_links_lead_somewhere(page):
    """Every relative link of a page names a file that exists, and a heading of it."""
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        found = (page.parent / path).resolve() if path else page
        assert found.exists(), f"{target} does not exist"
        assert not anchor or anchor in anchors(found), f"{target} has no such heading"


@pytest.mark.parametrize(
    "page", [page for page in PAGES if "git add -A" in page.read_text(encoding="utf-8")], ids=shown
)
def test_a_commit_of_everything_leaves_packages_out(page):
    """A page that has its reader commit a whole folder has packages ignored first: they change with every run."""
    before, _, _ = page.read_text(encoding="utf-8").partition("git add -A")
    assert "`.gitignore`:\n\n```text\nreports/\n" in before


def test_every_page_is_on_the_map():
    """The map names every page but itself; decision records have a test of their own."""
    map_ = (DOCS / "README.md").read_text(encoding="utf-8")
    pages = [page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md") if page not in RECORDS]
    assert [page for page in pages if page != "README.md" and f"({page})" not in map_] == []


def test_every_record_is_on_the_map():
    """The map names every decision record, and no number is missing or used twice."""
    map_ = (DOCS / "README.md").read_text(encoding="utf-8")
    assert [record.name[:4] for record in RECORDS] == [f"{number:04}" for number in range(len(RECORDS))]
    assert [record.name for record in RECORDS if record.name not in map_] == []


@pytest.mark.parametrize("record", RECORDS, ids=shown)
def test_records_have_four_parts(record):
    """A decision record has status, context, decision and consequences, in this order."""
    headings = re.findall(r"^## (.+)$", record.read_text(encoding="utf-8"), re.MULTILINE)
    assert headings == ["Status", "Context", "Decision", "Consequences"]


def test_every_dependency_has_its_reason():
    """Every dependency of the project has a row in the record of dependencies, and no row is left over."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["dev"]]
    names = [re.split(r"[<>=]", requirement)[0] for requirement in wanted]
    record = (DOCS / "explanations" / "decisions" / "0002-dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([a-z0-9-]+)[,a-z0-9 ]* \|", record, re.MULTILINE)
    assert sorted(row for row in rows if row != "dependency") == sorted(names)
