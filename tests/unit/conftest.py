"""What the tests of units share."""

from __future__ import annotations

from quick_disk import nothing_waits_for_the_disk  # noqa: F401 - a fixture
from read_once import equal_documents_are_read_once  # noqa: F401 - a fixture
