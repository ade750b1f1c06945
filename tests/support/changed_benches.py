"""The benches of this repository with some texts changed, and what is said of them."""

from __future__ import annotations

import shutil

from workspaces import ROOT

from hil.bench.file.reading import load_bench
from hil.model.errors import ConfigurationError

__all__ = ["FILE", "found", "laid", "loaded", "place"]

FILE = "fixtures/benches/{}/bench.yaml"


def laid(root, changes, bench="battery"):
    """Lay the committed bench with some texts changed into the workspace `root`; return its text."""
    shutil.copytree(ROOT / "fixtures", root / "fixtures", ignore=shutil.ignore_patterns("__pycache__"))
    file = root / FILE.format(bench)
    text = file.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1, (text.count(old), old)
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    return text


def loaded(root, changes, bench="battery"):
    """Return the bench with some texts changed."""
    laid(root, changes, bench)
    return load_bench(root / "fixtures/benches", bench, root)


def found(root, changes, bench="battery"):
    """Return the text of the file, and what is said of it."""
    text = laid(root, changes, bench)
    try:
        load_bench(root / "fixtures/benches", bench, root)
    except ConfigurationError as error:
        return text, [str(finding) for finding in error.findings]
    return text, []


def place(text, snippet, bench):
    """Return file, line and column of a snippet; that of a list's item begins after its dash."""
    before = text[: text.index(snippet) + 2 * snippet.startswith("- ")]
    return f"{FILE.format(bench)}:{before.count(chr(10)) + 1}:{len(before) - (before.rfind(chr(10)) + 1) + 1}: "
