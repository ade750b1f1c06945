"""The ordinary specimen, made once for all tests of reports."""

from __future__ import annotations

import pytest
import specimen_run


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """The sealed folder of the ordinary specimen."""
    return specimen_run.build(tmp_path_factory.mktemp("reports"))


@pytest.fixture(scope="session")
def html(folder):
    """The page of the ordinary specimen."""
    return (folder / "data/report/report.html").read_text(encoding="utf-8")
