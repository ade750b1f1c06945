"""What properties share."""

from __future__ import annotations

from quick_disk import nothing_waits_for_the_disk  # noqa: F401 - a fixture
