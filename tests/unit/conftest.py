"""What the tests of units share."""

from __future__ import annotations

from read_once import equal_documents_are_read_once  # noqa: F401 - a fixture
