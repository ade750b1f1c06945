"""Documents that are read once: hundreds of workspaces of the tests hold the same bench file."""

from __future__ import annotations

import pytest

from hil.documents import declared
from hil.documents.strict_yaml import parse_yaml

__all__ = ["equal_documents_are_read_once"]


@pytest.fixture(scope="session", autouse=True)
def equal_documents_are_read_once():
    """Remember the trees of documents without findings; those with any are read each time."""
    trees = {}

    def remembered(data, shown, findings):
        before = len(findings)
        tree = trees[data, shown] if (data, shown) in trees else parse_yaml(data, shown, findings)
        if tree is not None and len(findings) == before:
            trees[data, shown] = tree
        return tree

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(declared, "parse_yaml", remembered)
        yield
